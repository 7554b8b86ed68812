"""Every kind of input that comes over a wire."""

from __future__ import annotations

import io
import json
import socket
import struct
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from benchmarks.fuzz.answers import Talk, answering
from benchmarks.fuzz.kind import REFUSED, Kind
from drivers.abb.egm_message import EgmDecoder, NotBelieved
from drivers.abb.login import FACTORY_LOGIN
from drivers.abb.readings import read_rws, world_from_base
from drivers.abb.rws import named, open_rws
from drivers.abb.settings import ABBSettings
from drivers.abb.status import failure_in_log, fault_in
from drivers.abb.transport import IRC5, OMNICORE, read_whole
from drivers.genicam_pixels import decode as decode_pixels
from drivers.robotiq_http import RobotiqHttp
from drivers.ur.dashboard import DASHBOARD_PORT, Dashboard
from drivers.ur.kinematics_info import PRIMARY_PORT, read_kinematics
from drivers.ur.robot_api import RobotApi
from drivers.ur.wire import Recipe, receive
from sim.peers.loopback import own_address

_TURN_RAD, _WAIT_S = 3.2, 0.5
_TYPE = "TYPE"
"""Where RWS 1.0 names what it reports."""
_UNUSED_AXIS = "8.999999488E9"


def wire() -> Iterator[Kind]:
    """All of them."""
    yield from _universal_robots()
    yield from _abb()
    yield from _cameras()


def _universal_robots() -> Iterator[Kind]:
    recipe = Recipe(["timestamp", "actual_q", "safety_mode"], ["DOUBLE", "VECTOR6D", "INT32"])
    package = recipe.pack({"timestamp": 1.0, "actual_q": (0.1,) * 6, "safety_mode": 1})
    yield Kind(
        "RTDE package",
        (package,),
        lambda _, data: recipe.unpack(data),
        (*REFUSED, struct.error),
    )
    frame = struct.pack(">HB", 3 + len(package), 85) + package
    yield Kind("RTDE frame", (frame,), lambda _, data: _received(data), (*REFUSED, OSError))
    address = own_address()
    yield Kind(
        "dashboard",
        (b"Connected: Universal Robots Dashboard Server\nRobotmode: RUNNING\n",),
        _at((address, DASHBOARD_PORT), lambda _: _dashboard(address), Talk.GREETS),
    )
    yield Kind(
        "UR primary port",
        (_kinematics(),),
        _at((address, PRIMARY_PORT), lambda _: read_kinematics(address, _WAIT_S), Talk.BROADCASTS),
    )
    reported = {"info": {"version": "5.0.107"}, "mode": "RUNNING", "marketingVersion": "10.14"}
    yield Kind(
        "robot API",
        (_http(json.dumps(reported).encode()),),
        _at(("127.0.0.1", 0), _robot_api, Talk.ANSWERS),
    )


def _dashboard(address: str) -> str:
    dashboard = Dashboard(address)
    try:
        return dashboard.ask("robotmode", _WAIT_S)
    finally:
        dashboard.close()


def _robot_api(port: int) -> object:
    api = RobotApi("127.0.0.1", port, _WAIT_S)
    try:
        return api.identity(), api.safety(), api.robot_mode(), api.in_local_mode()
    finally:
        api.close()


def _kinematics() -> bytes:
    body = struct.pack(">6I24dI", *range(6), *(0.1 * n for n in range(24)), 2)
    part = struct.pack(">IB", 5 + len(body), 5) + body
    return struct.pack(">IB", 5 + len(part), 16) + part


def _received(data: bytes) -> object:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        ours.settimeout(_WAIT_S)
        theirs.sendall(data[:60_000])
        theirs.shutdown(socket.SHUT_WR)
        return receive(ours)


