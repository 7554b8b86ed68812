"""Whether what all frames together ask for is more than how differently single frames ask for it.

A likelihood takes corners for independent and every frame for equally good. Where corners of one
picture err alike, or far frames err more, chance looks like structure; how the frames' own
contributions spread says how much of it is chance, whatever the cause.
"""

from __future__ import annotations

import numpy as np

from calib.discovery.fields import frame_scores
from calib.discovery.laws.frames import frame_blocks, inverse_root
from calib.discovery.locate import Cell
from calib.solver.joint import JointFit
from calib.views import FloatArray, Views

_STANDS_OUT = 3.5
"""In standard errors; structure that a quarter of 24 frames share reaches 4."""


def stands_out(fit: JointFit, views: Views, cell: Cell) -> bool:
    """Whether different frames agree on a curve or a field, beyond what each asks for by itself.

    The products of the scores of different frames are zero on average where nothing is there,
    however large and however alike within a frame the errors are.
    """
    if cell.is_field:
        scores = frame_scores(fit, views, cell.site)
    elif cell.curve is not None:
        scores = _frame_scores(fit, views, cell)
    else:
        return True
    products = scores @ scores.T
    np.fill_diagonal(products, 0.0)
    chance = float(np.sqrt(2.0 * (products**2).sum()))
    return float(products.sum()) > _STANDS_OUT * chance


def _frame_scores(fit: JointFit, views: Views, cell: Cell) -> FloatArray:
    """(N, R) score of each frame for the curve, all that is fitted projected out, whitened."""
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
    information, _ = blocks.base()
    root = inverse_root(information)
    through = root.T @ cross.reshape(t, columns)
    scores = raw - blocks.gradient[:, :t] @ root @ through
    own = own.reshape(columns, columns) - through.T @ through
    return np.asarray(scores @ inverse_root(own))
