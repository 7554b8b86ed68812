"""The best fit of a camera by a model with fewer coefficients, and how far it is off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from calib.chain.domain import distorted_radius, invertible_rad
from calib.chain.projection import project
from calib.views import FloatArray
from cell.storage.files.calibration_source import DISTORTION
from cell.verbs.export.camera import FISHEYE, Camera

_DIRECTIONS, _RADII, _STEPS = 48, 24, 400
_WIDEST_RAD = np.radians(85.0)
_EXACT_PX = 1e-3
"""A shorter list of coefficients serves where no pixel is farther off than this."""


@dataclass(frozen=True)
class Refit:
    """A camera that a tool can say, and its distance from the exact one over the picture."""

    camera: Camera
    rms_px: float
    worst_px: float

    @property
    def description(self) -> str:
        """For a warning and a file's comment."""
        return (
            f"refitted with fewer coefficients: off the calibrated camera by {self.rms_px:.3g} px"
            f" rms, {self.worst_px:.3g} px at worst, over all of the picture where that holds"
        )


def refit(camera: Camera, lengths: tuple[int, ...], *, wide: bool = False) -> Refit:
    """Fit focal lengths, principal point and coefficients of a tool's model to a camera.

    Parameters
    ----------
    camera:
        The exact one; its picture's size must be known.
    lengths:
        How many coefficients of `DISTORTION` the tool takes.
    wide:
        Fit an equidistant image with its four terms instead.
    """
    rays, pixels, weight = field(camera)
    if wide:
        return _fitted(camera, FISHEYE, rays, pixels, weight)
    start = _as_perspective(camera) if camera.wide else camera
    best: Refit | None = None
    for length in sorted(lengths):
        found = _fitted(start, DISTORTION[:length], rays, pixels, weight)
        if best is None or found.rms_px < best.rms_px:
            best = found
        if best.worst_px < _EXACT_PX:
            break
    assert best is not None
    return best


_RATIONAL = ("k1", "k2", "k3", "k4", "k5", "k6")
_REWEIGHTED = 10


def _as_perspective(camera: Camera) -> Camera:
    """Near a wide camera, in the rational model's terms: where the fit begins.

    The numerator less the radius times the denominator is linear in the coefficients; divided by
    the denominator found before, it is the miss (Sanathanan and Koerner 1963).
    """
    angle = np.linspace(0.0, min(_WIDEST_RAD, invertible_rad(camera.optics)), _STEPS)[1:]
    r, seen = np.tan(angle), distorted_radius(camera.optics, angle)
    powers = np.stack([r**2, r**4, r**6], axis=1)
    rows = np.concatenate([r[:, None] * powers, -seen[:, None] * powers], axis=1)
    below, found = np.ones_like(r), np.zeros(len(_RATIONAL))
    for _ in range(_REWEIGHTED):
        scaled = rows / below[:, None]
        size = np.linalg.norm(scaled, axis=0)
        found = np.linalg.lstsq(scaled / size, (seen - r) / below, rcond=None)[0] / size
        below = np.abs(1.0 + powers @ found[3:])
    named = dict(zip(_RATIONAL, found.tolist(), strict=True))
    return replace(camera, wide=False, distortion=tuple(named.get(n, 0.0) for n in DISTORTION))


def _fitted(
    camera: Camera, names: Sequence[str], rays: FloatArray, pixels: FloatArray, weight: FloatArray
) -> Refit:
    first = dict(zip(DISTORTION, camera.distortion, strict=True))

    def with_numbers(x: FloatArray) -> Camera:
        alpha, beta, u0, v0 = (float(value) for value in x[:4])
        found = dict(zip(names, (float(value) for value in x[4:]), strict=True))
        return replace(
            camera, alpha_px=alpha, beta_px=beta, u0_px=u0, v0_px=v0,
            distortion=tuple(found.get(name, 0.0) for name in DISTORTION),
        )  # fmt: skip

    def off(x: FloatArray) -> FloatArray:
        return np.asarray(_seen(with_numbers(x), rays) - pixels)

    def weighted(x: FloatArray) -> FloatArray:
        return np.asarray((weight[:, None] * off(x)).ravel())

    start = np.array([camera.alpha_px, camera.beta_px, camera.u0_px, camera.v0_px,
                      *(first[name] for name in names)])  # fmt: skip
    found = least_squares(weighted, start, x_scale="jac", method="lm", xtol=1e-12, ftol=1e-12)
    length_px = np.linalg.norm(off(found.x), axis=1)
    rms = np.sqrt(np.average(length_px**2, weights=weight**2))
    return Refit(with_numbers(found.x), float(rms), float(length_px.max()))


def field(camera: Camera) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(P, 3) lines of sight over the picture, (P, 2) their pixels, (P,) roots of their areas.

    In each direction from the principal point out to the picture's edge, or to where the
    distortion folds.
    """
    width, height = camera.size_px("a refit")
    around = np.linspace(0.0, 2 * np.pi, _DIRECTIONS, endpoint=False)
    toward = np.stack([np.cos(around), np.sin(around)], axis=1)
    angle = np.linspace(0.0, min(_WIDEST_RAD, invertible_rad(camera.optics)), _STEPS)
    rays = _toward(toward[:, None], angle[None, :, None])
    pixels = _seen(camera, rays.reshape(-1, 3)).reshape(len(toward), _STEPS, 2)
    radius = np.linalg.norm(pixels - [camera.u0_px, camera.v0_px], axis=2)
    on_picture = (pixels >= -0.5) & (pixels <= [width - 0.5, height - 0.5])
    inside = np.asarray(np.all(on_picture, axis=2))
    chosen = []
    for direction, out, within in zip(toward, radius, inside, strict=True):
        grows = np.append(np.diff(out) > 0, False) & within
        last = max(int((~grows).argmax()), 1)
        at = np.interp(np.linspace(0.0, out[last - 1], _RADII + 1)[1:], out[:last], angle[:last])
        chosen.append(_toward(direction, at[:, None]))
    kept = np.concatenate(chosen)
    seen = _seen(camera, kept)
    weight = np.sqrt(np.linalg.norm(seen - [camera.u0_px, camera.v0_px], axis=1))
    return kept, seen, np.asarray(weight / weight.max())


def _toward(direction: FloatArray, angle_rad: FloatArray) -> FloatArray:
    """(..., 3) unit vectors that far off the axis in (..., 2) directions around it."""
    along = np.cos(angle_rad) + 0.0 * direction[..., :1]
    return np.concatenate([np.sin(angle_rad) * direction, along], axis=-1)


def _seen(camera: Camera, rays: FloatArray) -> FloatArray:
    return np.asarray(project(camera.optics[None], np.eye(4)[None], rays)[0])
