"""How uncertain the joint fit's camera is where it is used: in pixels, and at the work piece.

The full covariance of the fit, carried to first order (ISO/IEC Guide 98-3, section 5.2) through
the same chain that was fitted: lens, law of the focus, and the camera's place on the flange (or in
the base, where it stands still). A next picture's own corner noise, the robot's repeatability and
what the model leaves out come on top.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from calib.calibration.simulated_views import views_that_see
from calib.chain import rigid
from calib.chain.model import CellModel, evaluate, predict
from calib.chain.optics import COLUMN
from calib.chain.projection import project_with_jacobians
from calib.chain.sight import unproject
from calib.solver.unknowns import Unknown, moved
from calib.views import Board, BoolArray, FloatArray, Views

_COLUMNS, _ROWS, _DISTANCES = 5, 3, 4
_EDGE = 0.1
_SHRINK, _SHRINKS = 0.9, 20
_PART_OF_IMAGE = 0.2
_STEP_SIGMA = 0.1


class Estimate(Protocol):
    """A cell with the p numbers that are uncertain in it: a joint fit, or one to be expected."""

    @property
    def model(self) -> CellModel:
        """The cell."""

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        """What was, or will be, free."""

    @property
    def covariance(self) -> FloatArray:
        """(p, p) of the unknowns."""


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
    joint: Estimate, views: Views, distance_range_m: tuple[float, float]
) -> UncertaintyMap:
    """The uncertainty on a small grid over the image and the range of distances.

    Parameters
    ----------
    joint, views:
        The fit; of the views only image size, board and mount are looked at.
    distance_range_m:
        Nearest and farthest depth.
    """
    pixels, distances = grid_px(views, joint.model), grid_m(distance_range_m)
    return UncertaintyMap(
        distances,
        pixels,
        np.array([_part(joint, views, float(d))[1] for d in distances]),
        projection_sigma_px(joint, views, pixels, distances),
        workpiece_sigma_m(joint, views, pixels, distances),
    )


def grid_px(views: Views, model: CellModel) -> FloatArray:
    """(G, 2) places all over the image, or over the part of it that has lines of sight."""
    u = np.linspace(_EDGE, 1 - _EDGE, _COLUMNS) * views.width_px
    v = np.linspace(_EDGE, 1 - _EDGE, _ROWS) * views.height_px
    pixels = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    middle = pixels.mean(axis=0)
    for _ in range(_SHRINKS):
        if np.isfinite(unproject(model.optics, pixels)).all():
            break
        pixels = middle + _SHRINK * (pixels - middle)
    return pixels


def grid_m(distance_range_m: tuple[float, float]) -> FloatArray:
    """(D,) depths, closer together where they are near."""
    return np.asarray(np.geomspace(*distance_range_m, _DISTANCES))


def projection_sigma_px(
    joint: Estimate, views: Views, pixels_px: FloatArray, distance_m: FloatArray
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
    return _sigma(projection_change_px(joint, views, pixels_px, distance_m), joint.covariance)


def projection_change_px(
    joint: Estimate, views: Views, pixels_px: FloatArray, distance_m: FloatArray
) -> FloatArray:
    """(D, G, 2, p) of those pixels, by each of the p numbers; see `projection_sigma_px`."""
    return np.array(
        [
            _change_of_pixels(joint, shown)[:, shown.board.corner_count // 2]
            for shown in _shown_at(joint, views, pixels_px, distance_m)
        ]
    )


def focal_length_sigma_px(joint: Estimate, views: Views, distance_m: FloatArray) -> FloatArray:
    """(D,) one sigma of alpha with the lens focused at each distance, pixels."""
    return _sigma(focal_length_change_px(joint, views, distance_m), joint.covariance)


def focal_length_change_px(joint: Estimate, views: Views, distance_m: FloatArray) -> FloatArray:
    """(D, p) of alpha at (D,) distances, by each of the p numbers."""
    at = COLUMN["alpha_px"]

    def alpha(model: CellModel) -> FloatArray:
        return np.array([optics_at(model, views, float(d))[at] for d in distance_m])

    return _change(joint, alpha, np.ones(len(joint.unknowns), dtype=bool))


def workpiece_sigma_m(
    joint: Estimate, views: Views, pixels_px: FloatArray, distance_m: FloatArray
) -> FloatArray:
    """How far off a part may be for the robot that one perfect picture locates.

    The part lies square to the optical axis (with a wide lens to the line of sight, its distance
    along that) and is found by least squares in pixels; then the
    camera's place brings it to the robot.

    Parameters
    ----------
    joint, views, pixels_px, distance_m:
        As for `projection_sigma_px`; the pixel is that of the part's middle.

    Returns
    -------
    (D, G, 3) one sigma of its middle along the camera's axes, metres: right, down, away.
    """
    return _sigma(workpiece_change_m(joint, views, pixels_px, distance_m), joint.covariance)


def workpiece_change_m(
    joint: Estimate, views: Views, pixels_px: FloatArray, distance_m: FloatArray
) -> FloatArray:
    """(D, G, 3, p) of that place, by each of the p numbers; see `workpiece_sigma_m`."""
    out = []
    for shown in _shown_at(joint, views, pixels_px, distance_m):
        change = _change_of_pixels(joint, shown)
        out.append(
            _change_of_place(joint, shown) @ change.reshape(len(shown), -1, change.shape[-1])
        )
    return np.array(out)


def _part(joint: Estimate, views: Views, distance_m: float) -> tuple[Board, float]:
    """Nine points on a square part, and its side."""
    alpha = float(optics_at(joint.model, views, distance_m)[0])
    extent = float(np.ptp(views.board.corners_m[:, :2], axis=0).mean())
    side = min(extent, _PART_OF_IMAGE * min(views.width_px, views.height_px) * distance_m / alpha)
    return Board("chessboard", 3, 3, side / 2), side


def optics_at(model: CellModel, views: Views, distance_m: float) -> FloatArray:
    """(K,) of the camera focused at a distance; of the views only size, board, mount count."""
    ahead = rigid.compose(np.zeros((1, 3)), np.array([[0.0, 0.0, distance_m]]))
    shown = views_that_see(model, views, views.board, ahead, distance_m)
    return np.asarray(evaluate(model, shown).optics[0])


def _shown(
    joint: Estimate, views: Views, part: Board, pixels_px: FloatArray, distance_m: float
) -> Views:
    """Views of the part, one with its middle at each pixel."""
    optics, eye = optics_at(joint.model, views, distance_m)[None], np.eye(4)[None]
    if optics[0, COLUMN["equidistant"]]:
        poses = _facing(part, unproject(optics[0], pixels_px), distance_m)
        return views_that_see(joint.model, views, part, poses, distance_m)
    points = np.column_stack([np.zeros_like(pixels_px), np.full(len(pixels_px), distance_m)])
    for _ in range(20):
        uv, by_pose, _ = project_with_jacobians(optics, eye, points)
        step = np.linalg.solve(by_pose[0, :, :, :2], (pixels_px - uv[0])[..., None])[..., 0]
        points[:, :2] += step
    poses = rigid.compose(np.zeros_like(points), points - part.corners_m.mean(axis=0))
    return views_that_see(joint.model, views, part, poses, distance_m)


def _shown_at(
    joint: Estimate, views: Views, pixels_px: FloatArray, distance_m: FloatArray
) -> Iterator[Views]:
    """Views of the part for each distance, one with its middle at each pixel."""
    for d in distance_m:
        part, _ = _part(joint, views, float(d))
        yield _shown(joint, views, part, pixels_px, float(d))


def _facing(part: Board, sight: FloatArray, distance_m: float) -> FloatArray:
    """(G, 4, 4) of the part's middle at a distance along (G, 3) lines of sight, square to them."""
    turned = rigid.turn_from_axis(sight)
    turned[:, :3, 3] = distance_m * sight - turned[:, :3, :3] @ part.corners_m.mean(axis=0)
    return turned


