"""The bodies of a cell: the arm, what it carries, and what stands around it.

Everything that is held against the arm is made here, from the cell file alone; how near two of them
come is answered by `calib.bodies`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from calib.bodies import FIXED, Body, Scene, arm_bodies, behind, box, capsule
from calib.bodies.shape import Shape
from calib.chain.kinematics import ArmKinematics
from calib.views import Board, FloatArray
from cell.storage.files.camera_file import CameraBody
from cell.storage.files.cell_file import CellFile, Layout

_BRACKET_M = 0.02
"""Radius of what holds camera or board at the flange, where `carried` does not say more."""

_BOARD_THICK_M = 0.01
WORKSPACE = "workspace"
"""Name of the walls around it."""


def scene_of(cell: CellFile, arm: ArmKinematics) -> Scene:
    """Everything in a cell that must not meet.

    Where the cell has no `layout`, camera and board are left out: nobody knows where they are.
    """
    bodies = [*arm_bodies(arm)[0], *carried_bodies(cell, len(arm.dh)), *standing_bodies(cell)]
    if cell.layout is not None:
        bodies.append(_opposite(cell, cell.layout))
    return Scene(arm, bodies, cell.clearance_m)


def doubtful_scene_of(cell: CellFile, arm: ArmKinematics, uncertainty_m: float) -> Scene:
    """The same where what hangs on the flange may be so far from where `layout` has it.

    The place of what it looks at is not known at all and left out.
    """
    flange = len(arm.dh)
    carried = tuple(carried_bodies(cell, flange))
    around = [_wider(body, uncertainty_m) for body in carried]
    if cell.layout is None:
        ball = capsule(np.zeros(3), np.zeros(3), uncertainty_m)
        around.append(Body("what is at the flange", flange, (ball,), carried=True, doubted=True))
    return Scene(
        arm, [*arm_bodies(arm)[0], *carried, *around, *standing_bodies(cell)], cell.clearance_m
    )


def _wider(body: Body, by_m: float) -> Body:
    shapes = tuple(replace(s, radius_m=s.radius_m + by_m) for s in body.shapes)
    return replace(
        body, name=f"{body.name} (it may be {by_m:.2f} m off)", shapes=shapes, doubted=True
    )


def carried_bodies(cell: CellFile, flange: int) -> Iterator[Body]:
    """What hangs on the flange, link number `flange`."""
    for part in cell.carried:
        yield Body(part.name, flange, (box(part.low_m, part.high_m),), carried=True)
    layout = cell.layout
    if layout is None:
        return
    mounted = layout.mounted.transform().as_matrix()
    if cell.mount == "eye_in_hand":
        yield Body(
            "camera", flange, (_camera(cell.camera.body, mounted).moved(mounted),), carried=True
        )
    else:
        yield Body("board", flange, (_board(cell.board.board()).moved(mounted),), carried=True)
    if not cell.carried and np.linalg.norm(mounted[:3, 3]) > _BRACKET_M:
        bracket = capsule(np.zeros(3), mounted[:3, 3], _BRACKET_M)
        yield Body("bracket", flange, (bracket,), carried=True, clear_of=frozenset({flange - 1}))


def standing_bodies(cell: CellFile) -> Iterator[Body]:
    """What stands in the cell by its own word: boxes, walls of the workspace, floor."""
    for part in cell.keep_out:
        yield Body(f"keep-out box `{part.name}`", FIXED, (box(part.low_m, part.high_m),))
    if cell.workspace is not None:
        yield from _walls(np.array(cell.workspace.low_m), np.array(cell.workspace.high_m))
    if cell.floor_m is not None:
        yield Body("floor", FIXED, (behind([0, 0, cell.floor_m], [0, 0, 1]),))


def _opposite(cell: CellFile, layout: Layout) -> Body:
    """The board that an arm with a camera looks at, or the camera that looks at the arm."""
    fixed = layout.fixed.transform().as_matrix()
    if cell.mount == "eye_in_hand":
        return Body("board", FIXED, (_board(cell.board.board()).moved(fixed),))
    return Body("camera", FIXED, (_camera(cell.camera.body).moved(fixed),))


def _walls(low: FloatArray, high: FloatArray) -> Iterator[Body]:
    """What is outside the workspace, one body a side."""
    for inward in np.eye(3):
        yield Body(WORKSPACE, FIXED, (behind(low, inward),))
        yield Body(WORKSPACE, FIXED, (behind(high, -inward),))


def _camera(body: CameraBody | None, mounted: FloatArray | None = None) -> Shape:
    """Camera, lens and room for the plug and its cable, in the camera's frame.

    Of a camera whose body the file does not give nothing is behind the plane of the flange that it
    is `mounted` on, (4, 4) flange_from_camera.
    """
    given = body or CameraBody()
    across, up = 0.5 * given.width_m, 0.5 * given.height_m
    behind = given.behind_m + given.cable_m
    if body is None and mounted is not None and mounted[2, 2] > 0:
        behind = min(behind, max(0.0, mounted[2, 3] / mounted[2, 2]))
    return box([-across, -up, -behind], [across, up, given.ahead_m])


def _board(board: Board) -> Shape:
    outline = outline_m(board)
    low, high = outline.min(axis=0), outline.max(axis=0)
    return box(low, high + np.array([0.0, 0.0, _BOARD_THICK_M]))


def outline_m(board: Board) -> FloatArray:
    """(4, 3) corners of the board's printed squares, board frame."""
    corners = board.corners_m
    low, high = corners.min(axis=0) - board.square_m, corners.max(axis=0) + board.square_m
    return np.array([[x, y, 0.0] for x in (low[0], high[0]) for y in (low[1], high[1])])
