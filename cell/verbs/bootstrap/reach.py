"""Which views can be taken from where the arm stands, by what is known so far."""

from __future__ import annotations

from dataclasses import dataclass

from calib.chain.kinematics import OutOfReach
from calib.views import FloatArray
from cell.verbs.bootstrap.estimate import Knowledge
from cell.verbs.bootstrap.near_guard import NearGuard
from drivers.errors import SafetyError


@dataclass(frozen=True)
class Reach:
    """Views from here.

    Attributes
    ----------
    known, guard:
        What the frames have shown, and what the arm may do.
    here_rad:
        (6,) where it stands.
    """

    known: Knowledge
    guard: NearGuard
    here_rad: FloatArray

    @classmethod
    def of(cls, known: Knowledge, guard: NearGuard, here_rad: FloatArray) -> Reach:
        """With the fixed part, wherever it may be, to keep out of."""
        return cls(known, guard.with_box(known.fixed_box()), here_rad)

    def joints(self, camera_from_board: FloatArray, name: str) -> FloatArray:
        """(6,) joint angles of a (4, 4) view from which there is a way back to the start.

        Raises
        ------
        SafetyError
            It cannot be taken, or is not sure to show the whole board.
        """
        pose = self.known.flange_for_camera_pose(camera_from_board)
        start = self.guard.start_rad
        try:
            joints = self.guard.kinematics.inverse(pose, start)
        except OutOfReach as far:
            raise SafetyError(f"{name}: {far}") from None
        self.guard.check_move(self.here_rad, joints, name)
        self.guard.check_move(joints, start, name)
        if not self.known.whole_board_visible(pose):
            raise SafetyError(f"{name}: the board might not be whole in the picture")
        return joints
