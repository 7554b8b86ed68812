"""A field over picture or board that the residuals demand: its length scale, size and shape.

All else that the joint fit frees (camera, transforms, printed corners, each frame's own errors) is
integrated out by its normal equations, frame by frame; the field's waves have the prior widths of
a Gaussian process, whose length scale and size have the highest marginal likelihood.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from calib.chain.effect import Present
from calib.chain.laws.surface_field import (
    IMAGE,
    SURFACES,
    Estimate,
    Rectangle,
    Surface,
    present_field,
    rectangle,
    sides_of,
    surface_of,
)
from calib.chain.model import kinematics_of
from calib.chain.projection import project_with_jacobians
from calib.chain.state import ChainState
from calib.discovery.fields import FieldScore, field_scores
from calib.discovery.laws.cross_validation import folds
from calib.discovery.laws.frames import inverse_root
from calib.discovery.locate import Cell
from calib.discovery.search import Search
from calib.discovery.start import Fitter
from calib.solver.joint import JointFit, frame_errors
from calib.solver.unknowns import amounts, dependence, prior_information
from calib.views import BoolArray, FloatArray, Views

_LENGTHS = (0.06, 0.09, 0.13, 0.2, 0.3, 0.45)
"""Of the longer side."""

_SIZES = tuple(float(s) for s in np.geomspace(0.02, 20.0, 16))
"""Standard deviations of the process, as shares of what is usual there."""

_WORTH = 14.0
"""By which a field must lower -2 log likelihood, as a field of the arm must."""

_ALARM = 1e-6
"""Chance of a false alarm for a test of order six to be followed by an estimate."""

_ROUNDS = 3
"""Fits of all else around the field: noise and weights are estimated anew without it in them."""


@dataclass(frozen=True)
class SurfaceField:
    """A field, over what, and by how much it lowers -2 log marginal likelihood."""

    surface: Surface
    present: Present
    gain: float

    def cell(self, tested: FieldScore) -> Cell:
        """What was found to be left: the site, and how sure that is."""
        score = replace(tested.score, gain=self.gain)
        return Cell(
            site=tested.site,
            link=tested.link,
            covariate=tested.covariate,
            score=score,
            tried=1,
            curve=None,
            where=tested.where,
            law=self.present,
        )


@dataclass(frozen=True)
class _Normals:
    """Normal equations by fold, each frame's own errors integrated out, in units of the noise.

    Attributes
    ----------
    information, gradient:
        (K, T + B, T + B) and (K, T + B): T shared numbers, then B amounts of waves.
    prior, pull:
        (T, T) and (T,) of the shared numbers.
    over:
        The finest rectangle; coarser ones have the first so many of its waves.
    spread:
        (B, B) mean over the seen corners of the products of the waves' displacements.
    smooth:
        (C, B) what the camera's own numbers, or the board's pose, could do as well: the field has
        nothing of it.
    """

    information: FloatArray
    gradient: FloatArray
    prior: FloatArray
    pull: FloatArray
    over: Rectangle
    spread: FloatArray
    smooth: FloatArray

    def root(self, prior: FloatArray) -> FloatArray:
        """(B, B - C) whose product with its transpose is the prior's covariance."""
        q, _ = np.linalg.qr((self.smooth[:, : len(prior)] * prior).T, mode="complete")
        return np.asarray(prior[:, None] * q[:, len(self.smooth) :])

    def summed(self, waves: int, folds: BoolArray | None = None) -> tuple[FloatArray, FloatArray]:
        """Information and gradient of the shared numbers and the first `waves` amounts."""
        keep = len(self.prior) + waves
        chosen = slice(None) if folds is None else folds
        information = self.information[chosen, :keep, :keep].sum(axis=0)
        return information, self.gradient[chosen, :keep].sum(axis=0)

    def marginal(self, waves: int) -> tuple[FloatArray, FloatArray]:
        """The same of the amounts alone, the shared numbers integrated out."""
        information, gradient = self.summed(waves)
        t = len(self.prior)
        root = inverse_root(information[:t, :t] + self.prior)
        carried = root.T @ information[:t, t:]
        own = information[t:, t:] - carried.T @ carried
        return own, gradient[t:] - carried.T @ (root.T @ (gradient[:t] + self.pull))


