"""What a plan promises before it is run: how certain, how long."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from calib.calibration.uncertainty import (
    focal_length_sigma_px,
    grid_m,
    grid_px,
    projection_sigma_px,
    workpiece_sigma_m,
)
from calib.design.expected import Expected, expect
from calib.views import FloatArray
from cell.sequencer.guard import Guard
from cell.storage.files.plan_file import Plan
from cell.verbs.plan.duration import Duration, duration_of
from cell.verbs.plan.nominal import assume
from cell.verbs.plan.reach import layout_of


@dataclass(frozen=True)
class ExpectedUncertainty:
    """One sigma of everything that is asked for, at D distances, and the run's duration.

    Attributes
    ----------
    distance_m:
        (D,) of the working volume.
    alpha_sigma_px:
        (D,) of the scale factor, focused there.
    projection_sigma_px, workpiece_sigma_m:
        (D,) of a point and of a part in the image, all axes together, root mean square over the
        image; see `calib.calibration.uncertainty`.
    hand_eye_sigma_m, hand_eye_sigma_rad:
        (3,) of the camera's place on the flange (in the base, where it stands still).
    noise_from:
        Where the noise levels are from.
    duration:
        Of the run.
    """

    distance_m: FloatArray
    alpha_sigma_px: FloatArray
    projection_sigma_px: FloatArray
    workpiece_sigma_m: FloatArray
    hand_eye_sigma_m: FloatArray
    hand_eye_sigma_rad: FloatArray
    noise_from: str
    duration: Duration


def expected_from(plan: Plan) -> ExpectedUncertainty:
    """Work out what a plan promises.

    Raises
    ------
    InputError, SafetyError
        The cell does not say enough, or a view cannot be taken.
    """
    layout, guard, given = layout_of(plan.cell), Guard.of(plan), assume(plan.cell)
    home = np.radians(layout.home_deg)
    joints = guard.check_plan(plan, home)
    views = given.views(list(guard.kinematics.forward(np.array(joints))))
    expected = expect(given.model, given.lens, views, given.noise)
    distances, pixels = grid_m(layout.distances_m), grid_px(views, given.model)
    camera = "flange_from_mounted" if views.mount == "eye_in_hand" else "base_from_fixed"
    return ExpectedUncertainty(
        distance_m=distances,
        alpha_sigma_px=focal_length_sigma_px(expected, views, distances),
        projection_sigma_px=_all_axes(projection_sigma_px(expected, views, pixels, distances)),
        workpiece_sigma_m=_all_axes(workpiece_sigma_m(expected, views, pixels, distances)),
        hand_eye_sigma_m=_sigma(expected, camera, ("x", "y", "z")),
        hand_eye_sigma_rad=_sigma(expected, camera, ("rx", "ry", "rz")),
        noise_from=given.noise_from,
        duration=duration_of(plan.file, guard, home, joints),
    )


def _all_axes(sigma: FloatArray) -> FloatArray:
    """(D,) of (D, G, axes)."""
    return np.asarray(np.sqrt((sigma**2).sum(axis=2).mean(axis=1)))


def _sigma(expected: Expected, frame: str, axes: tuple[str, ...]) -> FloatArray:
    names = [u.name for u in expected.unknowns]
    at = [names.index(f"{frame}.{axis}") for axis in axes]
    return np.asarray(np.sqrt(np.diag(expected.covariance)[at]))


def as_mapping(found: ExpectedUncertainty) -> dict[str, Any]:
    """For `--json`."""
    reported = asdict(found)
    reported["duration"]["whole_s"] = found.duration.whole_s
    return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in reported.items()}


def as_lines(found: ExpectedUncertainty) -> list[str]:
    """For people."""
    time = found.duration
    position_mm = 1e3 * np.linalg.norm(found.hand_eye_sigma_m)
    rotation_mrad = 1e3 * np.linalg.norm(found.hand_eye_sigma_rad)
    return [
        f"to be expected, one sigma (noise: {found.noise_from}):",
        _over("distance", "m", found.distance_m, ".2f"),
        _over("scale factor alpha", "px", found.alpha_sigma_px),
        _over("a point the robot knows", "px", found.projection_sigma_px),
        _over("a part at the work piece", "mm", 1e3 * found.workpiece_sigma_m),
        f"  hand-eye {position_mm:.2g} mm, {rotation_mrad:.2g} mrad",
        f"the run takes {_minutes(time.whole_s)} and what the devices need besides: moving"
        f" {time.motion_s:.0f} s, settling {time.settle_s:.0f} s, focusing {time.focus_s:.0f} s,"
        f" exposing {time.exposure_s:.1f} s",
    ]


def _over(title: str, unit: str, values: FloatArray, form: str = ".2g") -> str:
    return f"  {title:26}" + "".join(f"{v:>9{form}}" for v in values) + f"  {unit}"


def _minutes(seconds: float) -> str:
    whole = round(seconds)
    return f"{whole // 60} min {whole % 60:02d} s" if whole >= 60 else f"{whole} s"
