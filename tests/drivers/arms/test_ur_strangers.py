"""A Universal Robots controller, or whatever stands in its place, sends what it should not."""

import math
import socket
import struct
import time
from contextlib import contextmanager, suppress

import pytest
from benches import unreachable, until, ur_moving, ur_peer
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.errors import DeviceError, DeviceUnreachable
from drivers.ur.dashboard import DASHBOARD_PORT, Dashboard
from drivers.ur.kinematics_info import PRIMARY_PORT, read_kinematics
from drivers.ur.panel import StopOrder
from drivers.ur.plausible import implausible
from drivers.ur.reader import OUTPUTS, RtdeReader
from drivers.ur.stop_paths import StopPaths
from drivers.ur.wire import RTDE_PORT, Frame, Recipe, encode
from sim.peers.listener import Listener
from sim.peers.loopback import own_address

TYPES = ["DOUBLE"] + ["VECTOR6D"] * 5 + ["UINT32", "INT32", "UINT32"]
A_WHILE_S = 20.0


@contextmanager
def answering(port, serve):
    """A server in a controller's place; `serve` gets each connection."""

    def guarded(link):
        with suppress(OSError):
            serve(link)

    address = own_address()
    server = Listener((address, port), guarded)
    try:
        yield address
    finally:
        server.close()


def again_and_again(data, pause_s=0.01):
    def serve(link):
        deadline = time.monotonic() + A_WHILE_S
        while time.monotonic() < deadline:
            link.sendall(data)
            time.sleep(pause_s)

    return serve


def takes_s(call, error):
    begin_s = time.monotonic()
    with pytest.raises(error) as raised:
        call()
    return time.monotonic() - begin_s, str(raised.value)


@pytest.mark.parametrize(
    "data",
    [encode(Frame.TEXT_MESSAGE, b"\x03hello\x00\x01"), b"\x00", b"\xff\xff\x55"],
    ids=["other frames for ever", "a byte now and then", "a frame that takes for ever"],
)
def test_rtde_is_waited_for_no_longer_than_was_meant(data):
    with answering(RTDE_PORT, again_and_again(data, 0.05)) as address:
        duration_s, _ = takes_s(lambda: RtdeReader(address).connect(0.5), DeviceUnreachable)
    assert duration_s < 1.5


@pytest.mark.parametrize(
    ("types", "words"),
    [
        (["GARBAGE"] * 10, "unknown type for timestamp"),
        (TYPES[:4], "4 types for 10 names"),
        (["\udcff\x00"] * 10, "unknown type"),
    ],
)
def test_a_recipe_that_cannot_be_is_refused_by_name(types, words):
    def serve(link):
        link.recv(4096)
        link.sendall(encode(Frame.REQUEST_PROTOCOL_VERSION, b"\x01"))
        link.recv(4096)
        listed = ",".join(types).encode(errors="surrogateescape")
        link.sendall(encode(Frame.SETUP_OUTPUTS, b"\x01" + listed))
        link.recv(4096)

    with answering(RTDE_PORT, serve) as address:
        _, output = takes_s(lambda: RtdeReader(address).connect(1.0), DeviceError)
    assert words in output


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("timestamp", math.nan, "timestamp is not finite"),
        ("actual_TCP_pose", (math.inf, *(0.0,) * 5), "actual_TCP_pose is not finite"),
        ("actual_q", (math.nan,) * 6, "actual_q is not finite"),
        ("actual_qd", (0.0, math.nan, *(0.0,) * 4), "actual_qd is not finite"),
        ("tcp_offset", (0.0, 0.0, 1e9, 0.0, 0.0, 0.0), "m away"),
        ("actual_q", (0.0, 90.0, *(0.0,) * 4), "outside what the joints can turn"),
        ("runtime_state", 77, "runtime_state 77 is unknown"),
    ],
)
def test_values_that_cannot_be_are_refused_by_name_and_stop_the_arm(name, value, words):
    with ur_moving(silence_s=1.5, watchdog_hz=0.5, start_timeout_s=10.0) as (arm, controller, _):
        true_outputs = controller.read_outputs
        controller.read_outputs = lambda: {**true_outputs(), name: value}
        assert until(lambda: unreachable(arm))
        with pytest.raises(DeviceUnreachable, match=words):
            arm.state()
        assert until(lambda: any(e.what == "dashboard: stop" for e in controller.events))


