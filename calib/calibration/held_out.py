"""How well a fit predicts frames it never saw, against what it says of itself.

From the robot's pose as logged, a corner misses by its own noise, by the robot's scatter and by
the fit's uncertainty. In units of these together the misses of all corners make a chi square. Part
of it is of what the pictures show whatever the robot does; the rest, given that, is of the six
numbers a frame that a free pose would absorb.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.chain.model import CellModel, Errors, kinematics_of
from calib.distributions import chi2_limit
from calib.solver.each_frame import EachFrame, each_frame
from calib.solver.elimination import solve_scaled
from calib.solver.joint import JointFit, fit_joint
from calib.solver.unknowns import dependence
from calib.views import FloatArray, Views

_BAND = 0.005
"""Chance on either side of the band."""


@dataclass(frozen=True)
class ChiSquare:
    """Squared misses in units of what is expected of them, and how many independent ones."""

    total: float
    freedom: float

    def __add__(self, other: ChiSquare) -> ChiSquare:
        return ChiSquare(self.total + other.total, self.freedom + other.freedom)

    def __sub__(self, other: ChiSquare) -> ChiSquare:
        return ChiSquare(self.total - other.total, self.freedom - other.freedom)

    @property
    def each(self) -> float:
        """Per degree of freedom: one where the stated uncertainty is true."""
        return self.total / self.freedom

    @property
    def band(self) -> tuple[float, float]:
        """Where `each` lies 99 times in a hundred, or more often, if it is."""
        low, high = (chi2_limit(tail, self.freedom) for tail in (1.0 - _BAND, _BAND))
        return low / self.freedom, high / self.freedom


@dataclass(frozen=True)
class HeldOut:
    """Frames that had no say in the fit that predicts them.

    Attributes
    ----------
    corners:
        How many, each counted by its weight.
    square_px2, expected_px2, variance_px4:
        Square sum of the corners' misses from the logged poses; mean and variance that it would
        have.
    robot, picture:
        Of the six numbers a frame that a free pose absorbs, and of the rest of the pictures.
    """

    corners: float
    square_px2: float
    expected_px2: float
    variance_px4: float
    robot: ChiSquare
    picture: ChiSquare

    def __add__(self, other: HeldOut) -> HeldOut:
        return HeldOut(**{name: value + getattr(other, name) for name, value in vars(self).items()})

    @property
    def miss(self) -> ChiSquare:
        """Of the square sum; its freedom is that of a chi square as wide (Satterthwaite 1946)."""
        freedom = 2.0 * self.expected_px2**2 / self.variance_px4
        return ChiSquare(self.square_px2 / self.expected_px2 * freedom, freedom)

    @property
    def rms_px(self) -> float:
        """RMS distance of a corner from where the fit and the logged pose put it."""
        return float(np.sqrt(self.square_px2 / self.corners))

    @property
    def expected_px(self) -> float:
        """The same as corner noise, the robot's scatter and the fit's uncertainty would make it."""
        return float(np.sqrt(self.expected_px2 / self.corners))


def frame_by_frame(
    fit: JointFit, model: CellModel, views: Views, weight: FloatArray, flange_error: FloatArray
) -> EachFrame:
    """Views linearised at a cell, in a fit's unknowns and by its corner noise.

    Parameters
    ----------
    fit, model:
        Whose unknowns and noise; where the chain is linearised.
    views, weight, flange_error:
        N views, (N, M) what each corner counts, (N, 6) the flange's errors that are put in.
    """
    arm = kinematics_of(views)
    found = dependence(model, views, fit.unknowns, kinematics=arm, errors=Errors(flange_error))
    return each_frame(found, views.corners_px, weight / fit.noise.corner_px**2, flange_error)


def judge(fit: JointFit, views: Views, weight: FloatArray) -> HeldOut:
    """Hold N views, with (N, M) corner weights, against a fit that had none of them."""
    noise, numbers = fit.noise, 2.0 * float(weight.sum())
    logged = frame_by_frame(fit, fit.model, views, weight, np.zeros((len(views), 6)))
    expected, variance = _logged_square(logged, fit, numbers)
    posed = fit_joint(fit.model, views, (), noise, rounds=1, fixed_noise=True, weight=weight)
    frames = frame_by_frame(fit, fit.model, views, weight, posed.flange_error)
    whole = _square(frames.marginal(noise.flange_information), fit.covariance)
    free = _square(frames.marginal(np.zeros((6, 6))), fit.covariance)
    picture = ChiSquare(free, numbers - 6.0 * len(views))
    return HeldOut(
        corners=float(weight.sum()),
        square_px2=float(logged.shared[:, -1, -1].sum()) * noise.corner_px**2,
        expected_px2=expected * noise.corner_px**2,
        variance_px4=variance * noise.corner_px**4,
        robot=ChiSquare(whole, numbers) - picture,
        picture=picture,
    )


def _logged_square(logged: EachFrame, fit: JointFit, numbers: float) -> tuple[float, float]:
    """Mean and variance of the square sum of misses from logged poses, by corner noise.

    The misses' covariance has one for each number, and what the robot and the fit add to that.
    """
    by_robot = logged.own @ np.linalg.inv(fit.noise.flange_information)
    by_fit = logged.shared[:, :-1, :-1].sum(axis=0) @ fit.covariance
    added = float(np.trace(by_robot, axis1=1, axis2=2).sum() + np.trace(by_fit))
    squared = np.einsum("nij,nji->", by_robot, by_robot) + np.einsum("ij,ji->", by_fit, by_fit)
    return numbers + added, 2.0 * (numbers + 2.0 * added + float(squared))


def _square(marginal: FloatArray, covariance: FloatArray) -> float:
    """Square sum of all the frames' residuals by their noise and the shared numbers' covariance."""
    p = len(covariance)
    total = marginal.sum(axis=0)
    _, known, _ = solve_scaled(covariance, np.zeros(p))
    step, _, _ = solve_scaled(total[:p, :p] + known, total[:p, p])
    return float(total[p, p] - total[:p, p] @ step)
