"""What is particular to an OmniCore: Robot Web Services 2.0."""

import contextlib
import time
from contextlib import contextmanager

import pytest
from benches import (
    ABB_HOME,
    PATIENT_ABB,
    abb_peer,
    abb_settings,
    free_udp_port,
    halts_short_of,
    slowly,
    stays,
    truly_moving,
    until,
    wait_steady,
)
from hazards import halts_within, process_moving

from drivers.abb import FACTORY_LOGIN, ABBArm, ABBSettings, Login
from drivers.abb.guard import session_for
from drivers.abb.rws2 import Rws2, Rws2Refused
from drivers.abb.transport import IRC5, OMNICORE, certificate_of, generation_of
from drivers.arm import Motion
from drivers.errors import ArmStopped, DeviceError, DeviceRefused, StopFailed
from sim.peers.abb.answers import Answer
from sim.peers.controller_faults import Stops

FAR = tuple(angle + 0.6 for angle in ABB_HOME)


_CONNECT = """
import sys
from drivers.abb import FACTORY_LOGIN, ABBArm, ABBSettings
arm = ABBArm(sys.argv[1], ABBSettings(login=FACTORY_LOGIN, certificate_sha256="{trusted}"))
"""


@contextmanager
def moving(egm=False, **settings):
    port = free_udp_port() if egm else None
    with abb_peer(port, omnicore=True) as (controller, sim):
        arm = ABBArm(controller.url, abb_settings(controller, egm_port=port, **settings))
        try:
            arm.connect()
            arm.start_move(slowly(FAR))
            assert until(lambda: truly_moving(sim))
            time.sleep(0.1)
            yield arm, controller, sim
        finally:
            arm.close()


@contextmanager
def session():
    with abb_peer(omnicore=True) as (controller, _):
        trusted = certificate_of(controller.address, controller.port)
        rws = Rws2(controller.url, session_for(trusted), FACTORY_LOGIN)
        yield rws, controller
        rws.close()


def test_robotware_6_and_7_are_distinguished_by_the_login_they_ask_for():
    with abb_peer() as (six, _), abb_peer(omnicore=True) as (seven, _):
        assert generation_of(six.url, None) == IRC5
        shown = certificate_of(seven.address, seven.port)
        assert generation_of(seven.url, shown) == OMNICORE
        assert not six.request_times_s
        assert not seven.request_times_s


def test_a_stop_reaches_the_arm_within_100_ms():
    halts_within(0.1, moving, lambda arm, _: arm.stop(), FAR)


def test_a_run_that_is_killed_leaves_the_mastership_to_the_next_one():
    with abb_peer(omnicore=True) as (controller, sim):
        trusted = certificate_of(controller.address, controller.port)
        connect = _CONNECT.format(trusted=trusted)
        with process_moving(connect, controller.url, sim, FAR) as process:
            process.kill()
        rws = Rws2(controller.url, session_for(trusted), FACTORY_LOGIN)

        def is_master():
            with contextlib.suppress(Rws2Refused):
                rws.resetpp()
                return True
            return False

        assert until(is_master)
        rws.close()


def test_a_refused_stop_switches_the_motors_off():
    with moving(**PATIENT_ABB) as (arm, controller, sim):
        controller.faults.rapid_stop_refused = True
        arm.stop()
        assert halts_short_of(sim, FAR)
        assert controller.panel.controller == "motoroff"


def test_a_cut_cable_stops_the_motion_under_way():
    with moving() as (_, controller, sim):
        controller.cut()
        assert halts_short_of(sim, FAR)
        assert controller.watch.values["stops"] == 1
        controller.faults.mend_cable()


def test_a_stop_that_is_refused_by_every_path_is_reported():
    with moving() as (arm, controller, _):
        controller.faults.stops = Stops.REFUSED

        def failing():
            try:
                arm.stop()  # which waits for an answer for a moment only
                arm.state()
            except StopFailed as failed:
                return "refuses" in str(failed) or "still moves" in str(failed)
            return False

        assert until(failing)


def test_a_guard_stop_is_reported_with_what_to_do():
    with moving(**PATIENT_ABB) as (arm, controller, sim):
        controller.guard_stop()
        assert until(lambda: arm.state().motion is Motion.STOPPED_BY_FAULT)
        assert "reset the guard" in arm.state().fault
        assert stays(sim)
        with pytest.raises(ArmStopped, match="guard"):
            arm.connect()


def test_egm_reports_joints_and_pose_on_the_way():
    with moving(egm=True, **PATIENT_ABB) as (arm, _, _):
        assert until(lambda: arm.state().raw["source"] == "egm")


def test_mastership_is_taken_for_writing_and_given_back():
    with session() as (rws, controller):
        controller.rapid_data["T_ROB1/cell/steps"] = "7"
        rws.set_rapid_variable("cell/steps", "8")
        assert rws.get_rapid_variable("cell/steps") == "8"
        trusted = certificate_of(controller.address, controller.port)
        other = Rws2(controller.url, session_for(trusted), FACTORY_LOGIN)
        with pytest.raises(Rws2Refused, match="held by another"):
            other.set_rapid_variable("cell/steps", "9")
        rws.close()
        other.set_rapid_variable("cell/steps", "9")
        other.close()
        assert controller.rapid_data["T_ROB1/cell/steps"] == "9"


def test_an_arm_whose_mastership_somebody_holds_is_refused_in_words():
    with session() as (rws, controller):
        rws.resetpp()
        arm = ABBArm(controller.url, abb_settings(controller))
        with pytest.raises(DeviceError, match=r"[Mm]astership is held by another"):
            arm.connect()


def test_a_wrong_password_is_reported_as_such_and_not_repeated():
    with abb_peer(omnicore=True) as (controller, _):
        shown = certificate_of(controller.address, controller.port)
        settings = ABBSettings(login=Login("Default User", "guess-4711"), certificate_sha256=shown)
        with pytest.raises(DeviceRefused, match="password is wrong") as refused:
            ABBArm(controller.url, settings).connect()
        assert "4711" not in str(refused.value)


@pytest.mark.parametrize(
    "body",
    [b"[" * 100_000, b"null", b"{}", b'{"state": [7]}', b'{"state": {}}', b"\xff"],
    ids=["deep", "null", "empty", "numbers", "no list", "no text"],
)
def test_an_answer_that_cannot_be_is_an_error_with_a_name(body):
    with abb_peer(omnicore=True) as (controller, _):
        resources = controller._http._server.RequestHandlerClass.resources
        resources.answer = lambda *_: Answer(200, body, "application/hal+json;v=2.0")
        with pytest.raises(DeviceError) as refused:
            ABBArm(controller.url, abb_settings(controller)).connect()
        assert str(refused.value).isprintable()


def test_moves_follow_one_another():
    with abb_peer(omnicore=True) as (controller, _):
        arm = ABBArm(controller.url, abb_settings(controller))
        try:
            arm.connect()
            for shift in (0.05, -0.05):
                goal = tuple(angle + shift for angle in ABB_HOME)
                arm.start_move(slowly(goal))
                assert wait_steady(arm).joints_rad == pytest.approx(goal, abs=1e-5)
        finally:
            arm.close()
