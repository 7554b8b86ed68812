"""The fit to be expected of views that have not been taken."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib.chain.effect import Present
from calib.chain.model import CellModel
from calib.solver.elimination import solve_scaled
from calib.solver.noise import Noise
from calib.solver.pose_information import PoseInformation, pose_information
from calib.solver.unknowns import Unknown
from calib.views import FloatArray, Views


@dataclass(frozen=True)
class Expected:
    """A joint fit's cell, its p free numbers and their covariance, before there is any picture.

    Attributes
    ----------
    model, unknowns:
        Where the chain is linearised, and what will be free.
    covariance:
        (p, p).
    """

    model: CellModel
    unknowns: tuple[Unknown, ...]
    covariance: FloatArray

    @classmethod
    def of(cls, model: CellModel, lens: Sequence[Present], found: PoseInformation) -> Expected:
        """What the views with that information will give; `lens` is fitted as well."""
        _, covariance, _ = solve_scaled(found.total, np.zeros(len(found.unknowns)))
        return cls(model.with_effects((*model.effects, *lens)), found.unknowns, covariance)


def expect(model: CellModel, lens: Sequence[Present], views: Views, noise: Noise) -> Expected:
    """The joint fit to be expected.

    Parameters
    ----------
    model, lens:
        The cell, and the effects that are fitted as well.
    views:
        The log; corners are not looked at. There must be enough of them to fix every number.
    noise:
        Of corners and flange.
    """
    return Expected.of(model, lens, pose_information(model, views, lens, noise))
