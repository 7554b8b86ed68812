"""A focal length that scatters from frame to frame, following nothing that was logged.

An autofocus that never ends in the same place is noise, but not the arm's: taken for the arm's it
is spread over all directions, too much across the optical axis and too little along it, and chance
then looks like physics. With a noise level of its own nothing is named for it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from calib.discovery.locate import Cell
from calib.discovery.residual_structure import ResidualStructure, is_shape_of_law
from calib.discovery.score import Score
from calib.distributions import chi2_tail

_WORTH = 30.0
"""A scatter must lower -2 log likelihood by this much; where there is none it is 3 at most."""

_WIDESPREAD = 0.3
"""The median error must be this share of the level (0.67 where all frames scatter): one frame that
is far off is no scatter."""

_GUESS = 1e-4


@dataclass(frozen=True)
class Scatter:
    """By which share of itself the focal length scatters, and what to report of it."""

    relative: float
    cell: Cell


def scattered(structure: ResidualStructure) -> Scatter | None:
    """How the focal length scatters in the best cell that was found; None where it does not.

    A field of shifts that is left in the pictures bends poses along the axis, too: beside one
    nothing can be concluded.
    """
    search = structure.search
    in_pictures = any(cell.is_field for cell in structure.cells)
    if in_pictures or not search.fitter.has_robot:
        return None
    fit = search.best.fit
    noise = replace(fit.noise, focal=_GUESS)
    tried = search.fitter.fit(fit.model, noise, fit.own_error, fit.weight)
    gain = fit.minus_two_log - tried.minus_two_log
    relative = tried.noise.focal
    if gain < _WORTH or float(np.median(np.abs(tried.own_error[:, 6]))) < _WIDESPREAD * relative:
        return None
    score = Score(gain, 1, 0.5 * chi2_tail(gain, 1), np.array([relative]))
    where = f"each frame by itself, {relative:.2g} of it RMS"
    cell = Cell("focal_length", "lens", "chance", score, 1, None, where)
    return None if is_shape_of_law(cell, search) else Scatter(relative, cell)
