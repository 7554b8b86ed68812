"""The projection against OpenCV's, and its derivatives against automatic differentiation."""

from collections.abc import Callable

import autograd
import autograd.numpy as anp
import cv2
import numpy as np
import pytest

from calib.chain.optics import COLUMN, NEVER_FREE, OPTICS, optics_row
from calib.chain.projection import project, project_with_jacobians
from calib.chain.rigid import compose, from_vector
from calib.views import FloatArray
from tests.chain.oracle import formulas

OPENCV = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4")
RNG = np.random.default_rng(4)
POINTS = np.column_stack([RNG.uniform(-0.15, 0.15, (12, 2)), RNG.uniform(-0.02, 0.02, 12)])
POSES = compose(RNG.normal(0, 0.4, (3, 3)), np.array([[0, 0, 0.5], [0.05, 0, 0.4], [0, 0.1, 0.9]]))
SWEEP = [name for name in OPTICS if name.startswith("sweep")]
DIFFERENTIABLE = [n for n in OPTICS if n not in NEVER_FREE]


def _lens(**more: float) -> FloatArray:
    brown = {
        name: float(value) for name, value in zip(OPENCV, RNG.normal(0, 0.02, 12), strict=True)
    }
    ideal = {"alpha_px": 2400.0, "beta_px": 2380.0, "u0_px": 1010.0, "v0_px": 770.0}
    return optics_row(**ideal, **brown, height_px=1500.0, **more)


WIDE = {"alpha_px": 400.0, "beta_px": 410.0, "u0_px": 640.0, "v0_px": 480.0, "height_px": 960.0}
KANNALA_BRANDT = {"k1": 0.02, "k2": -0.004, "k3": 0.001, "k4": -0.0002}


def _repeated(row: FloatArray) -> FloatArray:
    return np.repeat(row[None], len(POSES), axis=0)


@pytest.mark.parametrize("tilt", [(0.0, 0.0), (0.03, -0.02), (-0.2, 0.15)])
def test_all_fourteen_coefficients_do_what_opencv_s_do(tilt: tuple[float, float]) -> None:
    row = _lens(tilt_x_rad=tilt[0], tilt_y_rad=tilt[1])
    A = np.array([[row[0], 0, row[3]], [0, row[1], row[4]], [0, 0, 1]])
    coefficients = np.array([*(row[COLUMN[name]] for name in OPENCV), *tilt])
    found = project(_repeated(row), POSES, POINTS)
    for pose, seen in zip(POSES, found, strict=True):
        rotation = cv2.Rodrigues(pose[:3, :3])[0]
        expected, _ = cv2.projectPoints(POINTS, rotation, pose[:3, 3], A, coefficients)
        assert np.abs(seen - expected[:, 0]).max() < 1e-9


def test_a_wide_lens_does_what_opencv_s_fisheye_does_in_front_of_it() -> None:
    row = optics_row(**WIDE, **KANNALA_BRANDT, equidistant=1.0)
    A = np.array([[row[0], 0, row[3]], [0, row[1], row[4]], [0, 0, 1]])
    angle, around = np.radians([0.0, 1e-4, 1.7, 1.9, 40, 89]), np.arange(6.0)
    aside = np.sin(angle)[:, None] * np.stack([np.cos(around), np.sin(around)], axis=1)
    points = np.column_stack([aside, np.cos(angle)])
    expected, _ = cv2.fisheye.projectPoints(
        points[:, None], np.zeros(3), np.zeros(3), A, np.array([*KANNALA_BRANDT.values()])
    )
    assert np.abs(project(row[None], np.eye(4)[None], points)[0] - expected[:, 0]).max() < 1e-9


def test_beyond_ninety_degrees_a_wide_lens_goes_on_to_the_same_side() -> None:
    """OpenCV 4.14's `fisheye` shows what lies there on the opposite side."""
    row = optics_row(**WIDE, equidistant=1.0)
    angle = np.radians([80.0, 90.0, 100.0, 120.0])
    points = np.column_stack([np.sin(angle), np.zeros(4), np.cos(angle)])
    seen, j_pose, _ = project_with_jacobians(row[None], np.eye(4)[None], points)
    assert np.allclose(seen[0, :, 0], 640.0 + 400.0 * angle, atol=1e-9)
    step = 1e-6  # up and down the axis
    moved = (project(row[None], np.eye(4)[None], points + np.array([0, 0, step])) - seen) / step
    assert np.allclose(j_pose[0, :, :, 2], moved[0], rtol=1e-5, atol=1e-3)
    A = np.array([[400.0, 0, 640.0], [0, 410.0, 480.0], [0, 0, 1]])
    theirs, _ = cv2.fisheye.projectPoints(points[:, None], np.zeros(3), np.zeros(3), A, np.zeros(4))
    assert theirs[2, 0, 0] < 640.0 < seen[0, 2, 0], "OpenCV has mended it: say so in the docs"


