"""What is particular to PolyScope X: the robot API in place of the dashboard server."""

import json
import time
from contextlib import suppress

import pytest
from benches import (
    ROBOT_API_PORT,
    UR_FAR,
    halts_short_of,
    stays,
    until,
    ur_moving,
    ur_peer,
)
from hazards import halts_within, recovers_by_the_five_second_rule

from drivers.arm import Motion
from drivers.errors import DeviceRefused, DeviceUnreachable
from drivers.ur import URArm, URSettings
from drivers.ur.dashboard_panel import DashboardPanel
from drivers.ur.robot_api import RobotApi
from drivers.ur.which_panel import panel_of
from sim.peers.controller_faults import Stops
from sim.peers.listener import Listener
from sim.peers.loopback import own_address

PATIENT = {"silence_s": 1.5, "watchdog_hz": 0.5, "start_timeout_s": 10.0}


def polyscope_x(**more):
    return ur_peer(robot_api_port=ROBOT_API_PORT, **more)


def moving(**more):
    return ur_moving(polyscope_x=True, **PATIENT, **more)


def test_polyscope_5_and_x_are_distinguished_by_what_answers():
    with ur_peer() as (five, _), polyscope_x() as (ten, _):
        assert isinstance(panel_of(five.address, ROBOT_API_PORT), DashboardPanel)
        assert isinstance(panel_of(ten.address, ROBOT_API_PORT), RobotApi)
    with pytest.raises(DeviceUnreachable, match="neither the dashboard server"):
        panel_of(own_address(), ROBOT_API_PORT)


@pytest.mark.parametrize(
    ("version", "reported"),
    [("5.0.107", {"robot_api", "polyscope", "model", "serial"}), ("3.1.6", {"robot_api"})],
)
def test_what_a_version_does_not_report_is_left_out(version, reported):
    with polyscope_x(robot_api_version=version) as (controller, _):
        identity = panel_of(controller.address, ROBOT_API_PORT).identity()
    assert set(identity) == reported
    assert identity.get("model", "UR5") == "UR5"


def test_local_mode_is_refused_with_where_to_switch():
    with polyscope_x() as (controller, _):
        controller.remote_control = False
        arm = URArm(controller.address, URSettings(robot_api_port=ROBOT_API_PORT))
        with pytest.raises(DeviceRefused, match="Remote"):
            arm.connect()


def test_a_stop_reaches_the_arm_over_the_robot_api_alone():
    def stop(arm, controller):
        arm._supervisor._stops._by_script = lambda port: None
        arm.stop()

    def then(_, controller):
        assert [e for e in controller.events if e.what == "robot api: stop"]

    halts_within(0.1, moving, stop, UR_FAR, then=then)


def test_a_stop_finds_its_way_after_the_connections_were_dropped():
    with moving() as (arm, controller, sim):
        controller.drop()
        arm.stop()
        assert halts_short_of(sim, UR_FAR)
        assert stays(sim)


def test_a_stop_that_is_refused_is_repeated_until_the_watchdog_stops_the_arm():
    with moving() as (arm, controller, sim):
        controller.faults.stops = Stops.REFUSED
        arm.stop()
        orders = [event for event in controller.events if event.what == "robot api: stop"]
        assert halts_short_of(sim, UR_FAR)
        assert len(orders) < len([e for e in controller.events if e.what == "robot api: stop"])


def test_recovering_from_a_protective_stop_obeys_the_five_second_rule():
    with moving() as (arm, controller, sim):
        recovers_by_the_five_second_rule(arm, controller, sim)


def test_a_switch_to_local_mode_stops_the_run():
    with moving() as (arm, controller, sim):
        controller.remote_control = False
        assert until(lambda: arm.state().motion is Motion.STOPPED_BY_FAULT)
        assert "local mode" in arm.state().fault
        # its watchdog stops it: in local mode it takes no orders
        assert halts_short_of(sim, UR_FAR)


def answering(body, status=b"200 OK"):
    """An HTTP server that answers everything with the same bytes."""

    def serve(link):
        with suppress(OSError):
            while link.recv(4096):
                head = b"HTTP/1.1 " + status + b"\r\nContent-Length: "
                link.sendall(head + str(len(body)).encode() + b"\r\n\r\n" + body)

    address = own_address()
    return address, Listener((address, ROBOT_API_PORT), serve)


@pytest.mark.parametrize(
    "body",
    [b"", b"[" * 100_000, b"null", b'{"info": {"version": 7}}', b"\xff\x00", b'{"info": []}'],
)
def test_another_web_server_is_no_robot_api(body):
    address, server = answering(body)
    try:
        with pytest.raises(DeviceUnreachable) as refused:
            RobotApi(address, ROBOT_API_PORT).version()
        assert str(refused.value).isprintable()
    finally:
        server.close()


def test_a_refusal_in_the_controllers_words_is_one_short_line():
    output = json.dumps({"message": "no\x1b[2J" + "a" * 5000, "details": "because"}).encode()
    address, server = answering(output, b"409 Conflict")
    try:
        refusal = RobotApi(address, ROBOT_API_PORT).unlock_protective_stop()
        assert refusal.isprintable()
        assert len(refusal) < 200
    finally:
        server.close()


def test_a_silent_robot_api_is_given_up():
    with polyscope_x() as (controller, _):
        controller.faults.mute = True
        begin_s = time.monotonic()
        with pytest.raises(DeviceUnreachable, match="robot API"):
            RobotApi(controller.address, ROBOT_API_PORT, 0.3).in_local_mode()
        assert time.monotonic() - begin_s < 1.0
        controller.faults.mute = False