def _change_of_pixels(joint: Estimate, shown: Views) -> FloatArray:
    """(F, M, 2, p) by the camera's numbers, the part staying where it is; none by the board's."""
    board = "base_from_fixed" if shown.mount == "eye_in_hand" else "flange_from_mounted"
    camera = np.array([not u.name.startswith(f"{board}.") for u in joint.unknowns])
    return _change(joint, lambda model: predict(model, shown), camera)


def _change(
    joint: Estimate, quantity: Callable[[CellModel], FloatArray], by: BoolArray
) -> FloatArray:
    """(..., p) of what a cell implies, by those of the p numbers; central differences."""
    sigma = np.sqrt(np.diag(joint.covariance))
    change = np.zeros((*quantity(joint.model).shape, len(sigma)))
    for k in np.flatnonzero(by):
        step = np.zeros(len(sigma))
        step[k] = _STEP_SIGMA * sigma[k]
        ahead, behind = (quantity(moved(joint.model, joint.unknowns, s)) for s in (step, -step))
        change[..., k] = (ahead - behind) / (2 * step[k])
    return change


def _change_of_place(joint: Estimate, shown: Views) -> FloatArray:
    """(F, 3, 2M) of the part's middle, camera's axes, when the predicted pixels change."""
    state = evaluate(joint.model, shown)
    _, by_pose, _ = project_with_jacobians(state.optics, state.camera_from_board, state.points_m)
    middle = state.points_m.mean(axis=0)
    at = state.camera_from_board[:, :3, :3] @ middle + state.camera_from_board[:, :3, 3]
    by_increment = np.concatenate([np.tile(np.eye(3), (len(at), 1, 1)), -rigid.skew(at)], axis=2)
    located: FloatArray = -by_increment @ np.linalg.pinv(by_pose.reshape(len(at), -1, 6))
    return located


def _sigma(change: FloatArray, covariance: FloatArray) -> FloatArray:
    variance = np.einsum("...p,pq,...q->...", change, covariance, change)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))