def find_surface_field(fit: JointFit, views: Views, surface: Surface) -> SurfaceField | None:
    """The field that the residuals demand; None where left-out frames are better without it."""
    normals = _normals(fit, views, surface)
    best = _best(normals, views, surface)
    if best.gain < _WORTH or _left_out_gain(normals, best.prior) <= 0.0:
        return None
    return SurfaceField(surface, best.present, best.gain)


@dataclass(frozen=True)
class _Choice:
    """A length scale and size, the field with them, and its waves' prior widths."""

    gain: float
    present: Present
    prior: FloatArray


def _best(normals: _Normals, views: Views, surface: Surface) -> _Choice:
    """The field of the length scale and size that have the highest marginal likelihood."""
    tries = [
        (loss, share, size)
        for share in _LENGTHS
        for loss, size in _losses(normals, _prior(views, surface, share)[1])
    ]
    loss, share, size = min(tries)
    over, unit = _prior(views, surface, share)
    prior, many = unit * size, len(surface.components)
    information, gradient = normals.marginal(len(prior))
    root = normals.root(prior)
    inside = np.linalg.inv(root.T @ information @ root + np.eye(root.shape[1]))
    covariance = root @ inside @ root.T
    weights = covariance @ gradient
    spread = normals.spread[: len(prior), : len(prior)]
    rms = float(np.sqrt(weights @ spread @ weights))
    slope = spread @ weights / max(rms, 1e-300)
    length = share * max(over.sides)
    estimate = Estimate(
        weights=weights.reshape(-1, many),
        length_scale=length,
        length_scale_sigma=length * _log_sigma(tries),
        rms=rms,
        rms_sigma=float(np.sqrt(slope @ covariance @ slope)),
    )
    return _Choice(-loss, present_field(surface, over, estimate), prior)


def _prior(views: Views, surface: Surface, share: float) -> tuple[Rectangle, FloatArray]:
    """The waves for a length scale, and their prior widths for a field of usual size."""
    sides = sides_of(surface, views)
    length = share * max(sides)
    over = rectangle(sides, length, _finest(surface, views))
    widths = over.prior_sigma(length) * surface.components[0][1]
    return over, np.repeat(widths, len(surface.components))


def _losses(normals: _Normals, unit: FloatArray) -> list[tuple[float, float]]:
    """(-2 log marginal likelihood against no field, size) of every size."""
    information, gradient = normals.marginal(len(unit))
    root = normals.root(unit)
    value, vector = np.linalg.eigh(root.T @ information @ root)
    value = np.maximum(value, 0.0)
    along = (vector.T @ (root.T @ gradient)) ** 2
    return [
        (float((np.log1p(s**2 * value) - along * s**2 / (1.0 + s**2 * value)).sum()), s)
        for s in _SIZES
    ]


def _log_sigma(tries: list[tuple[float, float, float]]) -> float:
    """Sigma of the length scale's logarithm, from its marginal likelihood on the grid."""
    least = min(tries)[0]
    weight = np.array([np.exp(-0.5 * (loss - least)) for loss, _, _ in tries])
    place = np.log([share for _, share, _ in tries])
    middle = np.average(place, weights=weight)
    step = np.diff(np.log(_LENGTHS)).mean()
    return float(np.sqrt(np.average((place - middle) ** 2, weights=weight) + step**2 / 12.0))


def _left_out_gain(normals: _Normals, prior: FloatArray) -> float:
    """Fall of -2 log likelihood of the frames of each fold, the field from the other folds."""
    t, gained = len(normals.prior), 0.0
    root = normals.root(prior)
    into = block_diag(np.eye(t), root)
    own = block_diag(normals.prior, np.eye(root.shape[1]))
    every = np.arange(len(normals.gradient))
    for k in every:
        train, gradient = normals.summed(len(prior), every != k)
        out, pulled = normals.summed(len(prior), every == k)
        train, gradient = into.T @ train @ into + own, into.T @ gradient
        out, pulled = into.T @ out @ into, into.T @ pulled
        gradient[:t] += normals.pull
        for free, sign in ((len(train), 1.0), (t, -1.0)):
            root = inverse_root(train[:free, :free])
            step = root @ (root.T @ gradient[:free])
            gained += sign * float(2.0 * step @ pulled[:free] - step @ out[:free, :free] @ step)
    return gained


