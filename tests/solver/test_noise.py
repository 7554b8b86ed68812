"""Noise levels: the likelihood's derivatives, and its maximum in few evaluations."""

from dataclasses import astuple, fields, replace

import numpy as np
import pytest

from calib.solver import noise as module
from calib.solver.elimination import FrameEquations
from calib.solver.noise import JointEquations, Noise, estimate_noise, profile

FRAMES, SHARED = 12, 5
LEVELS = Noise(0.2, 3e-4, 2e-4, 2e-5, 1e-4)


def _equations(corners: int, own: int, seed: int = 3) -> JointEquations:
    """Data of a mixed model with the levels above, at an estimate that is a little off."""
    random = np.random.default_rng(seed)
    rows = 90
    sizes = np.sqrt(
        np.diag(replace(LEVELS, focal=0.0 if own == 6 else LEVELS.focal).own_information)
    )
    of_own = random.normal(size=(FRAMES, rows, own)) * sizes * 0.1
    of_shared = random.normal(size=(FRAMES, rows, SHARED + corners))
    of_shared[..., SHARED:] /= LEVELS.print_m
    own_truth = random.normal(size=(FRAMES, own)) / sizes
    shift = random.normal(size=corners) * LEVELS.print_m
    residual = np.einsum("nrk,nk->nr", of_own, own_truth)
    residual += (
        of_shared[..., SHARED:] @ shift + random.normal(size=(FRAMES, rows)) * LEVELS.corner_px
    )
    frames = FrameEquations(
        own=np.einsum("nri,nrj->nij", of_own, of_own),
        own_shared=np.einsum("nri,nrj->nij", of_own, of_shared),
        own_residual=np.einsum("nri,nr->ni", of_own, residual),
        shared=np.einsum("nri,nrj->ij", of_shared, of_shared),
        shared_residual=np.einsum("nri,nr->i", of_shared, residual),
        square_sum=float(np.sum(residual**2)),
    )
    return JointEquations(
        frames=frames,
        own_error=0.1 * own_truth,
        corner_shift=0.1 * shift,
        amount=random.normal(size=SHARED) * 0.01,
        amount_information=np.diag([0.0, 0.0, 4.0, 0.0, 100.0]),
        corner_numbers=corners,
        observations=float(FRAMES * rows),
    )


@pytest.mark.parametrize("restricted", [True, False])
@pytest.mark.parametrize("corners", [0, 8])
@pytest.mark.parametrize("own", [6, 7])
def test_the_slope_is_that_of_the_likelihood(restricted: bool, corners: int, own: int) -> None:
    equations = _equations(corners, own)
    at = replace(
        LEVELS, print_m=LEVELS.print_m if corners else 0.0, focal=LEVELS.focal if own == 7 else 0.0
    )
    found, integrated = module._profile(equations, at, restricted)
    slope = module._slope(equations, at, found, integrated)
    for name in (f.name for f in fields(Noise) if getattr(at, f.name) > 0.0):
        ends = [
            profile(
                equations,
                replace(at, **{name: getattr(at, name) * np.exp(step)}),
                restricted=restricted,
            ).minus_two_log
            for step in (-1e-4, 1e-4)
        ]
        assert slope[name] == pytest.approx((ends[1] - ends[0]) / 2e-4, rel=1e-4, abs=1e-3)


def test_the_maximum_is_found_in_few_evaluations(monkeypatch: pytest.MonkeyPatch) -> None:
    equations, asked = _equations(8, 7), []
    whole = module._profile

    def counted(*arguments: object) -> object:
        asked.append(arguments)
        return whole(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(module, "_profile", counted)
    found, least = estimate_noise(equations, Noise(1.0, 1e-3, 1e-3, 1e-4, 1e-3))
    assert len(asked) < 30
    assert np.log(astuple(found)) == pytest.approx(np.log(astuple(LEVELS)), abs=0.5)
    for field in fields(Noise):
        for factor in (0.98, 1.02):
            beside = replace(found, **{field.name: factor * getattr(found, field.name)})
            assert profile(equations, beside).minus_two_log > least
