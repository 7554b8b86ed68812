"""Every mix-up in the log found and mended before physics is asked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.calibration.baseline import Baseline
from calib.calibration.lens_choice import chosen_baseline
from calib.calibration.result import Rejection
from calib.chain import rigid
from calib.chain.effect import Present
from calib.discovery.log_consistency.consistency import mounted_from_fixed
from calib.discovery.log_consistency.conventions import find_conventions
from calib.discovery.log_consistency.corner_orders import find_corner_orders, find_listing
from calib.discovery.log_consistency.frame_steps import find_frame_step
from calib.discovery.log_consistency.frozen import find_frozen_poses
from calib.discovery.log_consistency.joint_readings import find_degrees, find_joint_signs
from calib.discovery.log_consistency.mirror import find_mirror
from calib.discovery.log_consistency.mixup import ROBOT_COLUMNS, Mixup
from calib.discovery.log_consistency.odd_frames import find_odd_frames
from calib.discovery.log_consistency.pairing import find_pairing
from calib.discovery.log_consistency.picture_step import as_before, find_picture_step
from calib.discovery.log_consistency.recover import recover_joints, recover_poses
from calib.discovery.log_consistency.robot_model import find_robot_model
from calib.discovery.log_consistency.single_units import find_single_units
from calib.discovery.log_consistency.steps_by_joints import find_step_by_joints
from calib.discovery.log_consistency.which_arm import recognise_arm
from calib.discovery.start import FreeViews, free_views
from calib.errors import CalibrationError
from calib.views import BoolArray, FloatArray, Views

FEWEST_FRAMES = 6


@dataclass(frozen=True)
class LogRepair:
    """A log put right.

    Attributes
    ----------
    views:
        The frames that can be used, mixups mended, missing columns filled in.
    log:
        Every known row of the log, mended alike.
    free:
        What the pictures of `views` say without the robot.
    mixups:
        What was mended, in order.
    rejected:
        Frames left out, with reasons.
    notes:
        What was worked out rather than logged, and what could not be.
    has_robot:
        False where there are no poses to hold the pictures against.
    joints_logged:
        False where the joints were worked out from the poses, by a first choice of branches.
    known:
        Effects that the pictures alone have shown: a change of their scale or region midway.
    """

    views: Views
    log: Views
    free: FreeViews
    mixups: tuple[Mixup, ...]
    rejected: tuple[Rejection, ...]
    notes: tuple[str, ...]
    has_robot: bool
    joints_logged: bool
    known: tuple[Present, ...]


def repair_log(views: Views, log: Views) -> LogRepair:
    """Mend the log.

    Parameters
    ----------
    views:
        The recording's frames.
    log:
        Every known row of the log: the recording's and, where given, those to predict.

    Raises
    ------
    CalibrationError
        When the pictures themselves cannot be calibrated.
    """
    return _repaired(_Log(views, log), renumbered=False)


class _Log:
    """The frames and every row of the log as they are mended, and what was."""

    def __init__(self, views: Views, log: Views) -> None:
        self.views, self.log = views, log
        self.mixups: list[Mixup] = []
        self.notes: list[str] = []
        self.known: tuple[Present, ...] = ()

    def mend(self, mixup: Mixup | None) -> bool:
        """Mend what was found; False where nothing was."""
        if mixup is None:
            return False
        self.mixups.append(mixup)
        self.views, self.log = mixup.mend(self.views, self.log), mixup.mend(self.log, self.log)
        return True

    def fill_in(self) -> None:
        """Name the arm and work out poses that were not logged."""
        self.mend(find_degrees(self.views))
        self.views, arm_note = recognise_arm(self.views)
        self.log = replace(self.log, robot_model=self.views.robot_model)
        recovered = recover_poses(self.views)
        self.views, self.log = recovered.views, recover_poses(self.log).views
        self.notes += [*recovered.notes, *([] if arm_note is None else [arm_note])]

    def fill_in_joints(self) -> bool:
        """Work out joints that were not logged; False where there were none."""
        logged = bool(np.isfinite(self.log.joints_rad).any())
        worked_out = recover_joints(self.log)
        self.log = worked_out.views
        self.notes += worked_out.notes
        self.views = _rows_of(self.views, self.log)
        return logged


def _repaired(repair: _Log, *, renumbered: bool) -> LogRepair:
    """Mend the log; once more from the pictures on where their corners were renumbered."""
    repair.mend(find_listing(repair.views))
    baseline = _calibrated(repair)
    free = free_views(baseline, repair.views.height_px)
    loop = mounted_from_fixed(free.camera_from_board, repair.views.mount)
    good = np.asarray(np.isfinite(free.camera_from_board).all(axis=(1, 2)))
    if not renumbered:
        repair.fill_in()
    if int((repair.views.has_pose & good).sum()) < FEWEST_FRAMES:
        repair.notes.append("no robot poses: what a free camera pose can absorb cannot be seen")
        repair.views = _without_robot(repair.views, free)
        return _log_repair(repair, free, list(baseline.rejected), False, good, True)
    frozen = find_frozen_poses(repair.views, loop)
    repair.mend(frozen)
    mirrored = not renumbered and not _mend_conventions(repair, loop)
    if mirrored and repair.mend(find_mirror(repair.views, loop)):
        return _repaired(repair, renumbered=True)
    joints_logged = repair.fill_in_joints()
    repair.mend(find_joint_signs(repair.views))
    stepped = joints_logged and repair.mend(find_step_by_joints(repair.views))
    if not stepped and not repair.mend(find_frame_step(repair.views, loop)):
        repair.mend(find_robot_model(repair.views, loop))
    odd = find_odd_frames(repair.views, repair.log, loop)
    if odd is not None and not renumbered:
        if repair.mend(find_corner_orders(repair.views, odd, free.camera_from_board)):
            return _repaired(repair, renumbered=True)
        repair.mend(find_single_units(repair.views, odd, loop))
        odd = find_odd_frames(repair.views, repair.log, loop)
    pairing = find_pairing(repair.views, repair.log, loop, odd)
    for mixup in pairing.mixups:
        repair.mend(mixup)
    rejected = [*baseline.rejected, *_without_pose(repair.views, pairing.dropped)]
    kept = good & repair.views.has_pose & ~np.isin(repair.views.frame, pairing.dropped)
    if kept.sum() < FEWEST_FRAMES:
        raise CalibrationError(
            f"only {int(kept.sum())} frames have a board and a flange pose that belong together;"
            f" a diagnosis needs {FEWEST_FRAMES}"
        )
    return _log_repair(repair, free, rejected, True, kept, joints_logged)


def _calibrated(repair: _Log) -> Baseline:
    """The pictures' calibration, as if a change of the camera midway had not been."""
    baseline: Baseline | CalibrationError
    try:
        baseline = chosen_baseline(repair.views)
    except CalibrationError as error:
        baseline = error
    found = baseline if isinstance(baseline, Baseline) else None
    changed = find_picture_step(repair.views, found)
    if changed is None:
        if isinstance(baseline, CalibrationError):
            raise baseline
        return baseline
    repair.known = (changed.step,)
    alike = as_before(repair.views, changed)
    return chosen_baseline(alike)


