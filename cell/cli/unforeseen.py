"""An error that nobody foresaw: one clear line, and the details in a file."""

from __future__ import annotations

import os
import platform
import sys
import tempfile
import traceback
from importlib.metadata import version


def arguments_of(error: BaseException) -> str:
    """What the operator sees of an error in the program itself; its trace goes into a file."""
    if isinstance(error, MemoryError):
        return "the memory of this computer is used up; use fewer or smaller pictures"
    reported = str(error).partition("\n")[0][:200]
    return (
        f"an error in this program: {type(error).__name__}: {reported}. {_kept(error)}"
        " Please report it with that file; nothing that was recorded is lost."
    )


def _kept(error: BaseException) -> str:
    try:
        handle, path = tempfile.mkstemp(prefix="cell-error-", suffix=".log")
        with os.fdopen(handle, "w", encoding="utf-8", errors="backslashreplace") as file:
            file.write(f"cell {version('calibration-cell')}, Python {platform.python_version()}\n")
            file.write(f"{sys.argv}\n\n")
            file.write("".join(traceback.format_exception(error)))
    except OSError as fault:
        return f"Its details could not be kept ({fault.strerror})."
    return f"Its details are in {path}."
