"""Whether what all frames together ask for is more than how differently single frames ask for it.

A likelihood takes corners for independent and every frame for equally good. Where corners of one
picture err alike, or far frames err more, chance looks like structure; how the frames' own
contributions spread says how much of it is chance, whatever the cause.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.discovery.fields import frame_scores
from calib.discovery.laws.frames import frame_blocks, inverse_root
from calib.discovery.locate import Cell
from calib.distributions import f_tail
from calib.solver.joint import JointFit
from calib.views import FloatArray, Views

_STANDS_OUT = 3.5
"""In standard errors; structure that a quarter of 24 frames share reaches 4."""


def stands_out(fit: JointFit, views: Views, cell: Cell, least: float = 1.0) -> bool:
    """Whether different frames agree on a curve or a field, beyond what each asks for by itself.

    The products of the scores of different frames are zero on average where nothing is there,
    however large and however alike within a frame the errors are. And of a curve the gain must be
    that improbable (`least`) in units of how far the frames scatter about the curve.
    """
    if cell.is_field:
        return _agree(frame_scores(fit, views, cell.site))
    if cell.curve is None:
        return True
    asked = _asked(fit, views, cell)
    return asked.p_value < least and _agree(asked.scores)


def _agree(scores: FloatArray) -> bool:
    """Whether the (N, R) scores of different frames have one direction in common."""
    products = scores @ scores.T
    np.fill_diagonal(products, 0.0)
    chance = float(np.sqrt(2.0 * (products**2).sum()))
    return float(products.sum()) > _STANDS_OUT * chance


@dataclass(frozen=True)
class _Asked:
    """What the frames ask of a curve.

    Attributes
    ----------
    scores:
        (N, R) score of each frame, all that is fitted projected out, whitened.
    p_value:
        Of the curve's gain, judged by how far the frames scatter about the curve: corners of one
        picture that err alike move a frame's part of a site further than their number says.
    """

    scores: FloatArray
    p_value: float


def _asked(fit: JointFit, views: Views, cell: Cell) -> _Asked:
    assert cell.curve is not None
    blocks = frame_blocks(fit, views)
    t, n = blocks.shared, len(views)
    members = [t + k for k, c in enumerate(blocks.components) if c.site.name == cell.site]
    functions = cell.curve.functions(blocks.state)
    columns = functions.shape[1] * len(members)
    cross = np.einsum("nb,nts->tbs", functions, blocks.information[:, :t, members])
    own = np.einsum(
        "nb,nc,nsr->bscr",
        functions,
        functions,
        blocks.information[:, members][:, :, members],
        optimize=True,
    )
    raw = np.einsum("nb,ns->nbs", functions, blocks.gradient[:, members]).reshape(n, columns)
    information, gradient = blocks.base()
    root = inverse_root(information)
    through = root.T @ cross.reshape(t, columns)
    white = inverse_root(own.reshape(columns, columns) - through.T @ through)
    scores = (raw - blocks.gradient[:, :t] @ root @ through) @ white
    total = raw.sum(axis=0) - through.T @ (root.T @ gradient)
    amounts = white @ (white.T @ total)
    base = root @ (root.T @ gradient - through @ amounts)
    moved = functions @ amounts.reshape(functions.shape[1], len(members))
    site = blocks.information[:, members][:, :, members]
    left = blocks.gradient[:, members] - np.einsum("nsr,nr->ns", site, moved)
    left -= np.einsum("nts,t->ns", blocks.information[:, :t, members], base)
    square = np.einsum("ns,nsr,nr->n", left, np.linalg.pinv(site, hermitian=True), left)
    rank = white.shape[1]
    freedom = max(n * len(members) - rank, 1)
    scatter = max(float(square.sum()) / freedom, 1.0)
    gain = float(np.sum((white.T @ total) ** 2))
    return _Asked(scores, f_tail(gain / rank / scatter, rank, freedom))
