"""What verbs print: results on stdout, everything else on stderr."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from typing import Any


def show(text: str, result: Mapping[str, Any], *, as_json: bool) -> None:
    """Print a verb's result, for people or for programs."""
    sys.stdout.write((json.dumps(result, default=str) if as_json else text) + "\n")


def say(text: str) -> None:
    """Tell the operator something that is not the result."""
    sys.stderr.write(text + "\n")


def say_error(text: str) -> None:
    """Tell an error; several, one a line, stand below each other with their file and line first."""
    say(f"error:\n{text}" if "\n" in text else f"error: {text}")
