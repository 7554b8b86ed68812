"""What a calibration knows to be wrong or undetermined, with the way to mend it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from calib.calibration.caution import Caution
from calib.calibration.cross_validation import CrossValidation
from calib.calibration.frames import COPY
from calib.calibration.result import Rejection, RobotReference, Solution
from calib.calibration.unseen_edge import unseen_edge
from calib.calibration.verdict_messages import why
from calib.errors import CalibrationError
from calib.views import FloatArray, Views

_ALPHA_SHARE = 0.01
"""Views that fix a focal length fix it ten times better than this share; views of one tilt, or of
none, ten times worse."""

_TURN_RAD, _WAY_SHARE = 0.06, 0.2
"""Robot and pictures that belong together agree ten times better, with a poor arm, too."""


def cautions(
    views: Views,
    solutions: Mapping[str, Solution],
    robot: RobotReference | None,
    fault: CalibrationError | None,
    rejected: tuple[Rejection, ...],
    validation: CrossValidation | None,
) -> tuple[Caution, ...]:
    """Everything that is known to be wrong, what is undetermined first.

    Parameters
    ----------
    robot, fault:
        The robot's side, or why there is none.
    rejected:
        Frames that were left out.
    """
    found = [
        *_camera(views, solutions),
        *_without_robot(views, fault),
        *([] if robot is None else _doubtful(views, solutions, robot)),
        *([] if robot is None else _outliers(robot)),
        *unseen_edge(views),
        *_rejected(rejected),
        *_validation(validation),
    ]
    return tuple(sorted(found, key=lambda caution: not caution.undetermined))


def _camera(views: Views, solutions: Mapping[str, Solution]) -> Iterator[Caution]:
    name = "joint_ml" if "joint_ml" in solutions else "zhang_mle_no_skew"
    best = solutions.get(name)
    if best is None:
        return
    alpha, sigma = best.values["alpha_px"], best.sigma.get("alpha_px", 0.0)
    if sigma < _ALPHA_SHARE * alpha:
        return
    yield Caution(
        f"the focal length is not determined ({alpha:.0f} px, one sigma {sigma:.0f} px): the board"
        " is seen at too few different tilts, and focal length and distance cannot be separated",
        f"all {int(np.isfinite(best.residual_px).any(axis=(1, 2)).sum())} frames used",
        "add views with the board tilted by 20 to 45 degrees about both of its axes, nearer and"
        " farther; `cell plan` chooses them",
        ("camera",),
    )


def _without_robot(views: Views, fault: CalibrationError | None) -> Iterator[Caution]:
    if fault is None:
        return
    if not views.has_pose.any():
        yield Caution(
            "no flange pose was logged: the camera alone is calibrated, and its place on the robot"
            " and its error in millimetres are not known",
            "base_from_flange in frames.jsonl",
            "log the flange's pose with every picture",
        )
        return
    yield Caution(
        f"the camera's place on the robot is not determined: {fault.what}",
        f"{int(views.has_pose.sum())} logged poses",
        fault.remedy or "record more views, with the wrist turned about two axes",
        ("hand_eye",),
    )


def _doubtful(
    views: Views, solutions: Mapping[str, Solution], robot: RobotReference
) -> Iterator[Caution]:
    """Transforms from poses that do not go with the pictures."""
    pictured = solutions["zhang_mle"].camera_from_board
    by_robot = robot.camera_from_board(views.base_from_flange)
    known = np.isfinite(pictured).all(axis=(1, 2)) & np.isfinite(by_robot).all(axis=(1, 2))
    if not known.any():
        return
    turn = _angles(pictured[known], by_robot[known])
    centre = np.append(views.board.corners_m.mean(axis=0), 1.0)
    off = np.linalg.norm(((pictured - by_robot)[known] @ centre)[:, :3], axis=1)
    places = views.base_from_flange[known, :3, 3]
    way = float(np.linalg.norm(places - places.mean(axis=0), axis=1).mean())
    if np.median(turn) < _TURN_RAD and np.median(off) < _WAY_SHARE * way:
        return
    yield Caution(
        "the camera's place on the robot is not determined: the logged poses do not go with the"
        f" pictures (they disagree by {np.degrees(np.median(turn)):.1f} degrees and"
        f" {1e3 * np.median(off):.0f} mm in the median)",
        f"{int(known.sum())} frames",
        "check mount and direction of the poses (base_from_flange), their rotations, and which"
        " picture each is of; `cell diagnose` names mix-ups of the log",
        ("hand_eye",),
    )


def _angles(first: FloatArray, second: FloatArray) -> FloatArray:
    """(N,) radians between rotations."""
    trace = np.einsum("nij,nij->n", first[:, :3, :3], second[:, :3, :3])
    return np.asarray(np.arccos(np.clip((trace - 1) / 2, -1, 1)))


def _outliers(robot: RobotReference) -> Iterator[Caution]:
    if robot.outliers:
        yield Caution(
            "logged poses disagree with their pictures and were left out of the hand-eye",
            frames_text(robot.outliers),
            "look at these frames: a pose of another picture, or an arm or board that was moved",
        )


def _rejected(rejected: tuple[Rejection, ...]) -> Iterator[Caution]:
    copies = [r.frame for r in rejected if r.reason.startswith(COPY)]
    if copies:
        yield Caution(
            "frames are bit for bit the same as others, and each counts once",
            frames_text(copies),
            "record every view anew: a copied frame adds no measurement",
        )


def _validation(found: CrossValidation | None) -> Iterator[Caution]:
    if found is not None and found.verdict != "agree":
        yield Caution(
            why(found),
            "cross-validation",
            "record more views; `cell diagnose` says what the plain model leaves out",
        )


def frames_text(frames: tuple[int, ...] | list[int]) -> str:
    """Frame numbers, runs of them as ranges."""
    runs: list[list[int]] = []
    for frame in sorted(frames):
        if runs and frame == runs[-1][-1] + 1:
            runs[-1].append(frame)
        else:
            runs.append([frame])
    reported = [str(run[0]) if len(run) == 1 else f"{run[0]}-{run[-1]}" for run in runs]
    return f"frame {reported[0]}" if len(frames) == 1 else f"frames {', '.join(reported)}"
