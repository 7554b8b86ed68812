"""Readings are held against the plan, always: on the way and where the arm stands."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform

from calib.chain.kinematics import arm as kinematics_of
from cell.errors import EXIT_SAFETY
from cell.sequencer.states import Finish, State
from drivers.arm import ArmState, Motion
from tests.cell.plans import PLAN
from tests.cell.test_sequencer import NO_BOARD, Bench, WhenAt

FORWARD = kinematics_of("ur5e").forward
Falsify = Callable[[ArmState], ArmState]

LONG_WAY = PLAN + "- {joints_deg: [40, -85, 90, -90, -90, 10]}\n"


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path, LONG_WAY + NO_BOARD)


def turned(state: ArmState, by_rad: np.ndarray) -> ArmState:
    """The same reading of an arm that is turned by so much, flange and all."""
    joints = np.asarray(state.joints_rad) + by_rad
    pose = RigidTransform.from_matrix(FORWARD(joints))
    return replace(state, joints_rad=tuple(joints.tolist()), base_from_flange=pose)


def falsified(bench: Bench, when: WhenAt, falsify: Falsify) -> None:
    """From that moment on every reading is what `falsify` makes of it."""
    read = bench.arm.state
    on: list[bool] = []
    when.act = lambda: on.append(True)
    bench.watchers = [when, *bench.watchers]

    def state() -> ArmState:
        if not on:
            return read()
        bench.clock.sleep(0.001)  # a controller reports nothing else at the same time
        return falsify(read())

    bench.arm.state = state  # type: ignore[method-assign]


def clocked(bench: Bench) -> None:
    """Let every reading carry the controller's time."""
    read = bench.arm.state
    bench.arm.state = lambda: replace(read(), controller_t_s=bench.clock.now())  # type: ignore


def stopped_for(bench: Bench, words: str) -> None:
    result = bench.run()
    assert result.finish is Finish.SAFETY, result.reason
    assert result.finish.exit_status == EXIT_SAFETY
    assert words in result.reason
    assert "stop" in bench.arm.calls


def nothing() -> None:
    """Replaced by `falsified`."""


def pausing(bench: Bench, view: int) -> None:
    """Pause at that view, for as long as the clock takes to get there."""
    wait = bench.requests.wait

    def waits(seconds: float) -> None:
        bench.clock.sleep(seconds)
        wait(0.0)

    bench.requests.wait = waits  # type: ignore[method-assign]
    bench.watchers = [WhenAt(State.MOVING, view, bench.requests.pause), *bench.watchers]


@pytest.mark.parametrize("state", [State.SETTLING, State.FOCUSING, State.GRABBING, State.PAUSED])
def test_an_arm_that_is_pushed_where_it_stands_ends_the_run(bench: Bench, state: State) -> None:
    if state is State.PAUSED:
        pausing(bench, 2)
    push = np.radians([0.0, 0.0, 1.5, 0.0, 0.0, 0.0])
    falsified(bench, WhenAt(state, 2, nothing), lambda state: turned(state, push))
    stopped_for(bench, "joint 3 is 1.5")


def test_a_slow_drift_is_seen_when_it_has_come_far_enough(bench: Bench) -> None:
    began: list[float] = []

    def drifting(state: ArmState) -> ArmState:
        began[:] = began or [state.host_t_s]
        return turned(state, np.array([2e-3, 0, 0, 0, 0, 0]) * (state.host_t_s - began[0]))

    pausing(bench, 2)
    falsified(bench, WhenAt(State.PAUSED, 2, nothing), drifting)
    stopped_for(bench, "was moved where it was to stand: joint 1 is 1.1")


def test_a_controller_that_takes_another_way_is_stopped(bench: Bench) -> None:
    def bulging(state: ArmState) -> ArmState:
        share = bench.arm.share
        bulge = 4.0 * share * (1.0 - share) * np.radians(8.0)
        return turned(state, np.array([0.0, bulge, 0.0, 0.0, 0.0, 0.0]))

    falsified(bench, WhenAt(State.MOVING, 4, nothing), bulging)
    stopped_for(bench, "left the way")


def test_a_flange_faster_than_the_plan_is_stopped(bench: Bench) -> None:
    clocked(bench)
    start_move = bench.arm.start_move

    def hastily(target):  # type: ignore[no-untyped-def]
        start_move(target)
        bench.arm.takes_s /= 2.0

    bench.arm.start_move = hastily  # type: ignore[method-assign]
    stopped_for(bench, "the plan allows 0.2 m/s")


