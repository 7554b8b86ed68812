"""Says once, when a driver starts, that nobody has yet tried it on the real machine."""

from __future__ import annotations

import logging

_log = logging.getLogger("cell.drivers")
_warned: set[str] = set()


def warn_untried(
    device: str,
    tried_on: str,
    advice: str = "Stay at the emergency stop and begin at low speed.",
) -> None:
    """Log one warning per device and process.

    Parameters
    ----------
    device:
        What it drives, in the operator's words.
    tried_on:
        What it was tried on instead.
    advice:
        What the operator should do about it.
    """
    if device in _warned:
        return
    _warned.add(device)
    _log.warning(
        "%s: this driver was tried on %s, never on the real machine. %s",
        device,
        tried_on,
        advice,
    )
