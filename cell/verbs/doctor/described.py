"""Whether the cell file says all that a run asks of it before the arm moves."""

from __future__ import annotations

from calib.chain.kinematics import MODELS, UnknownArm, arm
from cell.sequencer.bounded import check_bounded
from cell.storage.files.cell_file import CellFile
from cell.verbs.doctor.finding import Finding
from drivers.errors import SafetyError


def described(cell: CellFile) -> list[Finding]:
    """The arm's kinematics, and for a real arm the place it may move in."""
    real = cell.robot.driver != "sim"
    return [_kinematics(cell, needed=real), *([_bounds(cell)] if real else [])]


def _kinematics(cell: CellFile, *, needed: bool) -> Finding:
    model = cell.robot.model
    name, mend = "arm's kinematics", f"write one of {', '.join(MODELS)}, or a `robot.urdf`"
    if model is None:
        return Finding(name, False, "no robot.model: the arm cannot be moved", mend, needed=needed)
    try:
        return Finding(name, True, arm(model).name)
    except UnknownArm:
        return Finding(name, False, f"robot.model {model} is not known", mend)


def _bounds(cell: CellFile) -> Finding:
    name = "workspace and keep-out boxes"
    try:
        check_bounded(cell)
    except SafetyError as missing:
        return Finding(name, False, str(missing), "write them into the cell file")
    found = "workspace" if cell.workspace is not None else f"none: {cell.no_workspace_because}"
    return Finding(name, True, f"{found}, {len(cell.keep_out)} keep-out boxes")
