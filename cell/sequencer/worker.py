"""A second thread for whatever may block: the camera, the check of a frame, the disk."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import TypeVar

Result = TypeVar("Result")


class Worker:
    """Does one job after the other in a thread that never keeps the program alive."""

    def __init__(self) -> None:
        self._jobs: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        threading.Thread(target=self._work, name="camera", daemon=True).start()

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
        while True:
            self._jobs.get()()
