"""The GigE Vision device itself, spoken to in bytes, without Aravis."""

from __future__ import annotations

import contextlib
import socket
import struct
import time
from collections.abc import Iterator
from xml.etree import ElementTree

import numpy as np
import pytest

from sim.peers.callable_camera import CallableCamera
from sim.peers.gige import GigEPeer
from sim.peers.loopback import own_address

READ_REGISTER, WRITE_REGISTER, READ_MEMORY = 0x80, 0x82, 0x84
CONTROL_PRIVILEGE, HEARTBEAT_MS, FIRST_URL = 0x0A00, 0x0938, 0x0200
STREAM_PORT, PACKET_SIZE, STREAM_ADDRESS = 0x0D00, 0x0D04, 0x0D18
SUCCESS, INVALID_ADDRESS, WRITE_PROTECT, ACCESS_DENIED = 0, 0x8003, 0x8004, 0x8006


class Host:
    """A program that speaks GVCP by hand."""

    def __init__(self, address: str) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.settimeout(2.0)
        self.socket.connect((address, 3956))
        self.request_id = 0

    def ask(self, command: int, payload: bytes = b"") -> tuple[int, bytes]:
        self.request_id += 1
        return self.ask_again(command, payload)

    def ask_again(self, command: int, payload: bytes = b"") -> tuple[int, bytes]:
        head = struct.pack(">BBHHH", 0x42, 1, command, len(payload), self.request_id)
        self.socket.send(head + payload)
        answer = self.socket.recv(4096)
        status, acknowledged, length, request_id = struct.unpack(">HHHH", answer[:8])
        assert (acknowledged, length, request_id) == (command + 1, len(answer) - 8, self.request_id)
        return status, answer[8:]

    def read(self, address: int) -> int:
        return int.from_bytes(self.ask(READ_REGISTER, struct.pack(">I", address))[1], "big")

    def write(self, address: int, value: int) -> int:
        return self.ask(WRITE_REGISTER, struct.pack(">II", address, value))[0]

    def memory(self, address: int, count: int) -> bytes:
        data = b""
        while len(data) < count:
            step = min(512, count - len(data))
            data += self.ask(READ_MEMORY, struct.pack(">IHH", address + len(data), 0, step))[1][4:]
        return data


@pytest.fixture
def peer() -> Iterator[GigEPeer]:
    source = CallableCamera(lambda _: np.zeros((64, 64), np.uint8))
    with GigEPeer(source, 64, 64, address=own_address(), model="M-1", serial="S-7") as made:
        yield made


@pytest.fixture
def host(peer: GigEPeer) -> Iterator[Host]:
    made = Host(peer.address)
    yield made
    made.socket.close()


def test_discovery_reports_model_and_serial_number(host: Host) -> None:
    status, payload = host.ask(0x0002)
    assert (status, len(payload)) == (SUCCESS, 0xF8)
    assert payload[0x68:0x6B] == b"M-1"
    assert payload[0xD8:0xDB] == b"S-7"


def test_the_description_is_xml_where_the_url_says_and_names_the_sfnc_features(host: Host) -> None:
    url = host.memory(FIRST_URL, 512).rstrip(b"\0").decode()
    _, at, length = url.removeprefix("Local:").split(";")
    root = ElementTree.fromstring(host.memory(int(at, 16), int(length, 16)).rstrip(b"\0"))
    names = {node.get("Name") for node in root}
    assert {"ExposureTime", "Gain", "TriggerSoftware", "PixelFormat", "FocusStepper"} <= names


def test_only_the_controller_may_write(peer: GigEPeer, host: Host) -> None:
    assert host.write(HEARTBEAT_MS, 1000) == ACCESS_DENIED
    assert host.write(CONTROL_PRIVILEGE, 2) == SUCCESS
    assert host.write(HEARTBEAT_MS, 1000) == SUCCESS
    other = Host(peer.address)
    assert other.write(CONTROL_PRIVILEGE, 2) == ACCESS_DENIED
    assert other.read(HEARTBEAT_MS) == 1000
    other.socket.close()


def test_a_command_that_is_repeated_for_a_late_answer_is_done_once(
    peer: GigEPeer, host: Host
) -> None:
    host.write(CONTROL_PRIVILEGE, 2)
    for name in ("TriggerMode", "TriggerSource", "AcquisitionStart"):
        value = {"TriggerMode": 1}.get(name, 0)
        assert host.write(peer.registers.address_of(name), value) == SUCCESS
    trigger = struct.pack(">II", peer.registers.address_of("TriggerSoftware"), 1)
    assert host.ask(WRITE_REGISTER, trigger)[0] == SUCCESS
    assert host.ask_again(WRITE_REGISTER, trigger)[0] == SUCCESS
    time.sleep(0.3)
    assert peer.streamer.frames_sent == 1
    assert host.ask(WRITE_REGISTER, trigger)[0] == SUCCESS
    time.sleep(0.3)
    assert peer.streamer.frames_sent == 2


def test_a_controller_that_falls_silent_loses_control(peer: GigEPeer, host: Host) -> None:
    host.write(CONTROL_PRIVILEGE, 2)
    host.write(HEARTBEAT_MS, 300)
    for _ in range(4):
        time.sleep(0.15)
        assert host.read(CONTROL_PRIVILEGE) == 2
    time.sleep(0.5)
    assert peer.control.holder is None
    assert host.read(CONTROL_PRIVILEGE) == 0


def test_what_is_not_there_or_read_only_is_refused(host: Host) -> None:
    host.write(CONTROL_PRIVILEGE, 2)
    assert host.ask(READ_MEMORY, struct.pack(">IHH", 0x00F00000, 0, 4))[0] == INVALID_ADDRESS
    assert host.write(0x0000, 5) == WRITE_PROTECT


def test_a_test_packet_has_the_size_asked_for_if_the_network_carries_it(
    peer: GigEPeer, host: Host
) -> None:
    receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    receiver.bind(("127.0.0.1", 0))
    receiver.settimeout(0.3)
    host.write(CONTROL_PRIVILEGE, 2)
    host.write(STREAM_ADDRESS, int.from_bytes(socket.inet_aton("127.0.0.1"), "big"))
    host.write(STREAM_PORT, receiver.getsockname()[1])
    peer.faults.largest_packet_bytes = 1500
    host.write(PACKET_SIZE, 0x80000000 | 1500)
    assert len(receiver.recv(9000)) == 1500 - 28
    host.write(PACKET_SIZE, 0x80000000 | 4000)
    with pytest.raises(TimeoutError):
        receiver.recv(9000)
    receiver.close()


def test_a_killed_device_answers_nothing_and_comes_back_forgetful(
    peer: GigEPeer, host: Host
) -> None:
    host.write(CONTROL_PRIVILEGE, 2)
    host.write(HEARTBEAT_MS, 777)
    peer.kill()
    host.socket.settimeout(0.2)
    with pytest.raises(OSError, match=r"timed out|refused"):
        host.read(HEARTBEAT_MS)
    peer.start()
    with contextlib.suppress(OSError):
        host.socket.recv(4096)
    assert host.read(HEARTBEAT_MS) == 3000


def test_the_device_stays_on_loopback() -> None:
    source = CallableCamera(lambda _: np.zeros((8, 8), np.uint8))
    with pytest.raises(ValueError, match="loopback"):
        GigEPeer(source, 64, 64, address="192.0.2.2")
