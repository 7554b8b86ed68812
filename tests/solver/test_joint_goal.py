"""What the joint fit is for: a lens that refocuses, and a robot whose distance to it is unknown."""

import numpy as np
import pytest

from calib.calibration import calibrate
from calib.calibration.joint_lens import FURTHER_NAMES
from calib.chain.optics import COLUMN
from calib.chain.projection import project
from calib.views import FloatArray, Mount
from tests.paper.scene import BOARD, Scene, scene

PARALLEL, TILTED = 20, 30


def _unit_focusing(mount: Mount, seed: int) -> Scene:
    """The whole lens moves to focus; nothing is known of where it sits on the robot."""
    rng = np.random.default_rng(seed)
    distance = np.concatenate([np.linspace(0.3, 1.0, PARALLEL), rng.uniform(0.3, 1.0, TILTED)])
    tilt = np.concatenate([rng.uniform(0, 0.5, PARALLEL), rng.uniform(15, 40, TILTED)])
    return scene(
        distance_m=distance,
        tilt_deg=tilt,
        seed=seed,
        noise_px=0.05,
        thin_f_m=0.018,
        k1=-0.05,
        robot_mm=0.05,
        robot_deg=0.005,
        mount=mount,
    )


def _depth_rms_m(true: Scene, camera_from_board: FloatArray) -> float:
    centre = np.append(BOARD.corners_m.mean(axis=0), 1.0)
    return float(np.sqrt(np.mean(((camera_from_board @ centre)[:, 2] - true.depth_m) ** 2)))


@pytest.mark.parametrize(("mount", "seed"), [("eye_in_hand", 1), ("eye_to_hand", 2)])
def test_focal_length_and_depth_come_out_to_a_few_parts_in_a_hundred_thousand(
    mount: Mount, seed: int
) -> None:
    true = _unit_focusing(mount, seed)
    found = calibrate(true.views)
    joint, zhang = found.solutions["joint_ml"], found.solutions["zhang_mle"]
    assert joint.focus is not None
    assert joint.focus.law == "thin_lens"
    off = joint.optics[:, COLUMN["alpha_px"]] - true.optics[:, COLUMN["alpha_px"]]
    assert np.sqrt(np.mean(off**2)) < 0.45
    joint_m, zhang_m = (_depth_rms_m(true, s.camera_from_board) for s in (joint, zhang))
    assert joint_m < 4e-5
    assert zhang_m > 5e-3
    assert set(joint.values) & {"p1", "p2", "k3"} == set()


def test_terms_that_the_lens_has_are_freed_and_no_others() -> None:
    true = _unit_focusing("eye_in_hand", 3)
    optics = true.optics.copy()
    optics[:, COLUMN["p1"]], optics[:, COLUMN["p2"]] = 4e-4, -3e-4
    plain = project(true.optics, true.camera_from_board, BOARD.corners_m)
    bent = project(optics, true.camera_from_board, BOARD.corners_m)
    true.views.corners_px[:] += bent - plain
    joint = calibrate(true.views).solutions["joint_ml"]
    assert "k3" not in joint.values
    for name, value in (("p1", 4e-4), ("p2", -3e-4)):
        assert abs(joint.values[name] - value) < 4 * joint.sigma[name]
        assert joint.sigma[name] < 2e-5


def _bent(terms: dict[str, float]) -> Scene:
    """The unit-focusing cell with more distortion."""
    true = _unit_focusing("eye_in_hand", 3)
    optics = true.optics.copy()
    for name, value in terms.items():
        optics[:, COLUMN[name]] = value
    plain = project(true.optics, true.camera_from_board, BOARD.corners_m)
    true.views.corners_px[:] += project(optics, true.camera_from_board, BOARD.corners_m) - plain
    return true


def test_a_tilted_sensor_is_distinguished_from_decentering() -> None:
    tilt = {"tilt_x_rad": 0.06, "tilt_y_rad": -0.08}
    joint = calibrate(_bent(tilt).views).solutions["joint_ml"]
    assert set(joint.values) & set(FURTHER_NAMES) == set(tilt)
    for name, value in tilt.items():
        assert abs(joint.values[name] - value) < 4 * joint.sigma[name]
        assert joint.sigma[name] < 1e-3


def test_rational_terms_are_freed_where_a_polynomial_does_not_do() -> None:
    rational = {"k1": 8.0, "k2": 2.0, "k4": 8.2, "k5": 4.0}
    joint = calibrate(_bent(rational).views).solutions["joint_ml"]
    assert {"k4", "k5", "k6"} <= set(joint.values)
    assert joint.reprojection_px["rms"] < 0.072