def _abb() -> Iterator[Kind]:
    decoder = EgmDecoder([(-_TURN_RAD, _TURN_RAD)] * 6)
    yield Kind(
        "EGM datagram", (_egm(),), lambda _, data: decoder.decode(data), (NotBelieved, *REFUSED)
    )
    # one entry that answers all that is asked
    entry: dict[str, Any] = {"opmode": "AUTO", "ctrlstate": "motoron", "ctrlexecstate": "stopped"}
    entry |= {
        "_type": _TYPE,
        "cycle": "once",
        "_title": "/rw/elog/0/1",
        "msgtype": "3",
        "code": "80003",
    }
    entry |= {
        "argc": "1",
        "argv": [{"value": "Motion Program Failed"}],
        "tstamp": "2026-01-01 T  10:00:00",
    }
    entry |= {f"rax_{number}": f"{10.0 * number:.6f}" for number in range(1, 7)}
    entry |= {"x": "515.0", "y": "0.0", "z": "712.0"}
    entry |= {"q1": "0.5", "q2": "0.5", "q3": "-0.5", "q4": "0.5"}
    entry |= {"cf1": "0", "cf4": "0", "cf6": "0", "cfx": "0"}
    entry |= dict.fromkeys(("title", "desc", "conseqs", "causes", "actions"), "")
    for letter in "abcdef":
        entry |= {f"eax_{letter}": _UNUSED_AXIS, f"eax{letter}": _UNUSED_AXIS}
    one = {"_links": {}, "_embedded": {"_state": [entry]}}
    yield Kind("RWS 1.0", (json.dumps(one).encode(),), partial(_rws, IRC5))
    yield Kind("RWS 2.0", (json.dumps({"state": [entry]}).encode(),), partial(_rws, OMNICORE))


def _rws(generation: int, folder: Path, data: bytes) -> object:
    import requests

    def request(method: str, address: str, **more: Any) -> Any:
        response = requests.Response()
        kind = "ms-robtargets" if "robtarget" in address else "ms-jointtarget"
        answer = data.replace(_TYPE.encode(), kind.encode())
        response.status_code, response.raw = 200, io.BytesIO(answer)
        response.headers["content-type"] = "application/json"
        return read_whole(response, time.monotonic() + _WAIT_S)

    url = "http://127.0.0.1:1"
    rws = open_rws(url, ABBSettings(login=FACTORY_LOGIN), generation)
    rws._session.request = request  # noqa: SLF001 - as `open_rws` does
    limits_rad = [(-_TURN_RAD, _TURN_RAD)] * 6
    with named(url):
        fault = fault_in(rws), failure_in_log(rws) if generation == OMNICORE else None
        return (
            fault,
            rws.get_execution_state(),
            read_rws(rws, 0.0, limits_rad),
            world_from_base(rws),
        )


def _cameras() -> Iterator[Kind]:
    pixels = bytes(range(48)) * 4
    yield Kind(
        "GenICam buffer",
        (pixels,),
        lambda _, data: decode_pixels(data, 8, len(data) // 16, "Mono16"),
        (*REFUSED, ValueError),
    )
    grey = np.random.default_rng(0).integers(0, 255, (24, 32), dtype=np.uint8)
    picture = cv2.imencode(".jpg", grey)[1].tobytes()
    settings = json.dumps({"cameraSettings": {"exposure": {"value": 10}, "focus": 3}}).encode()
    yield Kind(
        "Robotiq server",
        (_http(picture), _http(settings)),
        _at(("127.0.0.1", 0), _robotiq, Talk.ANSWERS),
    )


def _robotiq(port: int) -> object:
    http = RobotiqHttp("127.0.0.1", port)
    try:
        settings = http.settings(time.monotonic() + _WAIT_S)
        return settings, None if settings else http.picture(time.monotonic() + _WAIT_S)
    finally:
        http.close()


def _at(
    address: tuple[str, int], ask: Callable[[int], object], talk: Talk
) -> Callable[[Path, bytes], object]:
    def reader(_: Path, data: bytes) -> object:
        with answering(address, data, talk) as port:
            return ask(port)

    return reader


def _http(body: bytes) -> bytes:
    return b"HTTP/1.1 200 OK\r\nContent-Length: %d\r\n\r\n" % len(body) + body


def _egm() -> bytes:
    from ABBRobotEGM._egm_protobuf import egm_pb2

    message = egm_pb2.EgmRobot()
    message.header.seqno, message.header.tm = 7, 1000
    message.header.mtype = egm_pb2.EgmHeader.MSGTYPE_DATA
    message.feedBack.joints.joints.extend([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    place = message.feedBack.cartesian
    place.pos.x, place.pos.y, place.pos.z = 500.0, 10.0, 600.0
    place.orient.u0, place.orient.u1, place.orient.u2, place.orient.u3 = 1.0, 0.0, 0.0, 0.0
    return bytes(message.SerializeToString())
