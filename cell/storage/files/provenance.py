"""When, by which program and of which devices a result was made: the same keys in every file."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from importlib.metadata import version
from typing import Any

PROGRAM = "calibration-cell"


def made_by() -> dict[str, str]:
    """`created`, to the second with its zone, and `program` with its version."""
    now = datetime.now().astimezone().isoformat(timespec="seconds")
    return {"created": now, "program": f"{PROGRAM} {version(PROGRAM)}"}


def provenance(header: Mapping[str, Any]) -> dict[str, Any]:
    """`made_by`, and when and with which camera and robot the recording was taken.

    Parameters
    ----------
    header:
        The content of `recording.yaml`.
    """
    devices = {
        device: {key: (header.get(device) or {}).get(key) for key in ("model", "serial")}
        for device in ("camera", "robot")
    }
    return made_by() | {"recorded": header.get("created")} | devices
