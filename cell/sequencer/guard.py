"""What is checked before the arm may move: reach, joint limits, bodies along the path, speed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from calib.bodies import Nearest, Scene
from calib.chain.kinematics import MODELS, ArmKinematics, OutOfReach, UnknownArm, arm
from calib.views import FloatArray
from cell.errors import InputError
from cell.sequencer.bodies import WORKSPACE, outline_m, scene_of
from cell.storage.files.cell_file import CellFile
from cell.storage.files.plan_file import Plan
from drivers.arm import MoveTarget
from drivers.errors import SafetyError

_STEP_RAD = np.radians(3.0)


@dataclass(frozen=True)
class Guard:
    """Refuses what the arm must not do; every move of a run passes through it.

    Attributes
    ----------
    cell:
        Arm, layout, workspace and keep-out boxes.
    speed_m_s, joint_speed_rad_s:
        Greatest speed of flange and camera, and of any joint.
    spare_m:
        Room for what stands in the cell, in addition to the cell's `clearance_m`.
    """

    cell: CellFile
    speed_m_s: float
    joint_speed_rad_s: float
    spare_m: float = field(default=0.0, kw_only=True)
    _answers: dict[bytes, bool] = field(default_factory=dict, init=False, repr=False, compare=False)

    @classmethod
    def of(cls, plan: Plan) -> Guard:
        """The guard of a plan."""
        joint_speed = float(np.radians(plan.file.joint_speed_deg_s))
        return cls(plan.cell, plan.file.speed_m_s, joint_speed)

    @cached_property
    def kinematics(self) -> ArmKinematics:
        """The arm's kinematics, its joints as far as the cell lets them turn.

        Raises `InputError` for a model nobody knows.
        """
        model, ranges = self.cell.robot.model, self.cell.joint_limits_deg
        try:
            known = arm(model or "")
            return (
                known
                if ranges is None
                else replace(known, limits_rad=ranges.narrowed(known.limits_rad))
            )
        except UnknownArm:
            raise InputError(
                f"cell {self.cell.name}: robot.model: {model} is not known; known are"
                f" {', '.join(MODELS)}"
            ) from None

    @cached_property
    def scene(self) -> Scene:
        """The cell's bodies: arm, what it carries, what stands around it."""
        return scene_of(self.cell, self.kinematics)

    @property
    def clearance_m(self) -> float:
        """Nearer than this no body may come to another."""
        return self.cell.clearance_m

    @cached_property
    def _carried_m(self) -> FloatArray:
        """(K, 3) in the flange's frame: where the camera is, or the board's outermost corners."""
        layout = self.cell.layout
        if layout is None:
            return np.zeros((1, 3))
        mounted = layout.mounted.transform()
        if self.cell.mount == "eye_in_hand":
            return np.asarray(mounted.translation[None])
        return np.asarray(mounted.apply(outline_m(self.cell.board.board())))

    def joints_of(self, plan: Plan, index: int, near_rad: FloatArray) -> FloatArray:
        """(6,) joint angles of a plan's view, by the branch nearest to `near_rad`.

        Raises
        ------
        InputError
            The arm cannot reach the view.
        SafetyError
            Its joint angles are outside the arm's limits.
        """
        view = plan.file.views[index]
        where = plan.where(index)
        joints = view.joints()
        if joints is None and view.base_from_flange is not None:
            pose = view.base_from_flange.transform().as_matrix()
            try:
                return self.kinematics.inverse(pose, near_rad)
            except OutOfReach as far:
                raise InputError(f"{where}: is unreachable: {far}") from None
        target = np.asarray(joints, dtype=float)
        if target.shape != (6,):
            raise InputError(f"{where}: has {target.size} joint angles, the arm has 6")
        self._check_limits(target, where)
        return target

    def _check_limits(self, joints_rad: FloatArray, where: str) -> None:
        low, high = self.kinematics.limits_rad.T
        out = np.flatnonzero((joints_rad < low) | (joints_rad > high))
        if out.size:
            reported = ", ".join(
                f"joint {i + 1} at {np.degrees(joints_rad[i]):.1f}° is outside"
                f" {np.degrees(low[i]):.0f}..{np.degrees(high[i]):.0f}°"
                for i in out
            )
            raise SafetyError(f"{where}: {reported}")

    def check_start(self, start_rad: FloatArray) -> None:
        """Raise `SafetyError` where the arm stands outside its limits.

        Between two places within them a straight joint move stays within them.
        """
        try:
            self._check_limits(start_rad, "where the arm stands")
        except SafetyError as refusal:
            raise SafetyError(
                f"{refusal}. Drive it back by hand, or correct `joint_limits_deg` of the cell."
            ) from None

    def path(self, start_rad: FloatArray, end_rad: FloatArray) -> FloatArray:
        """(S, 6) joint angles along the straight joint move, no farther than 3° apart."""
        span = float(np.abs(end_rad - start_rad).max(initial=0.0))
        share = np.linspace(0.0, 1.0, 2 + int(span / _STEP_RAD))[:, None]
        return np.asarray(start_rad + share * (end_rad - start_rad))

    def check_move(self, start_rad: FloatArray, end_rad: FloatArray, where: str) -> None:
        """Raise `SafetyError` where a joint limit or a body refuses the straight joint move."""
        self._check_limits(np.asarray(end_rad, float), where)
        if self._clear(start_rad, end_rad):
            return
        near = self.scene.along(start_rad, end_rad)
        if near is not None:
            raise SafetyError(f"{where}: {self._too_near(near)}")

    def _too_near(self, near: Nearest) -> str:
        x, y, z = near.place_m
        when = "where the arm stands" if near.share == 0 else f"{near.share:.0%} of the way there"
        return (
            f"{_how(near)} at x={x:.3f} y={y:.3f} z={z:.3f} m, {when};"
            f" {1e3 * self.clearance_m:.0f} mm must stay free. Change the view, go over another"
            " one, or correct the cell file (layout, camera.body, carried, workspace, keep_out,"
            " floor_m, clearance_m)."
        )

    def _clear(self, start_rad: FloatArray, end_rad: FloatArray) -> bool:
        for begin in (end_rad, start_rad):  # most moves that are refused are so where they end
            near = self.scene.along(begin, end_rad, self.clearance_m, self.spare_m)
            if near is not None and near.distance_m < self.clearance_m:
                return False
        return True

    def may_move(self, start_rad: FloatArray, end_rad: FloatArray) -> bool:
        """Whether `check_move` lets the arm move; the same move is worked out once."""
        if not self.kinematics.within_limits(end_rad):
            return False
        move = start_rad.tobytes() + end_rad.tobytes()
        if move not in self._answers:
            self._answers[move] = self._clear(start_rad, end_rad)
        return self._answers[move]

    def nearest(self, joints_rad: Sequence[FloatArray]) -> Nearest | None:
        """Where bodies come nearest on a tour through joint angles (N, J); None if nothing can."""
        found = [self.scene.along(here, there) for here, there in pairwise(joints_rad)]
        return min((n for n in found if n is not None), key=lambda n: n.distance_m, default=None)

    def _outer_m(self, path_rad: FloatArray) -> FloatArray:
        """(S, P, 3) flange and what it carries, along a path."""
        flange = self.kinematics.forward(path_rad)
        carried = self._carried_m @ np.swapaxes(flange[..., :3, :3], -1, -2)
        carried = carried + flange[..., None, :3, 3]
        return np.asarray(np.concatenate([flange[..., None, :3, 3], carried], axis=-2))

    def move_time_s(self, start_rad: FloatArray, end_rad: FloatArray) -> float:
        """Least time of a move at the plan's speeds, without acceleration."""
        span = float(np.abs(end_rad - start_rad).max(initial=0.0))
        return span / self._joint_speed_rad_s(start_rad, end_rad) if span else 0.0

    def target(self, start_rad: FloatArray, end_rad: FloatArray, where: str) -> MoveTarget:
        """The move, checked, at a joint speed that keeps flange and camera within the limit.

        Raises
        ------
        SafetyError
            See `check_move`.
        """
        self.check_move(start_rad, end_rad, where)
        return MoveTarget(
            joints_rad=tuple(end_rad.tolist()),
            tcp_speed_m_s=self.speed_m_s,
            joint_speed_rad_s=self._joint_speed_rad_s(start_rad, end_rad),
        )

    def _joint_speed_rad_s(self, start_rad: FloatArray, end_rad: FloatArray) -> float:
        """Speed of the fastest joint at which no outer point exceeds the limit on the path."""
        path = self.path(start_rad, end_rad)
        steps = np.diff(self._outer_m(path), axis=0)
        length_m = float(np.linalg.norm(steps, axis=-1).max(initial=0.0)) * (len(path) - 1)
        span = float(np.abs(end_rad - start_rad).max(initial=0.0))
        if length_m < 1e-9:
            return self.joint_speed_rad_s
        return min(self.joint_speed_rad_s, span * self.speed_m_s / length_m)

    def check_plan(self, plan: Plan, start_rad: FloatArray) -> tuple[FloatArray, ...]:
        """Check all views of a plan in their order; returns the joint angles of each.

        Raises
        ------
        InputError, SafetyError
            With every view that cannot be taken, one a line; a `SafetyError` where one of them
            is refused by a limit.
        """
        self.check_start(start_rad)
        joints: list[FloatArray] = []
        refused: list[Exception] = []
        here = start_rad
        for index in range(len(plan.file.views)):
            try:
                there = self.joints_of(plan, index, here)
                self.check_move(
                    here, there, f"{plan.path}: views.{index} ({plan.view_name(index)})"
                )
            except (InputError, SafetyError) as refusal:
                refused.append(refusal)
                continue
            joints.append(there)
            here = there
        if refused:
            unsafe = any(isinstance(refusal, SafetyError) for refusal in refused)
            text = "\n".join(str(refusal) for refusal in refused)
            raise SafetyError(text) if unsafe else InputError(text)
        return tuple(joints)


def _how(near: Nearest) -> str:
    if near.second == WORKSPACE:
        return f"{near.first} would leave the workspace"
    if near.distance_m <= 0:
        return f"{near.first} would strike {near.second}"
    return f"{near.first} would come within {1e3 * near.distance_m:.1f} mm of {near.second}"
