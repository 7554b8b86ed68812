"""A made-up cell for the report: a breathing camera, an arm whose third joint sags a little."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from calib.chain.rigid import inverse
from calib.views import Board, FloatArray, Views
from cell.views.report import Evidence, ReportData, SolutionPoses, Truth
from cell.views.report.geometry import distance_m, position_error_m

WIDTH_PX, HEIGHT_PX = 1279, 724
BOARD = Board("chessboard", 7, 10, 0.025)
RECORDING = {
    "schema": "cell.recording/1",
    "name": "bench-3",
    "robot": {"model": "ur5e"},
    "camera": {"model": "robotiq_wrist", "width": WIDTH_PX, "height": HEIGHT_PX, "focus": "auto"},
    "board": {"type": "chessboard", "rows": 7, "cols": 10, "square_m": 0.025},
    "mount": "eye_in_hand",
    "capture": {"mode": "stop"},
}
ALPHA_PX, K_PX_M2 = 1373.0, 6.0
SOLUTIONS = ("zhang_algebraic", "zhang_mle", "fixed_alpha_algebraic", "fixed_alpha_mle", "joint_ml")
CLOSER_M = {"zhang_algebraic": 0.011, "zhang_mle": 0.034, "fixed_alpha_algebraic": 0.0021}


@dataclass(frozen=True)
class MadeUp:
    """The arrays behind a made-up report."""

    views: Views
    board_from_camera: FloatArray
    rng: np.random.Generator

    @property
    def distance_m(self) -> FloatArray:
        return distance_m(self.board_from_camera, BOARD)


def make(frames: int = 24, seed: int = 7) -> MadeUp:
    rng = np.random.default_rng(seed)
    poses = _poses(frames, rng)
    alpha = ALPHA_PX - K_PX_M2 / distance_m(poses, BOARD) ** 2
    camera_from_board = inverse(poses)
    points = BOARD.corners_m @ camera_from_board[:, :3, :3].swapaxes(1, 2)
    points = points + camera_from_board[:, None, :3, 3]
    corners = points[..., :2] / points[..., 2:] * alpha[:, None, None]
    corners += [WIDTH_PX / 2, HEIGHT_PX / 2]
    inside = ((corners > 0) & (corners < [WIDTH_PX, HEIGHT_PX])).all(axis=2)
    views = Views.blank(BOARD, width_px=WIDTH_PX, height_px=HEIGHT_PX, frames=frames)
    views = replace(
        views,
        corners_px=np.where(inside[..., None], corners, np.nan),
        base_from_flange=poses,
        joints_rad=rng.uniform(-2, 2, (frames, 6)),
        approach_joints_rad=rng.uniform(-2, 2, (frames, 6)),
        joint_velocity_rad_s=np.abs(rng.normal(0, 0.2, (frames, 6))),
        t_s=6.5 * np.arange(frames),
        exposure_s=0.004 + 0.004 * (np.arange(frames) % 4),
        robot_model="ur5e",
    )
    return MadeUp(views, poses, rng)


def _poses(frames: int, rng: np.random.Generator) -> FloatArray:
    poses = np.zeros((frames, 4, 4))
    poses[:, 3, 3] = 1.0
    tilt = np.where(np.arange(frames) % 3 == 0, 0.0, 0.45)
    angles = rng.normal(0, 1, (frames, 3)) * np.stack([tilt, tilt, 0.2 + 0 * tilt], axis=1)
    turn = Rotation.from_euler("xyz", angles)
    poses[:, :3, :3] = turn.as_matrix()
    away = np.linspace(0.25, 1.1, frames)[:, None]
    centre = BOARD.corners_m.mean(axis=0)
    poses[:, :3, 3] = centre + rng.normal(0, 0.03, (frames, 3)) - away * poses[:, :3, 2]
    return poses


def poses_of(made: MadeUp) -> dict[str, SolutionPoses]:
    out = {}
    robot = moved(made.board_from_camera, made.rng.normal(0, 5e-5, (len(made.views), 3)))
    for name in SOLUTIONS:
        shift = made.rng.normal(0, 8e-5, (len(made.views), 3))
        shift[:, 2] += CLOSER_M.get(name, 0.0) * (0.3 + made.distance_m)
        out[name] = SolutionPoses(moved(made.board_from_camera, shift), robot)
    return out


def moved(board_from_camera: FloatArray, shift_m: FloatArray) -> FloatArray:
    """Camera poses shifted by (N, 3) metres in their own axes."""
    out = board_from_camera.copy()
    out[:, :3, 3] += np.einsum("nij,nj->ni", out[:, :3, :3], shift_m)
    return out


def calibration(made: MadeUp, poses: dict[str, SolutionPoses]) -> dict[str, Any]:
    parallel = np.flatnonzero(np.arange(len(made.views)) % 3 == 0)
    distance = made.distance_m[parallel]
    alpha = ALPHA_PX - K_PX_M2 / distance**2 + made.rng.normal(0, 0.8, len(parallel)) * distance
    return {
        "schema": "cell.calibration/1",
        "recording": "bench-3",
        "frames_used": [int(f) for f in made.views.frame[:-2]],
        "frames_rejected": [
            {"frame": int(made.views.frame[-2]), "reason": "board not found"},
            {"frame": int(made.views.frame[-1]), "reason": "blurred: edge blur 3.1 px <limit>"},
        ],
        "scale_factors": [
            {"frame": int(f), "distance_m": float(d), "alpha_px": float(a),
             "alpha_sigma_px": 0.8 * float(d), "beta_px": float(a + 2.9), "beta_sigma_px": 0.9,
             "tilt_rad": 0.002}
            for f, d, a in zip(parallel, distance, alpha, strict=True)
        ],
        "zones": {
            "near_limit_m": 0.42, "near_sigma_m": 0.03, "far_limit_m": 1.0, "near_is_bound": False,
            "far_is_bound": True, "alpha_px": 1370.8, "alpha_sigma_px": 0.4, "beta_px": 1373.8,
            "beta_sigma_px": 0.4, "method": "change_point", "why": "beyond it nothing moves",
        },
        "zones_reason": None,
        "focus_law": focus_law(),
        "robot": {
            "mount": "eye_in_hand", "source": "joint", "focus_law": "focus_breathing:thin_lens",
            "focus_law_gain_aic": 312.0, "flange_sigma_m": 4.1e-5, "flange_sigma_rad": 6e-5,
            "corner_sigma_px": 0.11, "outliers": [5],
        },
        "missing": {},
        "flange_from_board": None, "base_from_camera": None,
        "solutions": {name: _solution(name, p) for name, p in poses.items()},
        "flange_from_camera": _pose(), "base_from_board": _pose(),
    }  # fmt: skip


def focus_law() -> dict[str, Any]:
    parameters = {
        "alpha0_px": {"value": ALPHA_PX + 0.11, "sigma": 0.21, "unit": "px"},
        "k_px_m2": {"value": K_PX_M2 - 0.02, "sigma": 0.05, "unit": "px m^2"},
    }
    constant = {"alpha_px": {"value": 1352.0, "sigma": 9.0, "unit": "px"}}
    return {
        "law": "inverse_square", "parameters": parameters, "beta_parameters": parameters,
        "why": "inverse_square beats constant by 61.2 AICc", "decisive": True,
        "candidates": [
            {"law": "constant", "aicc": 70.4, "bic": 71.0, "scatter": 31.0, "parameters": constant},
            {"law": "inverse_square", "aicc": 9.2, "bic": 9.9, "scatter": 1.02,
             "parameters": parameters},
        ],
    }  # fmt: skip


def _solution(name: str, poses: SolutionPoses) -> dict[str, Any]:
    robot = poses.board_from_camera_by_robot
    assert robot is not None
    error = position_error_m(poses.board_from_camera, robot)
    zhang = name.startswith("zhang")
    return {
        "alpha_px": 1319.7 if zhang else 1370.83, "beta_px": 1329.7 if zhang else 1373.81,
        "u0_px": 711.2 if zhang else 645.82, "v0_px": 375.9 if zhang else 359.31,
        "at_distance_m": None if zhang else 0.64, "skew_px": 8e-4, "k1": 0.0087, "k2": -0.072,
        "sigma": {"alpha_px": 0.22, "beta_px": 0.23, "u0_px": 0.31, "v0_px": 0.27, "k1": 1.2e-4},
        "reprojection_px": {"mean": 1.8e-10, "median": 0.05, "std": 0.231, "rms": 0.231},
        "camera_position_error_m": {
            "mean": error.mean(axis=0).tolist(), "std": error.std(axis=0).tolist(),
            "rms": float(np.sqrt((error**2).sum(axis=1).mean())),
            "own_hand_eye": None, "robot_in_it": not zhang,
        },
        "robot_consistency": {"rms_m": 1.3e-4, "rms_rad": 2e-4},
    }  # fmt: skip


def _pose() -> dict[str, Any]:
    return {
        "p_m": [0.0123, -0.0541, 0.0873], "q_xyzw": [0.0, 0.7071, 0.0, 0.7071],
        "sigma_p_m": [1.1e-5, 1.2e-5, 2.1e-5], "sigma_r_rad": [8e-5, 7e-5, 6e-5],
    }  # fmt: skip


def _mismatch(
    link: str, site: str, covariate: str, where: str, share: float, p_value: float
) -> dict[str, Any]:
    return {
        "link": link, "site": site, "covariate": covariate, "where": where,
        "share_of_excess": share, "p_value": p_value,
    }  # fmt: skip


def diagnosis(**changes: Any) -> dict[str, Any]:
    return {
        "schema": "cell.diagnosis/1",
        "verdict": "explained",
        "holdout": {"frames": [3, 9, 15], "rms_px_before": 4.21, "rms_px_after": 0.118,
                    "noise_px": 0.104, "nll_before": 310.0, "nll_after": -42.0},
        "misfit": {
            "before": {"pose": 410.0, "picture": 1.02},
            "after": {"pose": 1.04, "picture": 1.0},
        },
        "mismatch": [
            _mismatch("lens", "focal length", "distance", "0.25 to 0.45 m", 0.71, 1e-40),
            _mismatch("arm", "flange", "joint_3", "above 70°", 0.24, 3e-9),
            _mismatch("mount", "flange_from_camera", "gravity", "all attitudes", 0.03, 0.02),
        ],
        "effects": [
            {"name": "focus_breathing", "link": "lens", "law": "inverse_square",
             "physics": "The focal length follows the focus distance.",
             "remedy": "Lock the focus.",
             "parameters": {"k_px_m2": {"value": 5.98, "sigma": 0.05, "unit": "px m^2"}},
             "p_value": 1e-60, "holdout_gain_px": 3.9},
            {"name": "joint_compliance", "link": "arm", "law": None,
             "physics": "A joint gives way under the arm's own weight.",
             "remedy": "Enter the true payload.",
             "parameters": {"rad_per_Nm_3": {"value": 2.1e-5, "sigma": 2e-6, "unit": "rad/Nm"}},
             "p_value": 2e-8, "holdout_gain_px": 0.21},
        ],
        "ambiguous_with": [
            {"names": ["thermal_focal_drift"], "why": "distance grew with time in this run",
             "experiment": "take the distances in another order",
             "separate_with": "separate.yaml"},
        ],
        "recording": "bench-3",
        "recorded": "2026-11-29T13:00:00+01:00",
        "created": "2026-11-29T14:00:00+01:00",
        "program": "calibration-cell 0.1.0",
        "camera": {"model": "robotiq_wrist", "serial": "4711"},
        "robot": {"model": "ur5e", "serial": None},
        "noise": {"corner_px": 0.1, "flange_m": 4e-5, "flange_rad": 5e-5, "print_m": 0.0},
        "frames_used": [0, 1, 2],
        "frames_rejected": [],
        "notes": ["temperature_c was not logged: thermal_focal_drift is looked for against time"],
        "unexplained": None,
        "unexplained_all": [],
        **changes,
    }  # fmt: skip


def evidence(made: MadeUp) -> Evidence:
    count, corners = len(made.views), BOARD.corner_count
    joint = made.views.joints_rad[:, 2]
    shift = made.rng.normal(0, 6e-5, (count, 3))
    before = shift.copy()
    before[:, 2] += 2e-3 / made.distance_m**2 - 4e-3
    before[:, 0] += 4e-4 * np.sin(joint)
    noise = made.rng.normal(0, 0.1, (count, corners, 2))
    return Evidence(
        before_px=noise + 0.004 * (made.views.corners_px - 600),
        after_px=noise,
        shift_before_m=before,
        shift_after_m=shift,
        shift_without_m={"joint_compliance": shift + 4e-4 * np.sin(joint)[:, None] * [1, 0, 0]},
        cost_m={"joint_compliance": 3.2e-4},
        turn_before_rad=made.rng.normal(0, 3e-4, (count, 3)),
        turn_after_rad=made.rng.normal(0, 1e-4, (count, 3)),
        alpha_px=ALPHA_PX - K_PX_M2 / made.distance_m**2 + made.rng.normal(0, 0.6, count),
        alpha_sigma_px=np.full(count, 0.6),
        distance_m=made.distance_m,
        gravity_in_camera=-made.board_from_camera[:, 2, :3],
        board_offset_m=1e-4 * made.rng.normal(0, 1, (corners, 3)),
    )


def picture(frame: int) -> np.ndarray[Any, np.dtype[np.uint8]]:
    ramp = np.linspace(60, 200, WIDTH_PX)[None] * np.ones((HEIGHT_PX, 1))
    image = ramp.astype(np.uint8)
    return np.asarray(cv2.circle(image, (300 + 20 * frame, 350), 160, 90, -1), dtype=np.uint8)


def full(frames: int = 24) -> ReportData:
    """A report with everything there is."""
    made = make(frames)
    poses = poses_of(made)
    residual = {name: made.rng.normal(0, 0.1, made.views.corners_px.shape) for name in SOLUTIONS}
    residual["zhang_mle"] = residual["zhang_mle"] + 2e-4 * (made.views.corners_px - 500)
    truth_alpha = ALPHA_PX - K_PX_M2 / made.distance_m**2
    return ReportData(
        views=made.views,
        recording=RECORDING,
        calibration=calibration(made, poses),
        diagnosis=diagnosis(),
        residuals_px=residual,
        poses=poses,
        evidence=evidence(made),
        truth=Truth(made.board_from_camera, truth_alpha, truth_alpha + 2.9, ("focus_breathing",)),
        simulated=True,
        thumbnail=picture,
        made={"plan hash": "3f9a…", "seed": "7", "made at": "2026-11-22 02:40"},
    )
