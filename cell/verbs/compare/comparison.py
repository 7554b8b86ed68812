"""Two calibrations held against each other: pixels, millimetres, and chance.

The difference of the two cameras' pixels over image and distances is to first order linear in
both fits' numbers, so their covariances say how large it is by chance. In the directions in which
chance moves it at all, its square over its variance is a chi square. That two cameras can only be
compared after their frames are aligned is from mrcal's documentation (D. Kogan, "Differencing").
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from calib.chain.rigid import from_vector, inverse
from calib.distributions import chi2_tail
from calib.views import FloatArray
from cell.verbs.compare.field import Field, aligned_place, differences, field_of, jacobian
from cell.verbs.compare.side import PLACE, Side

SIGNIFICANT = 0.01
"""Two calibrations of the same camera fall below it once in a hundred times."""

_SMALLEST_PX = 1e-3
"""Directions in which chance moves the pixels less than this are no evidence: the difference is
not linear to that degree."""


@dataclass(frozen=True)
class Row:
    """The difference at one distance.

    Attributes
    ----------
    rms_px, worst_px, worst_at_px:
        Over the image; length of the difference, and where the worst is.
    by_chance_px:
        RMS that both fits' uncertainty alone would make.
    lateral_mm, worst_lateral_mm:
        The same differences across the axis, at that distance.
    depth_mm, depth_sigma_mm:
        How much farther along the axis the second camera puts a thing of known size.
    p_value:
        Probability of a difference as large by chance; None where nothing is known of chance.
    """

    distance_m: float
    rms_px: float
    worst_px: float
    worst_at_px: tuple[float, float]
    by_chance_px: float
    lateral_mm: float
    worst_lateral_mm: float
    depth_mm: float
    depth_sigma_mm: float
    p_value: float | None


@dataclass(frozen=True)
class Difference:
    """The whole difference, with the cameras' frames aligned or as they are mounted.

    Attributes
    ----------
    rows:
        One for each distance.
    map_px:
        (D, G, 2) second minus first.
    p_value:
        Over all distances.
    """

    rows: tuple[Row, ...]
    map_px: FloatArray
    p_value: float | None

    @property
    def beyond_chance(self) -> bool | None:
        """Whether it is more than chance; None where nothing is known of chance."""
        return None if self.p_value is None else self.p_value < SIGNIFICANT


@dataclass(frozen=True)
class Comparison:
    """Two calibrations compared.

    Attributes
    ----------
    a, b, field:
        The sides, and the points.
    camera:
        The cameras by themselves, their frames aligned as well as a rigid motion can.
    mounted:
        The cameras where the robot has them; None where one's place is not known.
    notes:
        What limits the answer.
    """

    a: Side
    b: Side
    field: Field
    camera: Difference
    mounted: Difference | None
    notes: tuple[str, ...]


def compare(a: Side, b: Side) -> Comparison:
    """Compare two calibrations of one camera.

    Raises
    ------
    InputError
        They cannot be of one camera, or have no distance in common.
    """
    field = field_of(a, b)
    camera = _difference(a, b, field, (np.eye(4), aligned_place(a, b, field)), align=True)
    mounted = None
    if a.place is not None and b.place is not None and a.place_name == b.place_name:
        mounted = _difference(a, b, field, (a.place, b.place), align=False)
    return Comparison(a, b, field, camera, mounted, _notes(a, b, mounted))


def _notes(a: Side, b: Side, mounted: Difference | None) -> tuple[str, ...]:
    notes = [
        f"{side.label}: only single sigmas are known, not how they go together; chance is a guess"
        for side in (a, b)
        if not side.correlated
    ]
    notes += [
        f"{side.label}: its own frames ask for up to {side.too_sure:.1f} times the uncertainty it"
        " states (cross-validation): chance makes more than is stated here"
        for side in (a, b)
        if side.too_sure > 1.0
    ]
    if mounted is None:
        notes.append("the cameras' places on the robot are not both known: not compared")
    notes += [
        f"{side.label}: its focal length has a corner at the edge of zone 2; the smooth"
        f" {side.law} law is compared, not zone 2's own value"
        for side in (a, b)
        if side.has_corner
    ]
    if a.solution != b.solution:
        notes.append(f"solution {a.solution} is compared with {b.solution}")
    return tuple(notes)


def _difference(
    a: Side, b: Side, field: Field, places: tuple[FloatArray, FloatArray], *, align: bool
) -> Difference:
    map_px = differences(a, b, field, (a.values, b.values), places)
    spread = np.hstack([jacobian(a, b, field, places, k) @ _root((a, b)[k], align) for k in (0, 1)])
    if align:
        J = jacobian(a, b, field, places, 1)[:, PLACE]
        spread = spread - J @ np.linalg.lstsq(J, spread, rcond=None)[0]
    shape = (*map_px.shape, spread.shape[1])
    each = spread.reshape(shape)
    rows = tuple(
        _row(a, b, field, k, map_px[k], each[k], None if align else places)
        for k in range(len(field.distances_m))
    )
    if not (a.knows_chance and b.knows_chance):
        return Difference(tuple(replace(row, p_value=None) for row in rows), map_px, None)
    return Difference(rows, map_px, _p_value(map_px.ravel(), spread))


def _root(side: Side, align: bool) -> FloatArray:
    """(P, P) square root of the covariance; without the place where the frames are aligned."""
    covariance = side.covariance.copy()
    if align:
        covariance[PLACE], covariance[:, PLACE] = 0.0, 0.0
    sigma = np.sqrt(np.diag(covariance))
    scale = np.where(sigma > 0, sigma, 1.0)  # so that pixels and radians weigh alike
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    return np.asarray(scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))


def _p_value(difference: FloatArray, spread: FloatArray) -> float | None:
    """Chi-square probability of (n,) differences that chance spreads by (n, q)."""
    vectors, size, _ = np.linalg.svd(spread, full_matrices=False)
    large = size > _SMALLEST_PX * np.sqrt(len(difference) / 2)
    if not large.any():
        return None
    z = (vectors[:, large].T @ difference) / size[large]
    return chi2_tail(float((z**2).sum()), int(large.sum()))


def _row(
    a: Side,
    b: Side,
    field: Field,
    k: int,
    difference: FloatArray,
    spread: FloatArray,
    places: tuple[FloatArray, FloatArray] | None,
) -> Row:
    d = float(field.distances_m[k])
    length = np.linalg.norm(difference, axis=1)
    lateral_mm = 1e3 * d * np.linalg.norm(difference / a.scale_px(a.values, d), axis=1)
    worst = int(length.argmax())
    depth_m, depth_sigma_m = _depth(a, b, d, places)
    return Row(
        distance_m=d,
        rms_px=_rms(length),
        worst_px=float(length[worst]),
        worst_at_px=(float(field.pixels[worst, 0]), float(field.pixels[worst, 1])),
        by_chance_px=float(np.sqrt((spread**2).sum() / len(length))),
        lateral_mm=_rms(lateral_mm),
        worst_lateral_mm=float(lateral_mm.max()),
        depth_mm=1e3 * depth_m,
        depth_sigma_mm=1e3 * depth_sigma_m,
        p_value=_p_value(difference.ravel(), spread.reshape(-1, spread.shape[-1])),
    )


def _rms(values: FloatArray) -> float:
    return float(np.sqrt((values**2).mean()))


def _depth(
    a: Side, b: Side, distance_m: float, places: tuple[FloatArray, FloatArray] | None
) -> tuple[float, float]:
    """How much farther `b` puts a thing of known size, and one sigma; metres."""

    def along(va: FloatArray, vb: FloatArray) -> float:
        scale = [np.sqrt(np.prod(s.scale_px(v, distance_m))) for s, v in ((a, va), (b, vb))]
        shift = 0.0
        if places is not None:
            moved = [p @ from_vector(v[PLACE]) for p, v in zip(places, (va, vb), strict=True)]
            shift = float((inverse(places[0]) @ moved[1])[2, 3])
            shift -= float((inverse(places[0]) @ moved[0])[2, 3])
        return distance_m * float(scale[1] / scale[0] - 1) + shift

    variance = 0.0
    for which, side in enumerate((a, b)):
        gradient = np.empty(len(side.values))
        for k, step in enumerate(side.steps()):
            nudge = np.eye(len(side.values))[k] * step
            both = [[a.values, b.values], [a.values, b.values]]
            both[0][which], both[1][which] = side.values + nudge, side.values - nudge
            gradient[k] = (along(*both[0]) - along(*both[1])) / (2 * step)
        variance += float(gradient @ side.covariance @ gradient)
    return along(a.values, b.values), float(np.sqrt(max(variance, 0.0)))
