"""The uncertainty reported in pixels and at the work piece is the one that is there."""

from functools import cache

import cv2
import numpy as np
import pytest

from calib.calibration import calibrate
from calib.calibration.mapping import as_mapping
from calib.calibration.uncertainty import (
    projection_sigma_px,
    uncertainty_map,
    workpiece_sigma_m,
)
from calib.chain import rigid
from calib.chain.optics import COLUMN, optics_row
from calib.chain.projection import project
from calib.solver.joint import JointFit
from calib.views import FloatArray, Mount, Views
from cell.storage.files.calibration_file import CalibrationFile
from tests.calibration.fitted import K1, THIN_F_M, fit
from tests.paper.scene import (
    ALPHA0,
    BASE_FROM_FIXED,
    BETA0,
    BOARD,
    FLANGE_FROM_MOUNTED,
    HEIGHT,
    U0,
    V0,
    WIDTH,
    mixed_scene,
)

RUNS = 16
PIXELS = np.array([[0.5, 0.5], [0.15, 0.2], [0.9, 0.75]]) * [WIDTH, HEIGHT]
DISTANCES = np.array([0.35, 0.9])


@cache
def _fitted(seed: int, mount: Mount) -> tuple[JointFit, Views]:
    """A small run of the cell, fitted from the truth on."""
    views = mixed_scene(
        8, 12, noise_px=0.1, thin_f_m=THIN_F_M, k1=K1, robot_mm=0.05, robot_deg=0.005,
        mount=mount, seed=seed,
    ).views  # fmt: skip
    return fit(views), views


def _lens(optics: FloatArray, f_m: float, distance_m: float) -> FloatArray:
    """(K,) focused at a distance."""
    out = optics.copy()
    out[[COLUMN["alpha_px"], COLUMN["beta_px"]]] *= distance_m / (distance_m - f_m)
    return out


def _matrix(optics: FloatArray) -> tuple[FloatArray, FloatArray]:
    alpha, beta, u0, v0, *k = (
        optics[COLUMN[n]] for n in ("alpha_px", "beta_px", "u0_px", "v0_px", "k1", "k2")
    )
    return np.array([[alpha, 0, u0], [0, beta, v0], [0, 0, 1.0]]), np.array([*k, 0, 0])


def _part_m(alpha_px: float, distance_m: float) -> FloatArray:
    """(9, 3) points on a part of the board's size, or of a fifth of the image."""
    extent = float(np.ptp(BOARD.corners_m[:, :2], axis=0).mean())
    half = 0.5 * min(extent, 0.2 * HEIGHT * distance_m / alpha_px)
    return np.array([[x, y, 0.0] for y in (-1, 0, 1) for x in (-1, 0, 1)]) * half


def _located(true: FloatArray, found: FloatArray, centre_m: FloatArray) -> FloatArray:
    """(3,) where OpenCV finds, with one camera, a part that another one saw at `centre_m`."""
    part = _part_m(float(true[0]), float(centre_m[2]))
    seen, _ = cv2.projectPoints(part, np.zeros(3), centre_m, *_matrix(true))
    _, turn, at = cv2.solvePnP(
        part, seen, *_matrix(found), np.zeros((3, 1)), centre_m[:, None].copy(), True
    )
    turn, at = cv2.solvePnPRefineLM(part, seen, *_matrix(found), turn, at)
    return np.asarray(at[:, 0])


def _errors(seed: int, mount: Mount) -> tuple[FloatArray, FloatArray]:
    """(D, G, 2) pixels and (D, G, 3) metres by which one run's camera is wrong."""
    fit, _ = _fitted(seed, mount)
    place = fit.model.flange_from_mounted, FLANGE_FROM_MOUNTED
    if mount == "eye_to_hand":
        place = fit.model.base_from_fixed, BASE_FROM_FIXED
    found_from_true = rigid.inverse(place[0]) @ place[1]
    true_from_found = rigid.inverse(found_from_true)
    plain = optics_row(alpha_px=ALPHA0, beta_px=BETA0, u0_px=U0, v0_px=V0, k1=K1, height_px=HEIGHT)
    pixels, metres = [], []
    for d in DISTANCES:
        true = _lens(plain, THIN_F_M, d)
        found = _lens(fit.model.optics, float(fit.model.effects[0].values[0]), d)
        rays = cv2.undistortPointsIter(
            PIXELS[:, None], *_matrix(true), np.eye(3), np.eye(3), (3, 100, 1e-14)
        )[:, 0]
        at = np.column_stack([rays, np.ones(len(rays))]) * d
        pixels.append(project(found[None], found_from_true[None], at)[0] - PIXELS)
        located = np.array([_located(true, found, p) for p in at])
        metres.append(located @ true_from_found[:3, :3].T + true_from_found[:3, 3] - at)
    return np.array(pixels), np.array(metres)


@pytest.mark.parametrize("mount", ["eye_in_hand", "eye_to_hand"])
def test_the_errors_of_many_runs_are_as_large_as_stated(mount: Mount) -> None:
    found = []
    for seed in range(RUNS):
        fit, views = _fitted(seed, mount)
        pixels, metres = _errors(seed, mount)
        sigma_px = projection_sigma_px(fit, views, PIXELS, DISTANCES)
        sigma_m = workpiece_sigma_m(fit, views, PIXELS, DISTANCES)
        found.append(((pixels / sigma_px).ravel(), (metres / sigma_m).ravel()))
    for z in (np.array(column) for column in zip(*found, strict=True)):
        # one run's errors go together: a few independent numbers in each of sixteen
        assert 0.78 < np.sqrt((z**2).mean()) < 1.25
        assert np.sqrt((z**2).mean(axis=0)).max() < 2.0


def test_the_map_is_in_the_file_and_holds_what_the_functions_give() -> None:
    true = mixed_scene(noise_px=0.1, thin_f_m=THIN_F_M, k1=K1, robot_mm=0.05, robot_deg=0.005)
    written = CalibrationFile.model_validate(as_mapping(calibrate(true.views), "a run"))
    assert written.uncertainty is not None
    assert written.distance_range_m is not None
    reported = written.uncertainty
    assert (reported.distance_m[0], reported.distance_m[-1]) == pytest.approx(
        written.distance_range_m
    )
    assert np.shape(reported.projection_sigma_px) == (4, 15, 2)
    assert np.shape(reported.workpiece_sigma_m) == (4, 15, 3)
    # along the axis the focal length alone makes an error of its own share of the distance
    sigma = written.solutions["joint_ml"].sigma["alpha_px"]
    along_m = np.array(reported.workpiece_sigma_m)[:, :, 2].min(axis=1)
    assert (along_m < 50 * sigma / ALPHA0 * np.array(reported.distance_m)).all()
    assert (along_m > 0).all()


def test_more_views_make_it_smaller_and_the_corners_are_worse_than_the_middle() -> None:
    few, many = (
        mixed_scene(8, n, noise_px=0.1, thin_f_m=THIN_F_M, k1=K1, robot_mm=0.05, robot_deg=0.005)
        for n in (12, 48)
    )
    maps = [uncertainty_map(fit(v), v, (0.35, 0.9)) for v in (few.views, many.views)]
    less, more = (m.workpiece_sigma_m for m in maps)
    assert 0.3 < np.median(more / less) < 0.85
    pixels = maps[0].projection_sigma_px
    assert (pixels[:, 0] > pixels[:, 7]).all()