def _without_pose(views: Views, dropped: Sequence[int]) -> list[Rejection]:
    return [
        *(Rejection(frame, "its pose belongs to no picture") for frame in dropped),
        *(
            Rejection(int(frame), "no flange pose of its own")
            for frame, has in zip(views.frame, views.has_pose, strict=True)
            if not has
        ),
    ]


def _rows_of(views: Views, log: Views) -> Views:
    """The views with the robot's columns of their own rows of the log."""
    where = {int(frame): k for k, frame in enumerate(log.frame)}
    row = np.array([where[int(frame)] for frame in views.frame])
    return replace(views, **{name: getattr(log, name)[row] for name in ROBOT_COLUMNS})


def _mend_conventions(repair: _Log, loop: FloatArray) -> bool:
    """Read rotations and lengths as they were written; False where nothing was mended."""
    found = find_conventions(repair.views, loop)
    for mixup in found.mixups:
        repair.mend(mixup)
    return bool(found.mixups)


def _without_robot(views: Views, free: FreeViews) -> Views:
    """Poses that the pictures themselves give, so that the robot's noise absorbs every pose."""
    pose = free.camera_from_board
    flange = rigid.inverse(pose) if views.mount == "eye_in_hand" else pose
    return replace(views, base_from_flange=flange, robot_model=None)


def _log_repair(
    repair: _Log,
    free: FreeViews,
    rejected: list[Rejection],
    has_robot: bool,
    kept: BoolArray,
    joints_logged: bool,
) -> LogRepair:
    kept_free = replace(free, camera_from_board=free.camera_from_board[kept])
    return LogRepair(
        repair.views.take(np.flatnonzero(kept)),
        repair.log,
        kept_free,
        tuple(repair.mixups),
        tuple(rejected),
        tuple(repair.notes),
        has_robot,
        joints_logged,
        repair.known,
    )
