"""This calibration beside OpenCV's calibrateCamera and calibrateRobotWorldHandEye.

    python benchmarks/against_opencv.py RECORDING...

Both get the same corners of the same frames (where a recording has none, this project's detector
finds them) and the same camera model: alpha, beta, u0, v0, k1, k2. Columns: reprojection with a
free pose for each frame; with the poses held to the robot; and how far the free poses and the
robot's disagree, as distance of the board's centre and as angle.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from calib.calibration import Calibration
from calib.calibration.robot import hand_eye_of
from calib.chain.optics import optics_row
from calib.chain.projection import project
from calib.chain.rigid import compose, inverse
from calib.handeye import chain
from calib.views import BoolArray, FloatArray, Views
from cell.storage.recording import read_recording
from cell.storage.recording.detect import corners_of
from cell.verbs.calibrate import calibrate_recording

HAND_EYE = {
    "Shah": cv2.CALIB_ROBOT_WORLD_HAND_EYE_SHAH,
    "Li": cv2.CALIB_ROBOT_WORLD_HAND_EYE_LI,
}


@dataclass(frozen=True)
class Row:
    """One line of the table; NaN where nothing is known."""

    who: str
    free_px: float
    held_px: float = np.nan
    position_mm: float = np.nan
    angle_deg: float = np.nan
    alpha_px: float = np.nan
    seconds: float = np.nan

    def __str__(self) -> str:
        numbers = (self.free_px, self.held_px, self.position_mm, self.angle_deg, self.alpha_px)
        cells = "".join("         -" if np.isnan(n) else f"{n:10.3f}" for n in numbers)
        return f"  {self.who:<34}{cells}{self.seconds:9.2f}"


def rms(residual_px: FloatArray) -> float:
    """Root mean square per corner."""
    r = residual_px[np.isfinite(residual_px).all(axis=-1)]
    return float(np.sqrt((r**2).sum(axis=-1).mean()))


def held_rms(views: Views, optics: FloatArray, poses: FloatArray) -> float:
    """Reprojection with poses from the robot."""
    return rms(views.corners_px - project(optics, poses, views.board.corners_m))


def disagreement(views: Views, poses: FloatArray, by_robot: FloatArray) -> tuple[float, float]:
    """RMS distance of the board's centre in mm, and RMS angle in degrees."""
    centre = np.append(views.board.corners_m.mean(axis=0), 1.0)
    off = ((poses - by_robot) @ centre)[:, :3]
    trace = np.einsum("nij,nij->n", poses[:, :3, :3], by_robot[:, :3, :3])
    angle = np.degrees(np.arccos(np.clip((trace - 1) / 2, -1, 1)))
    return 1e3 * float(np.sqrt((off**2).sum(axis=1).mean())), float(np.sqrt((angle**2).mean()))


def opencv_rows(views: Views) -> Iterator[Row]:
    """calibrateCamera, then both robot-world/hand-eye methods on its poses."""
    began = time.process_time()
    points = views.board.corners_m.astype(np.float32)
    objects = [points[seen] for seen in views.seen]
    pixels = [c[s].astype(np.float32) for c, s in zip(views.corners_px, views.seen, strict=True)]
    free, K, dist, rotations, translations = cv2.calibrateCamera(
        objects,
        pixels,
        (views.width_px, views.height_px),
        np.eye(3),
        np.zeros(5),
        flags=cv2.CALIB_ZERO_TANGENT_DIST | cv2.CALIB_FIX_K3,
    )
    turned, moved = (np.array(v, dtype=np.float64)[:, :, 0] for v in (rotations, translations))
    poses = compose(turned, moved)
    row = optics_row(
        alpha_px=K[0, 0],
        beta_px=K[1, 1],
        u0_px=K[0, 2],
        v0_px=K[1, 2],
        k1=dist.ravel()[0],
        k2=dist.ravel()[1],
        height_px=views.height_px,
    )
    fitted = time.process_time() - began
    if not views.has_pose.all():
        yield Row("OpenCV", free, alpha_px=K[0, 0], seconds=fitted)
        return
    for name, method in HAND_EYE.items():
        began = time.process_time()
        by_robot = opencv_chain(views, poses, method)
        took = fitted + time.process_time() - began
        held = held_rms(views, np.tile(row, (len(views), 1)), by_robot)
        yield Row(
            f"OpenCV, {name}", free, held, *disagreement(views, poses, by_robot), K[0, 0], took
        )


