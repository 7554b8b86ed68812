"""Plans that distinguish two rivals: worth it, reachable, and none where poses cannot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calib.chain.effect import Present
from calib.chain.effects import find_effect, make_effect
from calib.discovery.design.choose import contest
from calib.discovery.diagnose import diagnose
from calib.discovery.diagnosis import Ambiguity
from cell.devices.simulated_cell import home_of, log_of, simulated_cell
from cell.sequencer.guard import Guard
from cell.storage.files.plan_file import read_plan
from cell.verbs.diagnose.separate import POSES, separations
from tests.discovery.simulated_runs import log, plain_cell, record, recording


def undecided(present: Present, rival: str):
    """A diagnosis that found this effect and could not rule out the rival."""
    views = record(plain_cell().with_effects([present]), log(40), seed=3)
    found = diagnose(views, forced=[Present(present.effect, present.effect.values({}))])
    pair = Ambiguity((present.effect.name, rival), "too alike", "another experiment")
    return replace(found, ambiguous_with=(pair,))


COMPLIANCE = undecided(
    make_effect("joint_compliance", {"rad_per_Nm_2": 4e-6, "rad_per_Nm_3": 4e-6}),
    "joint_zero_offset",
)


def strength(found, more):
    """Noncentrality of recorded views and some more, by the plan's own log and not the design."""
    first = found.twin.model.effects[0]
    rival = find_effect(found.ambiguous_with[0].names[1])
    views = found.views if more is None else found.views.joined(more)
    given = contest(
        found.twin.model.with_effects([]), first, rival, views, len(views), found.twin.noise
    )
    return float(given.strength(given.start))


def test_the_plan_is_worth_more_than_twice_as_many_random_views(tmp_path):
    (made,) = separations(COMPLIANCE, recording())
    assert made.file == "separate-joint_compliance-joint_zero_offset.plan.yaml"
    path = tmp_path / made.file
    path.write_text(made.text)
    plan = read_plan(path)
    reached = Guard.of(plan).check_plan(plan, home_of(plan))
    poses = len({tuple(np.round(joints, 6)) for joints in reached})
    assert POSES <= poses <= POSES + 1
    cell = simulated_cell(plan.cell, home_of(plan))
    once = log_of(plan, cell).take(np.arange(poses))
    once = replace(once, frame=once.frame + 1000)
    now = strength(COMPLIANCE, None)
    designed = strength(COMPLIANCE, once) - now
    random = [
        strength(COMPLIANCE, replace(log(POSES, seed), frame=1000 + np.arange(POSES))) - now
        for seed in (11, 12, 13, 14, 15)
    ]
    assert designed > 2.0 * np.median(random)
    assert designed > max(random)


def test_the_arm_stays_where_it_has_been(tmp_path):
    (made,) = separations(COMPLIANCE, recording())
    path = tmp_path / "made.plan.yaml"
    path.write_text(made.text)
    plan = read_plan(path)
    space = plan.cell.workspace
    flange = COMPLIANCE.views.base_from_flange[:, :3, 3]
    planned = log_of(plan, simulated_cell(plan.cell, home_of(plan))).base_from_flange[:, :3, 3]
    assert planned[:, 2].min() >= flange[:, 2].min() - 1e-6
    assert space is not None
    assert (planned > space.low_m).all()
    assert (planned < space.high_m).all()


def test_no_plan_is_given_where_no_poses_can():
    found = undecided(
        make_effect("entrance_pupil_shift", {"pupil_m_rad2": 3e-3}), "protective_window"
    )
    (made,) = separations(found, recording())
    assert made.file is None
    assert "no plan of poses decides it" in made.why


def test_no_plan_is_given_for_an_arm_that_nobody_knows():
    found = replace(COMPLIANCE, views=replace(COMPLIANCE.views, robot_model=None))
    (made,) = separations(found, recording())
    assert made.file is None
    assert "no poses can be checked" in made.why
