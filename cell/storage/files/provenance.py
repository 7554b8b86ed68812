"""When and by which program a result was made: the same two keys in every result file."""

from __future__ import annotations

from datetime import datetime
from importlib.metadata import version

PROGRAM = "calibration-cell"


def made_by() -> dict[str, str]:
    """`created`, to the second with its zone, and `program` with its version."""
    now = datetime.now().astimezone().isoformat(timespec="seconds")
    return {"created": now, "program": f"{PROGRAM} {version(PROGRAM)}"}
