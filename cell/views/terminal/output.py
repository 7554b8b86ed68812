"""What verbs print: results on stdout, everything else on stderr."""

from __future__ import annotations

import json
import logging
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cell.errors import InputError

_kept = logging.getLogger("cell.output")
"""Messages to the operator; they go to the log file alone, stderr has it already."""

_kept.propagate = False
_kept.addHandler(logging.NullHandler())


def show(text: str, result: Mapping[str, Any], *, as_json: bool) -> None:
    """Print a verb's result, for people or for programs."""
    sys.stdout.write((json.dumps(result, default=str) if as_json else text) + "\n")


def say(text: str) -> None:
    """Show the operator something that is not the result."""
    sys.stderr.write(text + "\n")
    _kept.info(text)


def keep_log(path: Path) -> None:
    """Append to a file every message from now on, with its time.

    Raises
    ------
    InputError
        The file cannot be written.
    """
    try:
        handler = logging.FileHandler(path, encoding="utf-8")
    except OSError as fault:
        raise InputError(f"--log {path}: cannot be written: {fault.strerror}") from None
    handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(message)s"))
    _kept.addHandler(handler)
    _kept.setLevel(logging.INFO)
    logging.getLogger().addHandler(handler)


def say_error(text: str) -> None:
    """Show an error; several, one a line, stand below each other, file and line first."""
    say(f"error:\n{text}" if "\n" in text else f"error: {text}")
