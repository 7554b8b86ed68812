"""What runs on a worker: one task, which always ends in a row."""

from __future__ import annotations

import os
import socket
import time
import traceback

from calib.errors import CalibrationError
from cell.errors import exit_status_of
from cell.storage.files.study_file import Study
from cell.verbs.study.kinds import Row, Task, kind_of

DONE, FAILED = "done", "failed"


def given(study: Study) -> Study:
    """The study, for the workers to have once and not with every task."""
    return study


def work(study: Study, task: Task) -> Row:
    """Do a task; a failure of any kind is a row with its reason."""
    begun = time.process_time()
    row = _head(task, DONE, None)
    try:
        row |= kind_of(study).work(study, task)
    except Exception as error:
        row |= {"status": FAILED, "reason": _reason(error)}
    row["cpu_s"] = time.process_time() - begun
    row["worker"] = f"{socket.gethostname()}:{os.getpid()}"
    return row


def lost(task: Task, reason: str) -> Row:
    """The row of a task that never came to an end."""
    return _head(task, FAILED, reason)


def _head(task: Task, status: str, reason: str | None) -> Row:
    head = {"number": task.number, "key": task.key, "status": status, "reason": reason}
    return head | task.asked()


def _reason(error: Exception) -> str:
    """What an error says; where one that nobody foresaw was raised, too."""
    if isinstance(error, CalibrationError) or exit_status_of(error) is not None:
        return str(error)
    at = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__}: {error} ({at.filename}:{at.lineno})"
