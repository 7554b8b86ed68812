"""A second thread for whatever may block: the camera, the check of a frame, the disk."""

from __future__ import annotations

import atexit
import queue
import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import TypeVar

Result = TypeVar("Result")

_LAST_JOB_S = 10.0


class Worker:
    """Does one job after the other in a thread that never keeps the program alive."""

    def __init__(self) -> None:
        self._jobs: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._work, name="camera", daemon=True)
        self._thread.start()
        atexit.register(self._rest)

    def do(self, job: Callable[[], Result]) -> Future[Result]:
        """Queue a job; its result or exception comes with the future."""
        future: Future[Result] = Future()

        def run() -> None:
            try:
                future.set_result(job())
            except BaseException as fault:
                future.set_exception(fault)

        self._jobs.put(run)
        return future

    def _work(self) -> None:
        while (job := self._jobs.get()) is not None:
            job()

    def _rest(self) -> None:
        """At the program's end: a thread inside OpenCV then would abort it, exit status and all."""
        self._jobs.put(None)
        self._thread.join(_LAST_JOB_S)
