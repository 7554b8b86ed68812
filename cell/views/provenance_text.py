"""When, by which program and of which devices a result was made, in one line for a page."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def provenance_text(content: Mapping[str, Any]) -> str:
    """One line out of a result file's keys; what is not known is named as such."""
    recorded = content.get("recorded") or "at a time that is not known"
    made = content.get("created") or "at a time that is not known"
    program = content.get("program") or "a program that does not say its name"
    return f"Recorded {recorded}; {_devices(content)}. This result: {made}, by {program}."


def run_provenance_text(content: Mapping[str, Any]) -> str:
    """The same of a run that is going on: since when its page is shown is when it was begun."""
    return f"Begun {content['created']}, by {content['program']}; {_devices(content)}."


def _devices(content: Mapping[str, Any]) -> str:
    return ", ".join(_device(name, content.get(name) or {}) for name in ("camera", "robot"))


def _device(name: str, device: Mapping[str, Any]) -> str:
    model, serial = device.get("model") or "of unknown model", device.get("serial")
    return f"{name} {model} (serial {serial or 'not known'})"
