"""Every mix-up in the log found and mended before physics is asked."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from calib.calibration.baseline import fit_baseline
from calib.calibration.frames import usable_frames
from calib.calibration.result import Rejection
from calib.chain import rigid
from calib.discovery.log_consistency.consistency import mounted_from_fixed
from calib.discovery.log_consistency.conventions import find_conventions
from calib.discovery.log_consistency.mixup import ROBOT_COLUMNS, Mixup
from calib.discovery.log_consistency.pairing import find_pairing
from calib.discovery.log_consistency.recover import recover_joints, recover_poses
from calib.discovery.log_consistency.robot_model import find_robot_model
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
    said:
        What was worked out rather than logged, and what could not be.
    has_robot:
        False where there are no poses to hold the pictures against.
    joints_logged:
        False where the joints were worked out from the poses, by a first choice of branches.
    """

    views: Views
    log: Views
    free: FreeViews
    mixups: tuple[Mixup, ...]
    rejected: tuple[Rejection, ...]
    said: tuple[str, ...]
    has_robot: bool
    joints_logged: bool


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
    baseline = fit_baseline(views, usable_frames(views))
    free = free_views(baseline, views.height_px)
    loop = mounted_from_fixed(free.camera_from_board, views.mount)
    rejected = list(baseline.rejected)
    good = np.asarray(np.isfinite(free.camera_from_board).all(axis=(1, 2)))
    views, arm_said = recognise_arm(views)
    log = replace(log, robot_model=views.robot_model)
    recovered = recover_poses(views)
    views, log, said = recovered.views, recover_poses(log).views, list(recovered.said)
    said += [] if arm_said is None else [arm_said]
    if int((views.has_pose & good).sum()) < FEWEST_FRAMES:
        said.append("no robot poses: what a free camera pose can absorb cannot be seen")
        views = _without_robot(views, free)
        return _log_repair(views, log, free, [], rejected, said, False, good, True)
    mixups: list[Mixup] = []
    views, log, loop_mixups = _mend_conventions(views, log, loop)
    mixups += loop_mixups
    joints_logged = bool(np.isfinite(log.joints_rad).any())
    worked_out = recover_joints(log)
    log, said = worked_out.views, [*said, *worked_out.said]
    views = _rows_of(views, log)
    model = find_robot_model(views, loop)
    if model is not None:
        mixups.append(model)
        views, log = model.mend(views, log), model.mend(log, log)
    pairing = find_pairing(views, log, loop)
    for mixup in pairing.mixups:
        mixups.append(mixup)
        views, log = mixup.mend(views, log), mixup.mend(log, log)
    rejected += [Rejection(f, "its pose belongs to no picture") for f in pairing.dropped]
    rejected += [
        Rejection(int(f), "no flange pose")
        for f, has in zip(views.frame, views.has_pose, strict=True)
        if not has
    ]
    kept = good & views.has_pose & ~np.isin(views.frame, pairing.dropped)
    if kept.sum() < FEWEST_FRAMES:
        raise CalibrationError(
            f"only {int(kept.sum())} frames have a board and a flange pose that belong together;"
            f" a diagnosis needs {FEWEST_FRAMES}"
        )
    return _log_repair(views, log, free, mixups, rejected, said, True, kept, joints_logged)


def _rows_of(views: Views, log: Views) -> Views:
    """The views with the robot's columns of their own rows of the log."""
    where = {int(frame): k for k, frame in enumerate(log.frame)}
    row = np.array([where[int(frame)] for frame in views.frame])
    return replace(views, **{name: getattr(log, name)[row] for name in ROBOT_COLUMNS})


def _mend_conventions(
    views: Views, log: Views, loop: FloatArray
) -> tuple[Views, Views, list[Mixup]]:
    found = find_conventions(views, loop)
    for mixup in found.mixups:
        views, log = mixup.mend(views, log), mixup.mend(log, log)
    return views, log, list(found.mixups)


def _without_robot(views: Views, free: FreeViews) -> Views:
    """Poses that the pictures themselves give, so that the robot's noise absorbs every pose."""
    pose = free.camera_from_board
    flange = rigid.inverse(pose) if views.mount == "eye_in_hand" else pose
    return replace(views, base_from_flange=flange, robot_model=None)


def _log_repair(
    views: Views,
    log: Views,
    free: FreeViews,
    mixups: list[Mixup],
    rejected: list[Rejection],
    said: list[str],
    has_robot: bool,
    kept: BoolArray,
    joints_logged: bool,
) -> LogRepair:
    kept_free = replace(free, camera_from_board=free.camera_from_board[kept])
    return LogRepair(
        views.take(np.flatnonzero(kept)),
        log,
        kept_free,
        tuple(mixups),
        tuple(rejected),
        tuple(said),
        has_robot,
        joints_logged,
    )