def _finest(surface: Surface, views: Views) -> tuple[int, int] | None:
    """The most half periods that the corners can distinguish."""
    return None if surface is IMAGE else (views.board.cols, views.board.rows)


def _normals(fit: JointFit, views: Views, surface: Surface) -> _Normals:
    bare = fit.model.with_effects(_blank(p, surface) for p in fit.model.effects)
    found = dependence(
        bare,
        views,
        fit.unknowns,
        kinematics=kinematics_of(views),
        errors=frame_errors(fit.own_error),
    )
    sides = sides_of(surface, views)
    over = rectangle(sides, _LENGTHS[0] * max(sides), _finest(surface, views))
    corners = fit.equations.corner_numbers
    fold = folds(len(views))
    parts = []
    for k in np.unique(fold):
        frames = np.flatnonzero(fold == k)
        state = _of(found.state, views, frames)
        pixels, j_pose, j_optics = project_with_jacobians(
            state.optics, state.camera_from_board, state.points_m
        )
        by = np.concatenate([j_optics[..., list(found.active)], j_pose], axis=3)
        j_point = j_pose[..., :3] @ state.camera_from_board[:, None, :3, :3]
        local = found.local[frames]
        shared = by @ local[:, None, : by.shape[3]]
        if len(found.modes):
            moved = np.einsum("nmcl,bml->nmcb", j_point, found.modes)
            shared += moved @ local[:, None, by.shape[3] :]
        waves = _waves(surface, over, state.views, j_point)
        columns = [shared, *([_print(j_point)] if corners else []), waves]
        residual = state.straightened(state.views.corners_px) - pixels
        own = by @ found.own[frames][:, None]
        parts.append(_frames(fit, frames, own, np.concatenate(columns, axis=3), residual))
    information, gradient = (np.array(part) for part in zip(*parts, strict=True))
    at = np.concatenate([amounts(bare, fit.unknowns), fit.equations.corner_shift[:corners]])
    printed = fit.noise.print_m**-2.0 if corners else 0.0
    prior = block_diag(prior_information(fit.unknowns), printed * np.eye(corners))
    place = views.corners_px[views.seen] if surface is IMAGE else views.board.corners_m[:, :2]
    functions = over.functions(place)
    products = functions.T @ functions / len(place)
    spread = np.asarray(np.kron(products, np.eye(len(surface.components))), dtype=np.float64)
    smooth = _smooth(surface, place, sides).reshape(len(place), -1, len(surface.components))
    alike = np.einsum("pcd,pw->cwd", smooth, functions).astype(np.float64)
    return _Normals(
        information, gradient, prior, -prior @ at, over, spread, alike.reshape(len(alike), -1)
    )


def _smooth(surface: Surface, place: FloatArray, sides: tuple[float, float]) -> FloatArray:
    """(P, C, D) displacements that other numbers of the cell make: affine, turned, radial."""
    x, y = (2.0 * place / np.array(sides) - 1.0).T
    affine = np.stack([np.ones_like(x), x, y], axis=1)
    if surface is not IMAGE:
        return affine[:, :, None]
    away = 2.0 * (place - 0.5 * np.array(sides)) / max(sides)
    square = (away**2).sum(axis=1)[:, None]
    shifted = np.eye(2)[None].repeat(len(place), axis=0)
    stretched = away[:, :, None] * np.eye(2)
    rolled = away[:, None, ::-1] * [-1.0, 1.0]
    turned = np.stack([away * away[:, :1], away * away[:, 1:]], axis=1)
    radial = np.stack([away * square, away * square**2], axis=1)
    return np.concatenate([shifted, stretched, rolled, turned, radial], axis=1)


def _blank(present: Present, surface: Surface) -> Present:
    """The effect, without amounts if it is the field over that surface."""
    if surface_of(present) is not surface:
        return present
    roles = [p.role for p in present.effect.parameters]
    return replace(
        present, values=np.where([role == "amount" for role in roles], 0.0, present.values)
    )


def _of(state: ChainState, views: Views, frames: NDArray[np.int64]) -> ChainState:
    """The chain's end state of some frames."""
    return replace(
        state,
        views=views.take(frames),
        optics=state.optics[frames],
        camera_from_board=state.camera_from_board[frames],
    )


