"""A GigE Vision camera on loopback whose pictures come from any `drivers.camera.Camera`.

What it does of the AIA GigE Vision Specification 2.0: discovery when asked by address, control
privilege with heartbeat expiry, register and memory access, test packets, one stream channel with
packet size, packet delay and resend. What it does not: events, actions, ForceIP, chunks, extended
ids, pending acknowledges.
"""

from __future__ import annotations

import contextlib
import ipaddress
import select
import socket
import struct
import threading
import time
from types import TracebackType

from drivers.camera import Camera, FocusSetting
from sim.peers.gige import features as ft
from sim.peers.gige import gvcp
from sim.peers.gige.behaviour import Behaviour
from sim.peers.gige.control import ControlPrivilege, Host
from sim.peers.gige.gvcp import Command, Refused, Status
from sim.peers.gige.gvsp import probe_packet
from sim.peers.gige.lens import Lens
from sim.peers.gige.registers import (
    CONTROL_PRIVILEGE,
    DISCOVERY_BYTES,
    TIMESTAMP_CONTROL,
    RegisterMap,
)
from sim.peers.gige.streamer import Faults, Streamer

_FIRE_TEST_PACKET = 0x80000000
_LATCH = 0x2


class GigEPeer:
    """The device; `start` powers it on, `kill` cuts the power, `close` does it politely.

    Parameters
    ----------
    source:
        Where pictures come from. Exposure, gain and focus are passed on to it; what it has of them
        at first is what the device has after power-on.
    width, height:
        Sensor size, pixels; `source` gives pictures of that size.
    address:
        Any loopback address (127.0.0.0/8); the control port is always 3956.
    focus_steps, focus_steps_s:
        Range and speed of the lens's stepper; None for a lens without one.
    link_bytes_s:
        Rate of the link; 125e6 is Gigabit Ethernet.
    """

    def __init__(
        self,
        source: Camera,
        width: int,
        height: int,
        *,
        address: str = "127.0.0.1",
        model: str = "SimulatedCamera",
        serial: str = "SIM-0001",
        focus_steps: int | None = 10000,
        focus_steps_s: float = 20000.0,
        link_bytes_s: float = 125e6,
        seed: int = 0,
    ) -> None:
        if not ipaddress.IPv4Address(address).is_loopback:
            raise ValueError(f"{address} is no loopback address: this device stays on loopback")
        self.address, self.faults = address, Faults()
        self._source, self._size = source, (width, height)
        self._names = (model, serial)
        self._focus = focus_steps, focus_steps_s
        self._at_power_on: tuple[dict[str, float], int | None] | None = None
        self._link, self._seed = link_bytes_s, seed
        self._thread: threading.Thread | None = None

    def start(self) -> GigEPeer:
        """Power on: default registers, nobody in control, block ids from one."""
        steps, steps_s = self._focus
        values, step = self._reset_source()
        features = ft.device_features(*self._size)
        features += ft.optic_features(steps) if steps is not None else ()
        self.registers = RegisterMap(features, self.address, *self._names)
        self.registers.set("ExposureTime", values["exposure_s"] * 1e6)
        self.registers.set("Gain", values["gain_db"])
        self.streamer = Streamer(self._source, self.address, self.faults, self._link, self._seed)
        lens = Lens(self._source, self.streamer.order, step or 0, steps_s)
        self._behaviour = Behaviour(self.registers, self.streamer, lens, self._source)
        self.registers.set_word(0x0D1C, self.streamer.port)
        self.control = ControlPrivilege()
        self._answered: dict[Host, tuple[gvcp.Request, bytes]] = {}
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((self.address, gvcp.PORT))
        self._powered = True
        self._thread = threading.Thread(target=self._serve, daemon=True, name="gige control")
        self._thread.start()
        return self

    def _reset_source(self) -> tuple[dict[str, float], int | None]:
        self._source.connect()
        if self._at_power_on is None:
            position = self._source.focus(FocusSetting("hold"))
            step = None if position is None else round(position)
            self._at_power_on = dict(self._source.configure()), step
        values, step = self._at_power_on
        self._source.configure(**values)
        if step is not None and self._focus[0] is not None:
            self._source.focus(FocusSetting("position", float(step)))
        return values, step

    def kill(self) -> None:
        """Cut the power: no answer, no packet, no goodbye. Idempotent."""
        if self._thread is None:
            return
        self._powered = False
        self.streamer.halt()
        self._thread.join()
        self._thread = None
        self._socket.close()
        self.streamer.close()

    close = kill

    def seize_control(self) -> None:
        """Another program takes the camera over, and keeps it until `release_control`."""
        self.control.seize()
        self.streamer.halt()

    def release_control(self) -> None:
        """Whoever controls the camera lets go."""
        self.control.release()
        self.streamer.halt()

    def __enter__(self) -> GigEPeer:
        return self.start()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None
    ) -> None:
        self.close()

    def _serve(self) -> None:
        while self._powered:
            ready, _, _ = select.select([self._socket], [], [], 0.02)
            if ready:
                packet, host = self._socket.recvfrom(2048)
                request = gvcp.parse(packet)
                if request and not self.faults.mute:
                    self._answer(request, host)
            self._expire_heartbeat()

    def _answer(self, request: gvcp.Request, host: Host) -> None:
        self.control.hear(host)
        former, answer = self._answered.get(host, (None, b""))
        if request != former:  # a host repeats a command whose answer is late: it is done once
            answer = self._result(request, host)
        if request.wants_answer:
            self._answered[host] = request, answer
            time.sleep(self.faults.answer_delay_s)
            with contextlib.suppress(OSError):
                self._socket.sendto(answer, host)

    def _result(self, request: gvcp.Request, host: Host) -> bytes:
        try:
            return gvcp.acknowledge(request, self._do(request, host))
        except Refused as refusal:
            return gvcp.acknowledge(request, status=refusal.status)
        except struct.error:
            return gvcp.acknowledge(request, status=Status.INVALID_PARAMETER)

    def _do(self, request: gvcp.Request, host: Host) -> bytes:
        payload = request.payload
        match request.command:
            case Command.DISCOVERY:
                return self.registers.read(0, DISCOVERY_BYTES)
            case Command.READ_REGISTER:
                return b"".join(self._read(at, 4) for (at,) in struct.iter_unpack(">I", payload))
            case Command.READ_MEMORY:
                at, _, count = struct.unpack(">IHH", payload)
                return payload[:4] + self._read(at, count)
            case Command.WRITE_REGISTER:
                pairs = list(struct.iter_unpack(">I4s", payload))
                for at, data in pairs:
                    self._write(at, data, host)
                return struct.pack(">HH", 0, len(pairs))
            case Command.WRITE_MEMORY:
                self._write(struct.unpack_from(">I", payload)[0], payload[4:], host)
                return struct.pack(">HH", 0, len(payload) - 4)
            case Command.PACKET_RESEND:
                self.streamer.resend(*gvcp.resend_range(payload))
                return b""
        raise Refused(Status.NOT_IMPLEMENTED)

    def _read(self, address: int, length: int) -> bytes:
        self._behaviour.refresh(self.registers.name_at(address))
        return self.registers.read(address, length)

    def _write(self, address: int, data: bytes, host: Host) -> None:
        if address == CONTROL_PRIVILEGE:
            return self._claim(int.from_bytes(data, "big"), host)
        self.control.require(host)
        feature, value = self.registers.feature_at(address, data)
        if feature is None:
            return self._write_bootstrap(address, int(value))
        if feature.locked_while_streaming and self.streamer.acquiring:
            raise Refused(Status.ACCESS_DENIED)
        if feature.kind != "command":
            self.registers.set(feature.name, value)
        self._behaviour.react(feature.name, value)
        return None

    def _claim(self, privilege: int, host: Host) -> None:
        self.control.claim(privilege, host)
        self.registers.set_word(CONTROL_PRIVILEGE, privilege)
        if self.control.holder is None:
            self.streamer.halt()

    def _expire_heartbeat(self) -> None:
        if self.control.expired(self.registers.word(ft.HEARTBEAT_TIMEOUT) / 1000):
            self.registers.set_word(CONTROL_PRIVILEGE, 0)
            self.streamer.halt()

    def _write_bootstrap(self, address: int, value: int) -> None:
        if address == TIMESTAMP_CONTROL and value & _LATCH:
            self.registers.latch_time(self.streamer.clock_ns())
        elif address == ft.STREAM_PACKET_SIZE:
            self.registers.set_word(address, value & 0xFFFF)
            if value & _FIRE_TEST_PACKET:
                host = self._behaviour.stream_host()
                self.streamer.send_raw(probe_packet(value & 0xFFFF), host)
        else:
            self.registers.set_word(address, value)