def opencv_chain(views: Views, poses: FloatArray, method: int) -> FloatArray:
    """(N, 4, 4) camera_from_board by the robot, after OpenCV's hand-eye."""
    flange = views.base_from_flange
    logged = inverse(flange) if views.mount == "eye_in_hand" else flange
    board_r, board_t, camera_r, camera_t = cv2.calibrateRobotWorldHandEye(
        list(poses[:, :3, :3]),
        list(poses[:, :3, 3]),
        list(logged[:, :3, :3]),
        list(logged[:, :3, 3]),
        method=method,
    )
    board_from, camera_from = np.eye(4), np.eye(4)
    board_from[:3, :3], board_from[:3, 3] = board_r, board_t.ravel()
    camera_from[:3, :3], camera_from[:3, 3] = camera_r, camera_t.ravel()
    return np.asarray(camera_from @ logged @ np.linalg.inv(board_from))


def own_rows(views: Views, result: Calibration, same: BoolArray, seconds: float) -> Iterator[Row]:
    """Zhang's fit with hand-eye on its poses, and the joint fit."""
    zhang = result.solutions["zhang_mle"]
    optics, poses, residual = (
        values[same] for values in (zhang.optics, zhang.camera_from_board, zhang.residual_px)
    )
    first = zhang.values["alpha_px"]
    if result.robot is None:
        yield Row("here, Zhang's fit", rms(residual), alpha_px=first, seconds=seconds)
        return
    part = views.take(same)
    hand = hand_eye_of(part, np.ones(len(part), dtype=bool), poses)
    by_robot = hand.camera_from_board(part.base_from_flange)
    yield Row(
        "here, Zhang's fit and hand-eye",
        rms(residual),
        held_rms(part, optics, by_robot),
        *disagreement(part, poses, by_robot),
        first,
        seconds,
    )
    joint, robot = result.solutions["joint_ml"], result.robot
    taken: BoolArray = np.asarray(np.isfinite(joint.camera_from_board).all(axis=(1, 2)))
    part = views.take(taken)
    by_robot = chain(
        robot.mount, robot.flange_from_mounted, part.base_from_flange, robot.base_from_fixed
    )
    yield Row(
        f"here, joint fit ({robot.law or 'still lens'})",
        rms(joint.residual_px),
        held_rms(part, joint.optics[taken], by_robot),
        *disagreement(part, joint.camera_from_board[taken], by_robot),
        joint.values["alpha_px"],
        seconds,
    )


def compare(path: Path) -> None:
    """Print one recording's table."""
    recording = read_recording(path)
    corners = corners_of(recording)
    began = time.process_time()
    calibrated = calibrate_recording(recording, corners)
    seconds = time.process_time() - began
    result = calibrated.result
    rejected = "; ".join(
        f"{r['frame']}: {r['reason']}" for r in calibrated.mapping["frames_rejected"]
    )
    outliers = () if result.robot is None else result.robot.outliers
    print(f"{recording.name}: {int(result.used.sum())} of {len(result.frame)} frames used")
    print(f"  rejected: {rejected or 'none'}; poses that disagree: {list(outliers) or 'none'}")
    print(f"  {'':<34}{'free px':>10}{'held px':>10}{'mm':>10}{'deg':>10}{'alpha':>10}{'CPU s':>9}")
    same = result.used & ~np.isin(result.frame, outliers)
    for row in opencv_rows(calibrated.views.take(same)):
        print(row)
    for row in own_rows(calibrated.views, result, same, seconds):
        print(row)


if __name__ == "__main__":
    for argument in sys.argv[1:] or sys.exit(__doc__):
        compare(Path(argument))
