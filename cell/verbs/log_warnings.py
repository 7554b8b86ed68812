"""Mix-ups of the log that make a calibration with the robot wrong, as warnings."""

from __future__ import annotations

import numpy as np

from calib.calibration import Calibration
from calib.discovery.log_consistency.mixup import Mixup
from calib.discovery.log_repair import repair_log
from calib.errors import CalibrationError
from calib.views import Views


def log_mixups(views: Views, result: Calibration) -> tuple[Mixup, ...]:
    """What is mixed up in the log, looked for only where log and pictures disagree.

    Parameters
    ----------
    views, result:
        The frames, and their calibration with the log as it is.
    """
    if not views.has_pose.any() or not (_disagree(result) or _repeats(views)):
        return ()
    try:
        return repair_log(views, views).mixups
    except CalibrationError:
        return ()


def _disagree(result: Calibration) -> bool:
    return any("hand_eye" in caution.undetermined for caution in result.cautions)


def _repeats(views: Views) -> bool:
    """Whether the log holds the very same pose for frame after frame."""
    poses = views.base_from_flange[views.has_pose]
    return bool((np.abs(np.diff(poses, axis=0)).max(axis=(1, 2)) == 0).any())


def mixup_warnings(mixups: tuple[Mixup, ...]) -> list[dict[str, str]]:
    """The mix-ups in the words of `warnings`."""
    return [
        {
            "what": mixup.physics.removesuffix("."),
            "where": f"the log ({mixup.name})",
            "remedy": " ".join(part for part in (mixup.remedy, mixup.apart) if part),
        }
        for mixup in mixups
    ]
