"""Physics that nobody has named: the law is found, carried by the twin, and reported."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calib.chain.effects import make_effect
from calib.chain.model import predict
from calib.discovery.diagnose import diagnose
from calib.discovery.laws.frames import frame_blocks
from calib.discovery.laws.scan import Found, Scan
from calib.discovery.score import score_effects
from calib.discovery.start import Fitter
from calib.views import Views
from tests.discovery.simulated_runs import NOISE, log, plain_cell, record

LOG = log(32)
N = len(LOG)
LOGGED = replace(
    LOG,
    extra={"gain_db": np.random.default_rng(5).choice([0.0, 6.0, 12.0, 18.0], N)},
    labels={"lamp": np.array(["left", "right", "left", "off"])[np.arange(N) % 4]},
)
ENDS = {"low_1": 0.0, "high_1": 1.0}


def made(law: str, *, seed: int = 3, **numbers: float) -> Views:
    present = make_effect("empirical", {"law": law, **numbers})
    return record(plain_cell().with_effects([present]), LOGGED, seed)


def best(views: Views) -> Found:
    fit = Fitter(views).fit(plain_cell(), NOISE)
    return Scan(frame_blocks(fit, views), views).best(1)[0]


@pytest.mark.parametrize(
    ("law", "numbers"),
    [
        (
            "linear:principal_point.u_px/gain_db",
            {"slope_u_px": 0.2, "low_1": 0.0, "high_1": 18.0},
        ),
        (
            "quadratic:mounted_pose.x_m/gain_db",
            {"slope_x_m": 0.0, "curvature_x_m": 8e-6, "low_1": 0.0, "high_1": 18.0},
        ),
        (
            "step:fixed_pose.y_m/lamp=right",
            {"step_y_m": 5e-4, "at": 0.5, **ENDS},
        ),
        (
            "periodic:joint_3.joint_3/joint_3",
            {"sin_joint_3": 5e-4, "cos_joint_3": 2e-4, "cycles": 64.0, **ENDS},
        ),
        (
            "play:joint_3.joint_3/approach_5",
            {"play_joint_3": 3e-4, **ENDS},
        ),
        (
            "product:principal_point.v_px/gravity_x*gain_db",
            {"product_v_px": 0.15, "low_2": 0.0, "high_2": 18.0, "low_1": -1.0, "high_1": 1.0},
        ),
        (
            "relaxation:focal_length.relative/order",
            {"start_relative": 3e-3, "constant": 4.0, "from_end": 0.0, "high_1": 31.0},
        ),
    ],
)
def test_the_shortest_law_is_found_where_it_lives_along_what_drives_it(law, numbers):
    found = best(made(law, **numbers)).law
    form, _, rest = law.partition(":")
    place, _, along = rest.partition("/")
    assert found.site.name == place.split(".")[0]
    assert {c.name for c in found.covariates} == set(along.split("*"))
    assert found.form.key == form


def test_a_clean_recording_promises_no_law():
    assert best(record(plain_cell(), LOGGED, seed=8)).worth < 0.0


def test_the_blocks_say_of_an_effect_what_its_score_test_says():
    views = made(
        "linear:focal_length.relative/gain_db", slope_relative=1e-4, low_1=0.0, high_1=18.0
    )
    fit = Fitter(views).fit(plain_cell(), NOISE)
    law = "linear:focal_length.relative/gain_db"
    present = make_effect("empirical", {"law": law, "low_1": 0.0, "high_1": 18.0})
    (score,) = score_effects(fit, views, [present])
    found = [f for f in Scan(frame_blocks(fit, views), views).best(400) if f.law.text == law]
    assert found[0].gain == pytest.approx(score.gain, rel=1e-3)


def test_a_law_is_reported_with_its_equation_and_predicts_frames_never_shown():
    numbers = {"slope_u_px": 0.2, "slope_v_px": -0.1, "low_1": 0.0, "high_1": 18.0}
    found = diagnose(made("linear:principal_point.u_px+v_px/gain_db", seed=4, **numbers))
    assert found.verdict == "unexplained"
    assert found.effects == ()
    (reported,) = found.unexplained_all
    assert (reported.link, reported.site, reported.covariate) == (
        "lens",
        "principal_point",
        "gain_db",
    )
    law = reported.law
    assert law is not None
    assert law.form == "linear"
    assert "gain_db" in law.equation
    slope = law.parameters["slope_u_px"]
    assert abs(slope.value - 0.2) < 3.5 * slope.sigma
    assert slope.unit == "px/dB"
    assert law.holdout_gain_px > 0.2
    true = make_effect("empirical", {"law": "linear:principal_point.u_px+v_px/gain_db", **numbers})
    expected = predict(plain_cell().with_effects([true]), LOGGED)
    miss = predict(found.twin.model, LOGGED) - expected
    assert np.sqrt(np.mean(miss**2)) < 0.15
