"""The points at which two cameras are held against each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.chain.rigid import from_vector
from calib.chain.sight import unproject
from calib.views import FloatArray
from cell.errors import InputError
from cell.verbs.compare.side import PLACE, Side

DISTANCES = 4
_COLUMNS, _ROWS = 9, 7
_EDGE = 0.02


@dataclass(frozen=True)
class Field:
    """Points all over one camera's image at some distances.

    Attributes
    ----------
    distances_m:
        (D,) depths, the focus at each.
    pixels:
        (G, 2) where the first camera sees them.
    points_m:
        (D, G, 3) in the first camera's frame.
    """

    distances_m: FloatArray
    pixels: FloatArray
    points_m: FloatArray


def field_of(a: Side, b: Side) -> Field:
    """Points over the image of `a`, at the distances that both were calibrated for.

    Raises
    ------
    InputError
        They have no distance in common, or their images differ in size.
    """
    if a.image_size_px != b.image_size_px:
        sizes = " and ".join(f"{w} x {h}" for w, h in (a.image_size_px, b.image_size_px))
        raise InputError(f"{a.label} and {b.label} are of images of {sizes}: not the same camera")
    near, far = max(a.range_m[0], b.range_m[0]), min(a.range_m[1], b.range_m[1])
    if near >= far:
        raise InputError(
            f"{a.label} holds from {a.range_m[0]:.3f} to {a.range_m[1]:.3f} m and {b.label} from"
            f" {b.range_m[0]:.3f} to {b.range_m[1]:.3f} m: there is no distance to compare them at"
        )
    distances = np.geomspace(near, far, DISTANCES)
    width, height = a.image_size_px
    u = np.linspace(_EDGE, 1 - _EDGE, _COLUMNS) * width
    v = np.linspace(_EDGE, 1 - _EDGE, _ROWS) * height
    pixels = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    points = np.array([_rays(a, pixels, float(d)) * d for d in distances])
    seen = np.isfinite(points).all(axis=(0, 2))
    return Field(distances, pixels[seen], np.ascontiguousarray(points[:, seen]))


def _rays(side: Side, pixels: FloatArray, distance_m: float) -> FloatArray:
    """(G, 3) directions that the camera sees at these pixels, NaN where none is.

    With z = 1 for a perspective image, of unit length for a wide one.
    """
    sight = unproject(side.optics(side.values, distance_m), pixels)
    return sight if side.wide else np.asarray(sight / sight[:, 2:])


def differences(
    a: Side,
    b: Side,
    field: Field,
    values: tuple[FloatArray, FloatArray],
    places: tuple[FloatArray, FloatArray],
) -> FloatArray:
    """(D, G, 2) pixels of `b` minus those of `a`, of the field's points, which stay where they are.

    Parameters
    ----------
    values:
        The numbers of both sides.
    places:
        (4, 4) of both cameras in the frame they share; the points lie before that of `a`.
    """
    out = np.empty((*field.points_m.shape[:2], 2))
    for k, distance in enumerate(field.distances_m):
        points = field.points_m[k] @ places[0][:3, :3].T + places[0][:3, 3]
        d = float(distance)
        out[k] = b.pixels(values[1], points, d, places[1]) - a.pixels(
            values[0], points, d, places[0]
        )
    return out


def jacobian(
    a: Side, b: Side, field: Field, places: tuple[FloatArray, FloatArray], which: int
) -> FloatArray:
    """(D * G * 2, P) derivative of `differences` by the numbers of one side (0 or 1)."""
    values, steps = (a.values, b.values), (a, b)[which].steps()
    columns = []
    for k, step in enumerate(steps):
        ahead, behind = list(values), list(values)
        nudge = np.eye(len(steps))[k] * step
        ahead[which], behind[which] = values[which] + nudge, values[which] - nudge
        plus = differences(a, b, field, (ahead[0], ahead[1]), places)
        minus = differences(a, b, field, (behind[0], behind[1]), places)
        columns.append((plus - minus).ravel() / (2 * step))
    return np.stack(columns, axis=1)


def aligned_place(a: Side, b: Side, field: Field) -> FloatArray:
    """(4, 4) place of camera `b` in the frame of camera `a` that brings their pixels closest.

    Two calibrations may put the same camera's frame differently; what a rigid motion of it takes
    away is no difference between cameras.
    """
    place = np.eye(4)
    for _ in range(10):
        places = (np.eye(4), place)
        left = differences(a, b, field, (a.values, b.values), places).ravel()
        J = jacobian(a, b, field, places, 1)[:, PLACE]
        step: FloatArray = np.asarray(-np.linalg.lstsq(J, left, rcond=None)[0], dtype=np.float64)
        place = place @ from_vector(step)
        if np.abs(step).max() < 1e-12:
            break
    return place
