"""When, by which program and of which devices a result was made, in one line for a page."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def provenance_text(content: Mapping[str, Any]) -> str:
    """One line out of a result file's keys; what is not known is named as such."""
    devices = ", ".join(_device(name, content.get(name) or {}) for name in ("camera", "robot"))
    recorded = content.get("recorded") or "at a time that is not known"
    made = content.get("created") or "at a time that is not known"
    program = content.get("program") or "a program that does not say its name"
    return f"Recorded {recorded}; {devices}. This result: {made}, by {program}."


def _device(name: str, device: Mapping[str, Any]) -> str:
    model, serial = device.get("model") or "of unknown model", device.get("serial")
    return f"{name} {model} (serial {serial or 'not known'})"
