"""Calls into a device that may block, made in one thread, so that the caller never waits longer.

A register access to a camera that lost its power blocks for seconds inside the vendor's library.
The loop that also owns the arm must not.
"""

from __future__ import annotations

import logging
import queue
import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import TypeVar

from drivers.errors import DeviceUnreachable

_log = logging.getLogger(__name__)
T = TypeVar("T")
_Job = Callable[[], None]


class Bounded:
    """One daemon thread that owns a device and does its calls in order.

    Parameters
    ----------
    device:
        Its name in messages.
    """

    def __init__(self, device: str) -> None:
        self._device = device
        self._jobs: queue.SimpleQueue[_Job | None] = queue.SimpleQueue()
        self._thread: threading.Thread | None = None

    def call(self, job: Callable[[], T], timeout_s: float, what: str) -> T:
        """Do `job` in the thread and return its result or raise its error.

        Raises
        ------
        DeviceUnreachable
            It was not done in time. It goes on in the thread and what it returns is dropped.
        """
        if self._thread is None:
            self._thread = threading.Thread(target=self._work, daemon=True, name=self._device)
            self._thread.start()
        outcome: Future[T] = Future()
        self._jobs.put(lambda: _run(job, outcome))
        try:
            return outcome.result(timeout_s)
        except TimeoutError:
            raise DeviceUnreachable(
                f"{self._device}: no answer to '{what}' within {timeout_s:.2g} s; "
                "check its power and cable, then connect again"
            ) from None

    def close(self) -> None:
        """Let the thread end after what was ordered. Idempotent."""
        if self._thread is not None:
            self._jobs.put(None)
            self._thread = None
            self._jobs = queue.SimpleQueue()

    def _work(self) -> None:
        jobs = self._jobs
        while (job := jobs.get()) is not None:
            job()
            del job


def _run(job: Callable[[], T], outcome: Future[T]) -> None:
    if not outcome.set_running_or_notify_cancel():
        return
    try:
        outcome.set_result(job())
    except BaseException as error:  # the caller gets it, whatever it is
        _log.debug("failed", exc_info=True)
        outcome.set_exception(_bare(error))


def _bare(error: BaseException) -> BaseException:
    """The error without the frames it came through.

    They hold the device's objects, whose destructors may block for seconds, and would do so in
    the caller's thread, whenever it happens to let go of the error.
    """
    error.__context__ = None
    return error.with_traceback(None)
