"""What each frame says of every site of the chain, so that any law costs a few products only.

Once each frame's own errors have been integrated out, a frame's log likelihood is a quadratic form
in the shared numbers of the fit and in what every site of the chain does in that frame. A law
makes the latter a function of covariates times an amount: information and score of any law, and
of any set of frames, are sums of products of these blocks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from calib.chain.covariates import CONSTANT
from calib.chain.empirical import Curve, Site, present_curve, site_columns
from calib.chain.model import evaluate
from calib.chain.state import ChainState
from calib.discovery.score import extended
from calib.solver.accumulate import LocalEquations, local_equations
from calib.solver.joint import JointFit, frame_errors
from calib.solver.unknowns import Dependence, amounts, prior_information
from calib.views import BoolArray, FloatArray, Views


@dataclass(frozen=True)
class Component:
    """One number of one site."""

    site: Site
    index: int

    @property
    def typical(self) -> float:
        """Its usual size."""
        return self.site.components[self.index][2]


@dataclass(frozen=True)
class FrameBlocks:
    """Quadratic forms of N frames in T shared numbers of the fit and S components of sites.

    Attributes
    ----------
    components:
        The S components, in units of their usual size.
    state:
        The state of the fit.
    information, gradient:
        (N, T + S, T + S) and (N, T + S), corner noise and the frames' own errors accounted for.
    prior, pull:
        (T, T) inverse covariance of the shared numbers' priors, and (T,) their gradient.
    pixel_information, pixel_gradient, pixel_square, corners:
        (N, T + S, T + S), (N, T + S), (N,) and (N,): the same form of the squared distances (px) of
        the corners from where the log alone has them, its constant, and the corners' weights.
    """

    components: tuple[Component, ...]
    state: ChainState
    information: FloatArray
    gradient: FloatArray
    prior: FloatArray
    pull: FloatArray
    pixel_information: FloatArray
    pixel_gradient: FloatArray
    pixel_square: FloatArray
    corners: FloatArray

    @property
    def shared(self) -> int:
        """T, how many numbers of the fit are shared."""
        return len(self.pull)

    def base(self, frames: BoolArray | None = None) -> tuple[FloatArray, FloatArray]:
        """(T, T) information and (T,) gradient of the shared numbers from some frames."""
        t = self.shared
        information, gradient = self.information[:, :t, :t], self.gradient[:, :t]
        if frames is not None:
            information, gradient = information[frames], gradient[frames]
        return information.sum(axis=0) + self.prior, gradient.sum(axis=0) + self.pull


def frame_blocks(fit: JointFit, views: Views) -> FrameBlocks:
    """Linearise every site of the chain around a fit, frame by frame."""
    state = evaluate(fit.model, views, errors=frame_errors(fit.own_error))
    sites = site_columns(views)
    presents = [present_curve(Curve(site, CONSTANT, 0.0, 1.0), state) for site in sites]
    _, found, _, base = extended(fit, views, presents)
    components = tuple(Component(s, k) for s in sites for k in range(len(s.components)))
    columns = found.local[:, :, base:] * np.array([c.typical for c in components])
    mapping = np.concatenate([found.local[:, :, :base], columns], axis=2)
    raw = _raw(fit, views, found, mapping)
    information, gradient = _marginal(fit, raw)
    corners = fit.equations.corner_numbers
    order = _corners_first(base, len(components), corners)
    prior, pull = _priors(fit)
    return FrameBlocks(
        components=components,
        state=state,
        information=information[:, order][:, :, order],
        gradient=gradient[:, order],
        prior=prior,
        pull=pull,
        pixel_information=raw.shared[:, order][:, :, order],
        pixel_gradient=raw.gradient[:, order]
        + np.einsum("nfp,nf->np", raw.cross[:, :, order], fit.own_error),
        pixel_square=_unmoved_square(raw, fit.own_error),
        corners=fit.weight.sum(axis=1),
    )


def _corners_first(base: int, sites: int, corners: int) -> list[int]:
    """Order in which the printed corners' shifts stand behind the fit's other numbers."""
    after = base + sites
    return [*range(base), *range(after, after + corners), *range(base, after)]


@dataclass(frozen=True)
class FrameNormals:
    """Normal equations of each frame, in its own F numbers and T shared ones, in pixels.

    Attributes
    ----------
    own, cross, own_residual, shared, gradient:
        (N, F, F), (N, F, T), (N, F), (N, T, T), (N, T).
    prior, pull:
        As in `FrameBlocks`.
    """

    own: FloatArray
    cross: FloatArray
    own_residual: FloatArray
    shared: FloatArray
    gradient: FloatArray
    prior: FloatArray
    pull: FloatArray


def frame_normals(fit: JointFit, views: Views) -> FrameNormals:
    """The equations of a fit, frame by frame."""
    raw = _raw(fit, views, fit.dependence, fit.dependence.local)
    prior, pull = _priors(fit)
    return FrameNormals(raw.own, raw.cross, raw.own_residual, raw.shared, raw.gradient, prior, pull)


def _priors(fit: JointFit) -> tuple[FloatArray, FloatArray]:
    """(T, T) inverse covariance of the shared numbers' priors, and (T,) their gradient."""
    corners = fit.equations.corner_numbers
    print_information = fit.noise.print_m**-2.0 if corners else 0.0
    prior = block_diag(prior_information(fit.unknowns), print_information * np.eye(corners))
    at = np.concatenate([amounts(fit.model, fit.unknowns), fit.equations.corner_shift])
    return prior, -prior @ at


