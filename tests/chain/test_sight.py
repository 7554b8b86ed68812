"""Lines of sight: there and back, and no number where there is none."""

import cv2
import numpy as np
import pytest

from calib.chain.domain import invertible_rad, off_axis_rad
from calib.chain.optics import optics_row
from calib.chain.sight import project, unproject

IDEAL = {"alpha_px": 400.0, "beta_px": 410.0, "u0_px": 640.0, "v0_px": 480.0, "height_px": 960.0}
LENSES = {
    "pinhole": optics_row(**IDEAL),
    "barrel": optics_row(**IDEAL, k1=-0.2, k2=0.02, p1=1e-3, p2=-2e-3, s1=1e-3),
    "rational": optics_row(**IDEAL, k1=0.6, k2=0.05, k3=0.001, k4=0.9, k5=0.2, k6=0.01),
    "tilted": optics_row(**IDEAL, skew_px=2.0, k1=-0.1, tilt_x_rad=0.05, tilt_y_rad=-0.04),
    "wide": optics_row(**IDEAL, equidistant=1.0, k1=0.02, k2=-0.004, k3=1e-3, k4=-2e-4, p1=1e-3),
}


def _fan(widest_rad):
    angle, around = np.meshgrid(np.linspace(0.0, 0.95 * widest_rad, 12), np.arange(0.1, 6.3, 0.9))
    angle, around = angle.ravel(), around.ravel()
    aside = np.sin(angle)[:, None] * np.stack([np.cos(around), np.sin(around)], axis=1)
    return np.column_stack([aside, np.cos(angle)])


@pytest.mark.parametrize("lens", LENSES)
def test_every_direction_of_the_domain_comes_back(lens):
    row = LENSES[lens]
    rays = _fan(min(invertible_rad(row), np.radians(88 if lens != "wide" else 175)))
    seen = project(row[None], np.eye(4)[None], rays)[0]
    assert np.isfinite(seen).all()
    assert np.abs(unproject(row, seen) - rays).max() < 1e-9


def test_beyond_the_fold_there_is_no_number():
    """`cv2.undistortPoints` returns a point there, without a word."""
    row = LENSES["barrel"][:].copy()
    row[5:] = 0.0
    row[5], row[-3] = -0.2, 960.0
    fold = np.arctan(1 / np.sqrt(0.6))  # of r (1 - 0.2 r²)
    assert invertible_rad(row) == pytest.approx(fold, abs=1e-5)
    inside, beyond = (_fan(a)[[11]] for a in (fold / 0.951, (fold + 0.1) / 0.95))
    assert np.isfinite(project(row[None], np.eye(4)[None], inside)).all()
    assert np.isnan(project(row[None], np.eye(4)[None], beyond)).all()
    farthest = 400.0 * (2 / 3) / np.sqrt(0.6)
    pixels = np.array([[640.0 + 0.99 * farthest, 480.0], [640.0 + 1.05 * farthest, 480.0]])
    found = unproject(row, pixels)
    assert np.isfinite(found[0]).all()
    assert np.isnan(found[1]).all()
    A = np.array([[400.0, 0, 640], [0, 410, 480], [0, 0, 1]])
    theirs = cv2.undistortPoints(pixels[:, None], A, np.array([-0.2, 0, 0, 0]))
    assert np.isfinite(theirs[1]).all(), "OpenCV has mended it: say so in the docs"


def test_what_stands_behind_a_perspective_camera_has_no_pixel():
    points = np.array([[0.1, 0.0, 1.0], [0.1, 0.0, -1.0], [1.0, 0.0, 0.0]])
    seen = project(LENSES["pinhole"][None], np.eye(4)[None], points)[0]
    assert np.isfinite(seen).all(axis=1).tolist() == [True, False, False]
    wide = project(LENSES["wide"][None], np.eye(4)[None], points)[0]
    assert np.isfinite(wide[[0, 2]]).all()
    assert wide[2, 0] > wide[0, 0]


def test_lines_of_sight_have_unit_length():
    found = unproject(LENSES["wide"], np.array([[640.0, 480.0], [100.0, 900.0], [1.2e4, 0.0]]))
    assert np.allclose(np.linalg.norm(found[:2], axis=1), 1.0)
    assert off_axis_rad(found[:1])[0] < 1e-12
    assert np.isnan(found[2]).all()