def _waves(surface: Surface, over: Rectangle, views: Views, j_point: FloatArray) -> FloatArray:
    """(N, M, 2, B) of the pixels by the field's amounts."""
    if surface is IMAGE:
        functions = over.functions(views.corners_px)
        both = functions[:, :, None, :, None] * np.eye(2)[:, None, :]
        return np.asarray(both.reshape(*functions.shape[:2], 2, -1))
    heights = over.functions(views.board.corners_m[:, :2])
    return np.asarray(j_point[..., 2:3] * heights[None, :, None, :])


def _print(j_point: FloatArray) -> FloatArray:
    """(N, M, 2, 2 M) of the pixels by each printed corner's own shift."""
    n, m = j_point.shape[:2]
    columns = np.zeros((n, m, 2, m, 2))
    every = np.arange(m)
    columns[:, every, :, every] = np.swapaxes(j_point[..., :2], 0, 1)
    return columns.reshape(n, m, 2, 2 * m)


def _frames(
    fit: JointFit,
    frames: NDArray[np.int64],
    own: FloatArray,
    columns: FloatArray,
    residual: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Information and gradient of the columns, the frames' own errors integrated out."""
    n, m = fit.weight[frames].shape
    scale = np.sqrt(fit.weight[frames])[:, :, None, None] / fit.noise.corner_px
    own = (own * scale).reshape(n, 2 * m, -1)
    rows = (columns * scale).reshape(n, 2 * m, -1)
    right = (np.nan_to_num(residual)[..., None] * scale).reshape(n, 2 * m, 1)
    own_t = np.swapaxes(own, 1, 2)
    prior = fit.noise.own_information
    cross = own_t @ rows
    pulled = own_t @ right - (fit.own_error[frames] @ prior)[..., None]
    back = np.linalg.solve(own_t @ own + prior, np.concatenate([cross, pulled], axis=2))
    flat, b = rows.reshape(-1, rows.shape[2]), rows.shape[2]
    turned = cross.reshape(-1, b).T
    information = flat.T @ flat - turned @ back[..., :b].reshape(-1, b)
    gradient = flat.T @ right.ravel() - turned @ back[..., b].ravel()
    return 0.5 * (information + information.T), gradient


def demanded_field(search: Search) -> tuple[SurfaceField, Cell] | None:
    """The field that the best cell so far demands, with its cell; none that it has already."""
    fit, views = search.best.fit, search.views
    known = [surface_of(p) for p in fit.model.effects]
    reported = []
    for tested in field_scores(fit, views):
        surface = next(s for s in SURFACES if s.site == tested.site)
        if surface in known or tested.score.p_value > _ALARM:
            continue
        found = find_surface_field(fit, views, surface)
        if found is not None:
            reported.append((found, found.cell(tested)))
    return max(reported, key=lambda one: one[0].gain, default=None)


def field_leads(search: Search) -> Cell | None:
    """Put in a field that explains more of the cell as it is than any name does; its cell."""
    reported = demanded_field(search)
    if reported is None or reported[0].gain < search.promised(search.best.fit):
        return None
    put_in(search, reported[0])
    return reported[1]


def put_in(search: Search, found: SurfaceField) -> None:
    """Put a field into the cell, in place of another over the same surface."""
    known = search.best.fit.model.effects
    rest = tuple(p for p in known if surface_of(p) is not found.surface)
    before = search.best.fit
    fit = search.fitter.with_effects(before, (*rest, found.present))
    gained = before.minus_two_log - fit.minus_two_log
    search.prices[found.present.effect.label] = max(gained - found.gain, 0.0)
    search.go_on_from(fit)
    for _ in range(_ROUNDS - 1):
        search.go_on_from(fields_anew(search.fitter, search.best.fit))


def fields_anew(fitter: Fitter, fit: JointFit) -> JointFit:
    """The fit with every field over a surface estimated anew from its frames."""
    for at, present in enumerate(fit.model.effects):
        surface = surface_of(present)
        if surface is None:
            continue
        anew = _best(_normals(fit, fitter.views, surface), fitter.views, surface).present
        effects = fit.model.effects
        fit = fitter.with_effects(fit, (*effects[:at], anew, *effects[at + 1 :]))
    return fit
