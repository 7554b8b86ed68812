"""A law's picture: the law over what it follows, its band, and what each frame alone says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calib.chain.effects import make_effect
from calib.discovery.laws.shape import law_shapes
from calib.discovery.search import Search
from calib.discovery.start import Fitter
from cell.views.report.data import Evidence, ReportData
from cell.views.report.evidence.law import shape
from tests.discovery.simulated_runs import NOISE, log, plain_cell, record

LOG = log(32)
LAW = {"law": "linear:principal_point.u_px/gain_db", "low_1": 0.0, "high_1": 12.0}


def test_a_law_is_drawn_with_what_each_frame_says_and_a_band_that_holds_the_truth():
    gain_db = np.random.default_rng(5).choice([0.0, 6.0, 12.0], len(LOG))
    logged = replace(LOG, extra={"gain_db": gain_db})
    true = make_effect("empirical", {**LAW, "slope_u_px": 0.6})
    views = record(plain_cell().with_effects([true]), logged, 41)
    fitter = Fitter(views)
    search = Search(fitter.fit(plain_cell(), NOISE), fitter)
    search.force([make_effect("empirical", LAW)])
    (found,) = law_shapes(search.best.fit, views)
    assert (found.site, found.covariate) == ("principal_point", "gain_db")
    np.testing.assert_array_equal(found.at, gain_db)
    law = np.interp(gain_db, found.grid, found.value)
    scaled = (found.by_frame - law) / found.by_frame_sigma
    assert 0.6 < np.sqrt(np.mean(scaled**2)) < 1.4
    swing = found.value[-1] - found.value[0]
    wide = np.hypot(found.sigma[-1], found.sigma[0])
    assert abs(swing - 0.6 * 12.0) < 3.0 * wide
    assert wide < 0.5

    data = ReportData(views, {}, None, None, evidence=Evidence(laws=(found,)))
    drawn = shape(data, {"site": "principal_point", "covariate": "gain_db"})
    assert drawn is not None
    assert "gain db" in drawn.svg("")
    assert shape(data, {"site": "joint_2", "covariate": "gain_db"}) is None
