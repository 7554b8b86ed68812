"""A stop is done when fresh readings prove that the arm stands, and by nothing else."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import cell
from cell.sequencer.confirmed_stop import DEADLINE_S, ConfirmedStop, StopReport
from cell.sequencer.rest import REST_S
from drivers.arm import ArmState, MoveTarget
from drivers.errors import DeviceUnreachable, StopFailed
from tests.cell.fakes import HOME, FakeArm, FastClock

FAR = tuple(HOME + 0.5)


class Reading(FakeArm):
    """A `FakeArm` with a clock of its own whose readings may be made false."""

    def __init__(self, clock: FastClock) -> None:
        super().__init__(clock.now)
        self.falsify: Callable[[ArmState], ArmState] = lambda state: state
        self.speed_rad_s = 0.1

    def state(self) -> ArmState:
        speed = self.speed_rad_s if self.moving else 0.0
        state = replace(
            super().state(), controller_t_s=self.now(), joint_velocity_rad_s=(speed,) * 6
        )
        return self.falsify(state)


@pytest.fixture
def clock() -> FastClock:
    return FastClock()


@pytest.fixture
def moving(clock: FastClock) -> Reading:
    arm = Reading(clock)
    arm.start_move(MoveTarget(joints_rad=FAR, joint_speed_rad_s=arm.speed_rad_s))
    clock.sleep(0.5)
    return arm


def stopped(arm: Reading, clock: FastClock) -> StopReport:
    before = arm.state()
    return ConfirmedStop(arm, clock).see_through(before, least_way_rad=0.0)


def test_an_obeyed_stop_is_confirmed_by_readings_that_agree(
    moving: Reading, clock: FastClock
) -> None:
    word = stopped(moving, clock)
    assert word.stands
    assert REST_S <= word.after_s < REST_S + 0.1
    assert word.orders == 1
    assert "stands" in word.text


def test_a_stop_that_is_obeyed_late_is_ordered_again_until_it_is(
    moving: Reading, clock: FastClock
) -> None:
    moving.obeys_after_s = 1.0
    word = stopped(moving, clock)
    assert word.stands
    assert 1.0 + REST_S <= word.after_s < 1.2 + REST_S
    assert word.orders >= 10


Falsify = Callable[[ArmState, ArmState], ArmState]
"""What a reading is made of the live one, given the one from before the order."""


def frozen_clock(live: ArmState, before: ArmState) -> ArmState:
    return replace(live, controller_t_s=before.controller_t_s)


def old_values(live: ArmState, before: ArmState) -> ArmState:
    return replace(before, host_t_s=live.host_t_s, controller_t_s=live.controller_t_s)


def old_joints(live: ArmState, before: ArmState) -> ArmState:
    return replace(live, joints_rad=before.joints_rad, joint_velocity_rad_s=None)


def not_finite(live: ArmState, before: ArmState) -> ArmState:
    return replace(live, joints_rad=(np.nan,) * 6)


def speed_not_finite(live: ArmState, before: ArmState) -> ArmState:
    return replace(live, joint_velocity_rad_s=(np.nan,) * 6)


def no_joints(live: ArmState, before: ArmState) -> ArmState:
    return replace(live, joints_rad=None)


def the_same_packet_again(live: ArmState, before: ArmState) -> ArmState:
    return before


def unreachable(live: ArmState, before: ArmState) -> ArmState:
    raise DeviceUnreachable("silent for 0.25 s")


@pytest.mark.parametrize(
    ("falsify", "why"),
    [
        (frozen_clock, "clock stands still"),
        (old_values, "on its way"),
        (old_joints, "on its way"),
        (not_finite, "not finite"),
        (speed_not_finite, "still moves"),
        (no_joints, "not finite"),
        (the_same_packet_again, "no reading has come"),
        (unreachable, "silent for 0.25 s"),
    ],
)
def test_readings_that_prove_nothing_are_never_taken_for_a_stop(
    falsify: Falsify, why: str, moving: Reading, clock: FastClock
) -> None:
    before = moving.state()
    moving.falsify = lambda live: falsify(live, before)
    word = ConfirmedStop(moving, clock).see_through(before, least_way_rad=0.0)
    assert not word.stands
    assert why in word.text
    assert word.after_s > DEADLINE_S
    assert word.orders > 20
    assert "PRESS THE EMERGENCY STOP" in word.text


def test_an_arm_that_takes_the_order_and_drives_on_is_reported_as_moving(
    moving: Reading, clock: FastClock
) -> None:
    moving.obeys_after_s = np.inf
    word = stopped(moving, clock)
    assert not word.stands
    assert "THE ARM DOES NOT STOP" in word.text


def test_an_arm_that_creeps_is_not_at_rest(moving: Reading, clock: FastClock) -> None:
    moving.obeys_after_s = np.inf
    moving.speed_rad_s = 0.0
    moving.takes_s *= 20.0
    word = stopped(moving, clock)
    assert not word.stands


def test_an_order_that_is_refused_is_no_stop_and_its_text_is_reported(
    moving: Reading, clock: FastClock
) -> None:
    moving.stop_error = StopFailed("HTTP 403")
    word = stopped(moving, clock)
    assert not word.stands
    assert "HTTP 403" in word.text


def test_an_arm_at_rest_is_confirmed_though_the_order_was_not_taken(clock: FastClock) -> None:
    arm = Reading(clock)
    arm.stop_error = StopFailed("link closed")
    word = ConfirmedStop(arm, clock).see_through(arm.state())
    assert word.stands


def test_every_verb_that_moves_or_stops_an_arm_does_so_through_the_confirmed_stop() -> None:
    room = Path(cell.__file__).parent
    orders = {
        path.relative_to(room).as_posix()
        for path in room.rglob("*.py")
        if re.search(r"\.start_move\(|arm\.stop\(\)", path.read_text())
    }
    assert orders == {"sequencer/watched_arm.py", "sequencer/confirmed_stop.py"}


def test_readings_from_before_the_order_count_for_nothing(clock: FastClock) -> None:
    arm = Reading(clock)
    clock.sleep(10.0)
    before = arm.state()
    word = ConfirmedStop(arm, clock).see_through(before)
    assert word.after_s >= REST_S
