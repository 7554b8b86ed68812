"""Under the null the score tests' p-values are evenly spread."""

from __future__ import annotations

import numpy as np
from scipy.stats import kstest

from calib.chain.effect import Present
from calib.chain.effects import catalogue
from calib.discovery.score import score_effects
from calib.solver.joint import JointFit, fit_joint
from calib.solver.unknowns import unknowns_of
from calib.views import Views
from tests.discovery.simulated_runs import NOISE, log, plain_cell, record

LOG = log(24)
DRAWS = 24
ASKED = (
    "board_warp",
    "joint_zero_offset",
    "joint_compliance",
    "mount_flex",
    "focus_breathing:inverse_square",
    "thermal_focal_drift",
    "decentering",
    "lens_sag",
)
EFFECTS = [Present(e, e.values({})) for e in catalogue() if e.label in ASKED]


def null_fit(seed: int) -> tuple[JointFit, Views]:
    model = plain_cell()
    views = record(model, LOG, 1000 + seed)
    return fit_joint(model, views, unknowns_of(model), NOISE, rounds=2), views


def test_p_values_of_clean_recordings_are_uniform():
    p = np.array(
        [[score.p_value for score in score_effects(*null_fit(k), EFFECTS)] for k in range(DRAWS)]
    )
    assert p.shape == (DRAWS, len(ASKED))
    assert kstest(p.ravel(), "uniform").pvalue > 1e-3
    assert 0.01 < np.mean(p < 0.05) < 0.11
    assert np.mean(p < 0.001) < 0.02
