"""What the controller's states mean, for the operator.

Source: ABB, "Robot Web Services 1.0", panel service: ctrlstate and opmode.
"""

from __future__ import annotations

from typing import Any

_CONTROLLER_STATES = {
    "init": "it is starting: wait",
    "motoroff": "the motors are off: switch them on at the operator panel",
    "guardstop": "guard stop: leave the guarded area, reset the guard, switch the motors on",
    "emergencystop": "emergency stop: release the button and reset it, switch the motors on",
    "emergencystopreset": "emergency stop released: switch the motors on",
    "sysfail": "system failure: look at the FlexPendant and restart the controller",
}
_FAILED = "motion program failed"


def fault_in(rws: Any) -> str | None:
    """Ask for panel states; return what keeps the arm from moving and what to do, or None."""
    # in this order: a key that is turned changes the state, too, maybe between the two questions
    state = rws.get_controller_state()
    mode = rws.get_operation_mode()
    if mode != "AUTO":
        return f"the controller is in mode {mode}: turn the key to automatic and confirm it"
    if state == "motoron":
        return None
    return _CONTROLLER_STATES.get(state, f"the controller is in state {state}")


def failure_in_log(rws: Any) -> str | None:
    """Return what the newest motion program failed of, as its interpreter logged it."""
    entries = rws.read_event_log()
    newest = entries[0] if entries else None
    if newest is None or newest.msgtype < 2 or not newest.args:
        return None
    if newest.args[0].lower() != _FAILED:
        return None
    return " ".join(filter(None, newest.args[1:])) or None
