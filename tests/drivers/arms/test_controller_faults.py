"""The simulated controllers' own faults: what a test that switches one on may count on."""

import time
from contextlib import contextmanager

import numpy as np
import pytest
from benches import (
    ABB_HOME,
    UR_FAR,
    abb_peer,
    halts_short_of,
    slowly,
    stays,
    truly_moving,
    until,
    ur_peer,
)

from drivers.abb import FACTORY_LOGIN, ABBSettings
from drivers.abb.guard import StopSession
from drivers.abb.rws import open_rws
from drivers.errors import DeviceUnreachable
from drivers.ur.dashboard import Dashboard
from drivers.ur.reader import RtdeReader
from sim.peers.controller_faults import Stops

ABB_FAR = tuple(angle + 0.6 for angle in ABB_HOME)
LATE_S = 0.3


@contextmanager
def ur_moving():
    """(controller, its arm, what stops it and returns the answer)."""
    with ur_peer() as (controller, sim):
        controller.begin_move(slowly(UR_FAR))
        assert until(lambda: truly_moving(sim))
        dashboard = Dashboard(controller.address)
        dashboard.ask("robotmode")  # so that the connection stands before a fault

        def stop():
            try:
                return dashboard.ask("stop", 0.2) == "Stopped"
            except DeviceUnreachable:
                return False

        try:
            yield controller, sim, stop
        finally:
            dashboard.close()


@contextmanager
def abb_moving():
    with abb_peer() as (controller, sim):
        controller.running = True
        sim.start_move(slowly(ABB_FAR))
        assert until(lambda: truly_moving(sim))
        session = StopSession(controller.url, "Default User", "robotics", 0.2)
        session.log_in()
        yield controller, sim, lambda: session.stop() is None


@pytest.fixture(params=[ur_moving, abb_moving], ids=["ur", "abb"])
def moving(request):
    with request.param() as peer:
        yield peer


def moves_on(sim, duration_s):
    before = sim.truth().joints_rad
    time.sleep(duration_s)
    return bool(np.abs(sim.truth().joints_rad - before).max() > 0.01)


def test_an_obeyed_stop_is_taken_and_the_arm_halts(moving):
    _, sim, stop = moving
    assert stop()
    assert halts_short_of(sim, UR_FAR, ABB_FAR)
    assert stays(sim)


def test_an_ignored_stop_is_taken_and_the_arm_drives_on_for_all_that_follows(moving):
    controller, sim, stop = moving
    controller.faults.stops = Stops.IGNORED
    assert stop()
    assert stop()
    assert moves_on(sim, 1.0)


def test_a_late_stop_is_taken_and_obeyed_when_the_time_has_passed(moving):
    controller, sim, stop = moving
    controller.faults.stops, controller.faults.late_s = Stops.LATE, LATE_S
    since_s = time.monotonic()
    assert stop()
    assert truly_moving(sim)
    assert halts_short_of(sim, UR_FAR, ABB_FAR)
    assert time.monotonic() - since_s > LATE_S


def test_a_refused_stop_is_answered_so_and_the_arm_drives_on(moving):
    controller, sim, stop = moving
    controller.faults.stops = Stops.REFUSED
    assert not stop()
    assert moves_on(sim, 0.3)


def test_a_guard_or_a_collision_stops_the_arm_whatever_becomes_of_orders(moving):
    controller, sim, _ = moving
    controller.faults.stops = Stops.IGNORED
    controller.emergency_stop()
    assert halts_short_of(sim, UR_FAR, ABB_FAR)


def test_behind_a_cut_cable_nothing_arrives(moving):
    controller, sim, stop = moving
    controller.faults.cut()
    assert not stop()
    assert moves_on(sim, 0.3)


def test_a_mute_controller_obeys_and_does_not_answer():
    with ur_moving() as (controller, sim, stop):
        controller.faults.mute = True
        assert not stop()
        assert halts_short_of(sim, UR_FAR, ABB_FAR)


@contextmanager
def ur_readings():
    with ur_moving() as (controller, *_):
        reader = RtdeReader(controller.address, silence_s=5.0)
        reader.connect()
        try:
            yield controller, lambda: reader.newest().values
        finally:
            reader.close()


def test_a_frozen_clock_lets_the_values_go_on():
    with ur_readings() as (controller, newest):
        controller.faults.frozen_clock = True
        time.sleep(0.1)
        before = newest()
        time.sleep(0.3)
        assert newest()["timestamp"] == before["timestamp"]
        assert newest()["actual_q"] != before["actual_q"]


def test_old_readings_let_the_clock_go_on():
    with ur_readings() as (controller, newest):
        controller.faults.old_readings = True
        time.sleep(0.1)
        before = newest()
        time.sleep(0.3)
        assert newest()["timestamp"] != before["timestamp"]
        assert newest()["actual_q"] == before["actual_q"]


def test_old_readings_come_through_robot_web_services_too():
    with abb_moving() as (controller, sim, _):
        rws = open_rws(controller.url, ABBSettings(login=FACTORY_LOGIN), 1)
        rws.get_jointtarget()
        controller.faults.old_readings = True
        before = rws.get_jointtarget().robax.tolist()
        assert moves_on(sim, 0.3)
        assert rws.get_jointtarget().robax.tolist() == before


def test_a_watchdog_that_fails_stops_nothing():
    with abb_moving() as (controller, sim, _):
        controller.watch.values["beat"] = 1.0
        controller.faults.watchdog_fails = True
        assert until(lambda: controller.watch.values["stops"] == 1.0)
        assert moves_on(sim, 0.2)