def test_skew_leans_the_rows() -> None:
    plain, skewed = _lens(), _lens(skew_px=0.0)
    skewed[COLUMN["skew_px"]] = 3.0
    skewed[5:21], plain[5:21] = 0.0, 0.0
    before = project(_repeated(plain), POSES, POINTS)
    after = project(_repeated(skewed), POSES, POINTS)
    y = (before[..., 1] - plain[COLUMN["v0_px"]]) / plain[COLUMN["beta_px"]]
    assert np.allclose(after[..., 0] - before[..., 0], 3.0 * y, atol=1e-9)


def _independent(row: FloatArray, pose: FloatArray, point: FloatArray) -> Callable[..., object]:
    """Pixel as a function of (27,) optics and a (6,) increment on the camera's side."""

    def function(values: object, increment: object) -> object:
        o = dict(zip(DIFFERENTIABLE, values, strict=True))  # type: ignore[call-overload]
        for fixed in NEVER_FREE:
            o[fixed] = row[COLUMN[fixed]]
        before = anp.array(pose[:3, :3] @ point + pose[:3, 3])
        moved = formulas.camera_coordinates(formulas.rigid(increment), before)
        return formulas.swept_pixel(o, moved)

    return function


MOTION = dict(zip(SWEEP, (0.01, -0.005, 0.015, 0.02, 0.005, -0.01), strict=True))
LENSES = {
    "all zero": optics_row(alpha_px=900.0, beta_px=910.0, height_px=700.0),
    "opencv": _lens(skew_px=2.0),
    "tilted": _lens(tilt_x_rad=0.05, tilt_y_rad=-0.08),
    "everything": _lens(
        skew_px=1.0, tilt_x_rad=0.02, tilt_y_rad=0.03, pupil_m_rad2=0.01, window_m=0.004
    ),
    "swept": _lens(tilt_x_rad=0.02, window_m=0.004, pose_row=-0.3, **MOTION),
    "wide": _lens(equidistant=1.0),
    "wide everything": _lens(equidistant=1.0, tilt_x_rad=0.02, pupil_m_rad2=0.01, window_m=0.004),
}


@pytest.mark.parametrize("lens", LENSES)
def test_every_derivative_is_that_of_automatic_differentiation(lens: str) -> None:
    row = LENSES[lens]
    values = np.array([row[COLUMN[name]] for name in DIFFERENTIABLE])
    columns = [COLUMN[name] for name in DIFFERENTIABLE]
    uv, j_pose, j_optics = project_with_jacobians(_repeated(row), POSES, POINTS)
    # the same to rounding: products are fused with sums differently where nothing is differentiated
    assert np.abs(uv - project(_repeated(row), POSES, POINTS)).max() < 1e-9
    for i, pose in enumerate(POSES):
        for j, point in enumerate(POINTS):
            function = _independent(row, pose, point)
            assert np.allclose(function(values, np.zeros(6)), uv[i, j], rtol=0, atol=1e-9)
            by_optics = autograd.jacobian(function, 0)(values, np.zeros(6))
            by_pose = autograd.jacobian(function, 1)(values, np.zeros(6))
            assert np.allclose(j_optics[i, j][:, columns], by_optics, rtol=1e-7, atol=1e-5)
            assert np.allclose(j_pose[i, j], by_pose, rtol=1e-9, atol=1e-7)
    assert np.all(j_optics[..., [COLUMN[name] for name in NEVER_FREE]] == 0.0)


@pytest.mark.parametrize("pose_row", [0.0, -0.5])
def test_a_rolling_shutter_shows_a_corner_where_it_is_when_its_row_is_read(
    pose_row: float,
) -> None:
    row = _lens(pose_row=pose_row)
    still = project(_repeated(row), POSES, POINTS)
    sweep = np.array([0.002, -0.001, 0.003, 0.004, 0.001, -0.002])
    row[[COLUMN[name] for name in SWEEP]] = sweep
    swept = project(_repeated(row), POSES, POINTS)
    row[[COLUMN[name] for name in SWEEP]] = 0.0
    for i, pose in enumerate(POSES):
        for j, point in enumerate(POINTS):
            late = swept[i, j, 1] / 1500.0 - 0.5 - pose_row
            there = from_vector(sweep * late) @ pose
            true = project(row[None], there[None], point[None])[0, 0]
            # straight on instead of around: second order of an angle of a milliradian or two
            assert np.abs(swept[i, j] - true).max() < 1e-3 * np.abs(true - still[i, j]).max() + 1e-9