@dataclass(frozen=True)
class _Raw:
    """Normal equations of each frame, in its own F numbers and P others, in pixels."""

    own: FloatArray
    cross: FloatArray
    own_residual: FloatArray
    shared: FloatArray
    gradient: FloatArray
    square: FloatArray


def _unmoved_square(raw: _Raw, own_error: FloatArray) -> FloatArray:
    """(N,) squared misfit of frames whose own errors are not known."""
    moved = np.einsum("nf,nfg,ng->n", own_error, raw.own, own_error)
    return np.asarray(raw.square + 2.0 * np.einsum("nf,nf->n", own_error, raw.own_residual) + moved)


def _marginal(fit: JointFit, raw: _Raw) -> tuple[FloatArray, FloatArray]:
    """(N, P, P) information and (N, P) gradient with each frame's own errors integrated out."""
    scale = fit.noise.corner_px**-2.0
    prior = fit.noise.own_information
    inverse = np.linalg.inv(raw.own * scale + prior)
    pulled = raw.own_residual * scale - fit.own_error @ prior
    back = inverse @ (raw.cross * scale)
    information = raw.shared * scale - np.swapaxes(raw.cross, 1, 2) @ back * scale
    gradient = raw.gradient * scale - np.einsum("nfp,nf->np", back, pulled)
    return 0.5 * (information + np.swapaxes(information, 1, 2)), gradient


def _raw(fit: JointFit, views: Views, found: Dependence, mapping: FloatArray) -> _Raw:
    state, with_corners = found.state, bool(fit.equations.corner_numbers)
    local = local_equations(
        state.optics,
        state.camera_from_board,
        state.points_m,
        state.straightened(views.corners_px),
        fit.weight,
        found.active,
        found.modes,
        corners=with_corners,
    )
    gram, followed = local.gram, found.own.shape[1]
    mapped = gram[:, :-1, :-1] @ mapping
    own_t = np.swapaxes(found.own, 1, 2)
    own = own_t @ gram[:, :followed, :followed] @ found.own
    cross = own_t @ mapped[:, :followed]
    cross_residual = (own_t @ gram[:, :followed, -1:])[:, :, 0]
    shared = np.swapaxes(mapping, 1, 2) @ mapped
    gradient = np.einsum("nqp,nq->np", mapping, gram[:, :-1, -1])
    if with_corners:
        shared, gradient, cross = _corner_rows(local, found, mapping, shared, gradient, cross)
    return _Raw(own, cross, cross_residual, shared, gradient, gram[:, -1, -1])


def _corner_rows(
    local: LocalEquations,
    found: Dependence,
    mapping: FloatArray,
    shared: FloatArray,
    gradient: FloatArray,
    cross: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The same with each printed corner's own shift behind the other numbers."""
    assert local.own is not None
    assert local.cross is not None
    n, m = local.own.shape[:2]
    p, followed = mapping.shape[2], found.own.shape[1]
    rows = local.cross.reshape(n, 2 * m, -1)
    by_corner = np.einsum("ncq,nqp->npc", rows[:, :, :-1], mapping, optimize=True)
    whole = np.zeros((n, p + 2 * m, p + 2 * m))
    whole[:, :p, :p] = shared
    whole[:, :p, p:] = by_corner
    whole[:, p:, :p] = np.swapaxes(by_corner, 1, 2)
    at = p + 2 * np.arange(m)
    for i in range(2):
        for j in range(2):
            whole[:, at + i, at + j] = local.own[:, :, i, j]
    own_corner = np.einsum("nqk,ncq->nkc", found.own, rows[:, :, :followed])
    return (
        whole,
        np.concatenate([gradient, rows[:, :, -1]], axis=1),
        np.concatenate([cross, own_corner], axis=2),
    )


def inverse_root(information: FloatArray) -> FloatArray:
    """(T, R) matrix whose product with its own transpose is the (pseudo-)inverse."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(information), 1e-300))
    value, vector = np.linalg.eigh(information * scale[:, None] * scale[None, :])
    kept = value > 1e-10 * max(float(value[-1]), 1e-300)
    return np.asarray(scale[:, None] * vector[:, kept] / np.sqrt(value[kept]))
