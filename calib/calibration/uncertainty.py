"""How uncertain the joint fit's camera is where it is used: in pixels, and at the work piece.

The full covariance of the fit, carried to first order (ISO/IEC Guide 98-3, section 5.2) through
the same chain that was fitted: lens, law of the focus, and the camera's place on the flange (or in
the base, where it stands still). A next picture's own corner noise, the robot's repeatability and
what the model leaves out come on top.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.calibration.made_views import views_that_see
from calib.chain import rigid
from calib.chain.model import CellModel, predict, walk
from calib.chain.projection import project_with_jacobians
from calib.solver.joint import JointFit
from calib.solver.unknowns import moved
from calib.views import Board, FloatArray, Views

_COLUMNS, _ROWS, _DISTANCES = 5, 3, 4
_EDGE = 0.1
_PART_OF_IMAGE = 0.2
_STEP_SIGMA = 0.1


@dataclass(frozen=True)
class UncertaintyMap:
    """One sigma over image and distance, for D distances and G pixels.

    Attributes
    ----------
    distance_m, pixels_px:
        (D,) depths, the focus at each; (G, 2) where in the image.
    part_m:
        (D,) side of the square part that is located: the board's, but no more than a fifth of
        the image.
    projection_sigma_px:
        (D, G, 2) of `projection_sigma_px`.
    workpiece_sigma_m:
        (D, G, 3) of `workpiece_sigma_m`.
    """

    distance_m: FloatArray
    pixels_px: FloatArray
    part_m: FloatArray
    projection_sigma_px: FloatArray
    workpiece_sigma_m: FloatArray


def uncertainty_map(
    joint: JointFit, views: Views, distance_range_m: tuple[float, float]
) -> UncertaintyMap:
    """The uncertainty on a small grid over the image and the range of distances.

    Parameters
    ----------
    joint, views:
        The fit; of the views only image size, board and mount are looked at.
    distance_range_m:
        Nearest and farthest depth.
    """
    u = np.linspace(_EDGE, 1 - _EDGE, _COLUMNS) * views.width_px
    v = np.linspace(_EDGE, 1 - _EDGE, _ROWS) * views.height_px
    pixels = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    distances = np.geomspace(*distance_range_m, _DISTANCES)
    return UncertaintyMap(
        distances,
        pixels,
        np.array([_part(joint, views, float(d))[1] for d in distances]),
        projection_sigma_px(joint, views, pixels, distances),
        workpiece_sigma_m(joint, views, pixels, distances),
    )


def projection_sigma_px(
    joint: JointFit, views: Views, pixels_px: FloatArray, distance_m: FloatArray
) -> FloatArray:
    """How far off the camera may predict where a thing appears that the robot has the place of.

    Parameters
    ----------
    joint, views:
        As for `uncertainty_map`.
    pixels_px, distance_m:
        (G, 2) where it appears, (D,) its depth; the lens is focused there.

    Returns
    -------
    (D, G, 2) one sigma along u and v, pixels.
    """
    out = []
    for d in distance_m:
        part, _ = _part(joint, views, float(d))
        shown = _shown(joint, views, part, pixels_px, float(d))
        change, covariance = _change_of_pixels(joint, shown)
        out.append(_sigma(change[:, part.corner_count // 2], covariance))
    return np.array(out)


def workpiece_sigma_m(
    joint: JointFit, views: Views, pixels_px: FloatArray, distance_m: FloatArray
) -> FloatArray:
    """How far off the robot may be told a part is that one perfect picture locates.

    The part lies square to the optical axis and is found by least squares in pixels; then the
    camera's place brings it to the robot.

    Parameters
    ----------
    joint, views, pixels_px, distance_m:
        As for `projection_sigma_px`; the pixel is that of the part's middle.

    Returns
    -------
    (D, G, 3) one sigma of its middle along the camera's axes, metres: right, down, away.
    """
    out = []
    for d in distance_m:
        part, _ = _part(joint, views, float(d))
        shown = _shown(joint, views, part, pixels_px, float(d))
        change, covariance = _change_of_pixels(joint, shown)
        located = _change_of_place(joint, shown) @ change.reshape(len(shown), -1, len(covariance))
        out.append(_sigma(located, covariance))
    return np.array(out)


def _part(joint: JointFit, views: Views, distance_m: float) -> tuple[Board, float]:
    """Nine points on a square part, and its side."""
    alpha = float(optics_at(joint.model, views, distance_m)[0])
    extent = float(np.ptp(views.board.corners_m[:, :2], axis=0).mean())
    side = min(extent, _PART_OF_IMAGE * min(views.width_px, views.height_px) * distance_m / alpha)
    return Board("chessboard", 3, 3, side / 2), side


def optics_at(model: CellModel, views: Views, distance_m: float) -> FloatArray:
    """(K,) of the camera focused at a distance; of the views only size, board, mount count."""
    ahead = rigid.compose(np.zeros((1, 3)), np.array([[0.0, 0.0, distance_m]]))
    shown = views_that_see(model, views, views.board, ahead, distance_m)
    return np.asarray(walk(model, shown).optics[0])


def _shown(
    joint: JointFit, views: Views, part: Board, pixels_px: FloatArray, distance_m: float
) -> Views:
    """Views of the part, one with its middle at each pixel."""
    optics, eye = optics_at(joint.model, views, distance_m)[None], np.eye(4)[None]
    points = np.column_stack([np.zeros_like(pixels_px), np.full(len(pixels_px), distance_m)])
    for _ in range(20):
        uv, by_pose, _ = project_with_jacobians(optics, eye, points)
        step = np.linalg.solve(by_pose[0, :, :, :2], (pixels_px - uv[0])[..., None])[..., 0]
        points[:, :2] += step
    poses = rigid.compose(np.zeros_like(points), points - part.corners_m.mean(axis=0))
    return views_that_see(joint.model, views, part, poses, distance_m)


def _change_of_pixels(joint: JointFit, shown: Views) -> tuple[FloatArray, FloatArray]:
    """(F, M, 2, q) by the camera's q numbers, the part staying where it is; their covariance."""
    at = _camera_numbers(joint, shown)
    covariance = joint.covariance[np.ix_(at, at)]
    columns = []
    for k, sigma in zip(at, np.sqrt(np.diag(covariance)), strict=True):
        step = np.zeros(len(joint.unknowns))
        step[k] = _STEP_SIGMA * sigma
        ahead, behind = (moved(joint.model, joint.unknowns, s) for s in (step, -step))
        columns.append((predict(ahead, shown) - predict(behind, shown)) / (2 * step[k]))
    return np.stack(columns, axis=-1), covariance


def _camera_numbers(joint: JointFit, shown: Views) -> NDArray[np.int64]:
    """Which of the fit's numbers are the camera's: all but where the board is."""
    board = "base_from_fixed" if shown.mount == "eye_in_hand" else "flange_from_mounted"
    return np.flatnonzero([not u.name.startswith(f"{board}.") for u in joint.unknowns])


def _change_of_place(joint: JointFit, shown: Views) -> FloatArray:
    """(F, 3, 2M) of the part's middle, camera's axes, when the predicted pixels change."""
    state = walk(joint.model, shown)
    _, by_pose, _ = project_with_jacobians(state.optics, state.camera_from_board, state.points_m)
    middle = state.points_m.mean(axis=0)
    at = state.camera_from_board[:, :3, :3] @ middle + state.camera_from_board[:, :3, 3]
    by_increment = np.concatenate([np.tile(np.eye(3), (len(at), 1, 1)), -rigid.skew(at)], axis=2)
    located: FloatArray = -by_increment @ np.linalg.pinv(by_pose.reshape(len(at), -1, 6))
    return located


def _sigma(change: FloatArray, covariance: FloatArray) -> FloatArray:
    variance = np.einsum("...p,pq,...q->...", change, covariance, change)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))