def test_a_joint_ordered_to_be_faster_than_its_move_is_stopped(bench: Bench) -> None:
    fast = (0.0, 0.0, 0.0, 0.0, 2.0, 0.0)
    falsified(
        bench,
        WhenAt(State.MOVING, 4, nothing),
        lambda state: replace(state, joint_velocity_rad_s=fast),
    )
    stopped_for(bench, "joint 5 turns at 114.6°/s")


@pytest.mark.parametrize("clock", [True, False], ids=["clocked", "no clock"])
def test_a_joint_that_is_faster_than_its_move_is_stopped_though_no_speed_is_reported(
    tmp_path: Path, clock: bool
) -> None:
    """As Robot Web Services do; a wrist that turns moves neither flange nor camera."""
    wrist = "- {joints_deg: [40, -85, 90, -90, -90, 170]}\n"
    bench = Bench(tmp_path, LONG_WAY + wrist + NO_BOARD)
    if clock:
        clocked(bench)
    reported = bench.arm.state
    bench.arm.state = lambda: replace(reported(), joint_velocity_rad_s=None)  # type: ignore
    start_move = bench.arm.start_move

    def hastily(target):  # type: ignore[no-untyped-def]
        start_move(target)
        bench.arm.takes_s /= 2.0 if bench.arm.end[5] > 2.0 else 1.0

    bench.arm.start_move = hastily  # type: ignore[method-assign]
    stopped_for(bench, "joint 6 turns at")


def old(bench: Bench) -> Falsify:
    """Values as they were on the way, reported anew with the clock going on."""
    kept: list[ArmState] = []

    def falsify(state: ArmState) -> ArmState:
        if bench.arm.share > 0.3 and not kept:
            kept.append(replace(state, joint_velocity_rad_s=(0.2, 0, 0, 0, 0, 0)))
        if not kept:
            return state
        return replace(kept[0], host_t_s=state.host_t_s, controller_t_s=state.host_t_s)

    return falsify


def test_readings_that_stay_old_on_the_way_are_not_believed(bench: Bench) -> None:
    falsified(bench, WhenAt(State.MOVING, 4, nothing), old(bench))
    stopped_for(bench, "They are old")


def leap(state: ArmState) -> ArmState:
    return turned(
        replace(state, controller_t_s=state.host_t_s), np.array([0.0, 0.0, 0.0, 0.5, 0.0, 0.0])
    )


def in_millimetres(state: ArmState) -> ArmState:
    pose = state.base_from_flange
    shifted = RigidTransform.from_components(1000.0 * pose.translation, pose.rotation)
    return replace(state, base_from_flange=shifted)


def no_number(state: ArmState) -> ArmState:
    return replace(state, joints_rad=(0.0, 0.0, float("nan"), 0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("falsify", "words"),
    [
        (in_millimetres, "from where the pose says"),
        (no_number, "not finite"),
    ],
)
@pytest.mark.parametrize("state", [State.MOVING, State.GRABBING])
def test_a_reading_that_cannot_be_is_not_believed(
    bench: Bench, state: State, falsify: Falsify, words: str
) -> None:
    falsified(bench, WhenAt(state, 3, nothing), falsify)
    stopped_for(bench, words)


def test_a_leap_farther_than_the_arm_can_go_is_not_believed(bench: Bench) -> None:
    clocked(bench)
    falsified(bench, WhenAt(State.GRABBING, 3, nothing), leap)
    stopped_for(bench, "joint 4 jumped by 28.6°")


def test_a_stop_by_itself_that_drifts_is_never_reported_as_standing(bench: Bench) -> None:
    def drifting(state: ArmState) -> ArmState:
        sag = np.array([0.0, 0.02 * bench.clock.now(), 0.0, 0.0, 0.0, 0.0])
        fault = replace(state, motion=Motion.STOPPED_BY_FAULT, fault="protective stop")
        return turned(fault, sag)

    falsified(bench, WhenAt(State.MOVING, 4, nothing), drifting)
    result = bench.run()
    assert result.finish is Finish.SAFETY
    assert "THE ARM DOES NOT STOP" in result.reason
    assert "protective stop" in result.reason


def test_what_a_sound_arm_does_is_never_stopped(bench: Bench) -> None:
    result = bench.run()
    assert (result.finish, result.frames) == (Finish.COMPLETED, 5)