@pytest.mark.parametrize(
    ("data", "words"),
    [(b"x" * 5000, "without an end"), (b"x", "timed out")],
    ids=["an endless line", "a byte now and then"],
)
def test_the_dashboard_is_waited_for_no_longer_than_was_meant(data, words):
    with answering(DASHBOARD_PORT, again_and_again(data, 0.002)) as address:
        duration_s, output = takes_s(lambda: Dashboard(address).ask("stop", 0.4), DeviceUnreachable)
    assert duration_s < 1.2
    assert words in output
    assert "xxx" not in output


def test_a_line_that_nobody_asked_for_is_no_answer():
    def serve(link):
        link.sendall(b"Connected: Universal Robots Dashboard Server\nfalse\nfalse\n")
        for line in link.makefile("r"):
            link.sendall(f"answer to {line}".encode())

    with answering(DASHBOARD_PORT, serve) as address:
        dashboard = Dashboard(address)
        for question in ("robotmode", "is in remote control"):
            assert dashboard.ask(question, 1.0) == f"answer to {question}"
        dashboard.close()


def test_a_dashboards_control_characters_and_length_end_at_the_driver():
    def serve(link):
        link.sendall(b"hello\n")
        link.recv(100)
        link.sendall(b"\x1b[2Jred\x00\xff" + b"a" * 3000 + b"\n")

    with answering(DASHBOARD_PORT, serve) as address:
        output = Dashboard(address).ask("robotmode", 1.0)
    assert output.isprintable()
    assert len(output) < 200


def test_a_stop_does_not_wait_for_a_dashboard_that_never_ends():
    with answering(DASHBOARD_PORT, again_and_again(b"y" * 65536, 0.0)) as address:
        paths = StopPaths(
            address, 5.0, StopOrder("dashboard", DASHBOARD_PORT, b"stop\n", b"power off\n")
        )
        paths.open()
        time.sleep(0.2)
        begin_s = time.monotonic()
        assert "dashboard" in paths.order()
        assert time.monotonic() - begin_s < 0.1
        paths.close()


def package(kind, body):
    return struct.pack(">IB", len(body) + 5, kind) + body


def kinematics(*values):
    return package(16, package(5, struct.pack(">6I24dI", *range(6), *values, 2)))


@pytest.mark.parametrize(
    ("low", "high", "known"),
    [(-6.3, 6.3, True), (-math.inf, math.inf, True), (math.nan, 6.3, False), (6.3, -6.3, False)],
)
def test_joint_limits_are_ranges_bounded_or_not_and_cost_no_kinematics(low, high, known):
    shown = package(5, struct.pack(">6I24dI", *range(6), *[0.1] * 24, 2))
    limits = package(6, struct.pack(">12d", *[-6.3, 6.3] * 5, low, high))
    with answering(PRIMARY_PORT, again_and_again(package(16, shown + limits))) as address:
        found = read_kinematics(address)
    assert found.joint_limits_rad == (((-6.3, 6.3),) * 5 + ((low, high),) if known else None)


def test_kinematics_that_are_not_finite_are_refused_by_name():
    data = kinematics(*[0.1] * 23, math.nan)
    with answering(PRIMARY_PORT, again_and_again(data)) as address:
        _, output = takes_s(lambda: read_kinematics(address), DeviceError)
    assert "not finite" in output


@pytest.mark.parametrize("data", [b"\x00", package(20, b"hello"), package(16, b"")])
def test_the_primary_port_is_waited_for_no_longer_than_was_meant(data):
    with answering(PRIMARY_PORT, again_and_again(data, 0.05)) as address:
        begin_s = time.monotonic()
        assert read_kinematics(address, 0.4) is None
        assert time.monotonic() - begin_s < 1.2


def test_a_peer_as_it_should_be_is_believed():
    with ur_peer() as (controller, _):
        reader = RtdeReader(controller.address)
        reader.connect()
        assert implausible(reader.newest().values) is None
        assert read_kinematics(controller.address) is not None
        reader.close()


@given(st.binary(min_size=264, max_size=264))
@settings(max_examples=300, deadline=None)
def test_no_bytes_of_a_packet_raise_anything(body):
    recipe = Recipe(OUTPUTS, TYPES)
    wrong = implausible(recipe.unpack(body[: recipe.size]))
    assert wrong is None or wrong.isprintable()


def test_nobody_listens_is_reported_as_such():
    with socket.create_server((own_address(), 0)) as server:
        address = server.getsockname()[0]
    with pytest.raises(DeviceUnreachable, match="does not answer"):
        RtdeReader(address).connect(0.5)
