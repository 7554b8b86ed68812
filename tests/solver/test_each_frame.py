"""Frame by frame, the equations are those of the whole fit."""

import numpy as np

from calib.chain.model import Errors
from calib.solver.each_frame import each_frame
from calib.solver.joint import JointFit, fit_joint
from calib.solver.noise import Noise, scaled
from calib.solver.unknowns import dependence, prior_information
from calib.views import Views
from tests.calibration.fitted import fitted


def _apart(fit: JointFit, views: Views) -> tuple[np.ndarray, np.ndarray]:
    """Marginal equations with the flange at the fit's errors, and with it free."""
    found = dependence(
        fit.model, views, fit.unknowns, kinematics=None, errors=Errors(fit.flange_error)
    )
    weight = fit.weight / fit.noise.corner_px**2
    frames = each_frame(found, views.corners_px, weight, fit.flange_error)
    return frames.marginal(fit.noise.flange_information), frames.marginal(np.zeros((6, 6)))


def test_the_frames_sum_up_to_the_fit() -> None:
    fit, views = fitted(seed=3)
    reduced, _ = scaled(fit.equations, fit.noise)
    known, _ = _apart(fit, views)
    total = known.sum(axis=0)
    p = len(fit.unknowns)
    prior = prior_information(fit.unknowns)
    scale = np.sqrt(np.diag(reduced.shared))
    shared = (total[:p, :p] + prior - reduced.shared) / scale / scale[:, None]
    assert np.abs(shared).max() < 1e-6
    score = total[:p, p] - prior @ fit.equations.amount - reduced.shared_residual
    assert np.abs(score / scale).max() < 1e-6
    square = total[p, p] + float(fit.equations.amount @ prior @ fit.equations.amount)
    assert np.isclose(square, reduced.square_sum, rtol=1e-6)


def test_a_frame_of_its_own_is_the_fit_without_the_others() -> None:
    # with the flange free, its log has no say
    fit, views = fitted(seed=3)
    _, free = _apart(fit, views)
    loose = Noise(fit.noise.corner_px, 10.0, 10.0)
    one = views.take(np.array([4]))
    again = fit_joint(fit.model, one, (), loose, rounds=1, fixed_noise=True)
    square = float(np.nansum(again.residual_px**2)) / fit.noise.corner_px**2
    assert np.isclose(free[4, -1, -1], square, rtol=1e-3)
