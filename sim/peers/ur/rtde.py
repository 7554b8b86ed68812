"""The controller's RTDE server, port 30004."""

from __future__ import annotations

import contextlib
import re
import socket
import struct
import threading
from dataclasses import dataclass, field
from typing import Protocol

from drivers.ur.wire import Frame, Recipe, Value, encode, receive
from sim.peers.ur.faults import URFaults
from sim.peers.ur.variables import OUTPUT_TYPES, nothing

_INPUTS = {"external_force_torque": "VECTOR6D"}
_REGISTER = re.compile(r"(input|output)_(int|double)_register_(\d+)")
_REGISTER_TYPES = {"int": "INT32", "double": "DOUBLE"}
_REGISTER_COUNT = 48


@dataclass
class _Client:
    """One connection: its recipes, and whether it asked for data."""

    link: socket.socket
    ignored: bool = False
    inputs: list[Recipe] = field(default_factory=list)
    outputs: Recipe | None = None
    started: bool = False
    lock: threading.Lock = field(default_factory=threading.Lock)

    def send(self, kind: int, payload: bytes = b"") -> None:
        with self.lock:
            self.link.sendall(encode(kind, payload))


class Controller(Protocol):
    """What this server reports of its controller, and where it writes."""

    version: tuple[int, int, int, int]
    faults: URFaults

    def write_inputs(self, values: dict[str, Value]) -> None:
        """Take an input package from a client."""


class RtdeServer:
    """Serves RTDE clients of one controller."""

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        self._clients: list[_Client] = []

    def serve(self, link: socket.socket) -> None:
        """Answer one client until it goes."""
        client = _Client(link, ignored=self._controller.faults.ignore_new_clients)
        self._clients.append(client)
        try:
            while True:
                kind, payload = receive(link)
                if not self._controller.faults.deaf and not client.ignored:
                    self._handle(client, kind, payload)
        finally:
            self._clients.remove(client)

    def publish(self, values: dict[str, Value]) -> None:
        """Send this cycle's data to everybody who asked for it."""
        for client in list(self._clients):
            if client.started and client.outputs is not None:
                package = bytes([1]) + client.outputs.pack(_complete(client.outputs, values))
                with contextlib.suppress(OSError):
                    client.send(Frame.DATA_PACKAGE, package)

    def _handle(self, client: _Client, kind: int, payload: bytes) -> None:
        if kind == Frame.DATA_PACKAGE:
            # a client that did not get its registers may write to them all the same
            if 1 <= payload[0] <= len(client.inputs):
                recipe = client.inputs[payload[0] - 1]
                # ur-rtde 1.6.5 sends getForwardKinematics(q, [0] * 6) on a recipe of half the
                # length; what the recipe has no names for is taken as not there
                body = payload[1 : 1 + recipe.size]
                if len(body) == recipe.size:
                    self._controller.write_inputs(recipe.unpack(body))
            return
        answer = self._answer(client, kind, payload)
        if not self._controller.faults.mute:
            client.send(kind, answer)
        client.started = client.started or kind == Frame.START

    def _answer(self, client: _Client, kind: int, payload: bytes) -> bytes:
        if kind == Frame.GET_CONTROLLER_VERSION:
            return struct.pack(">4I", *self._controller.version)
        if kind == Frame.SETUP_OUTPUTS:
            return self._set_outputs(client, payload[8:])
        if kind == Frame.SETUP_INPUTS:
            return self._add_inputs(client, payload)
        return b"\x01"

    def _set_outputs(self, client: _Client, listed: bytes) -> bytes:
        names = _names(listed)
        types = [self._output_type(name) for name in names]
        if "NOT_FOUND" not in types:
            client.outputs = Recipe(names, types)
        return b"\x01" + ",".join(types).encode()

    def _add_inputs(self, client: _Client, listed: bytes) -> bytes:
        names = _names(listed)
        types = [self._input_type(client, name) for name in names]
        if not {"NOT_FOUND", "IN_USE"} & set(types):
            client.inputs.append(Recipe(names, types))
        return bytes([len(client.inputs)]) + ",".join(types).encode()

    def _output_type(self, name: str) -> str:
        unknown = name in self._controller.faults.missing_outputs
        return "NOT_FOUND" if unknown else _type_of(name, OUTPUT_TYPES)

    def _input_type(self, client: _Client, name: str) -> str:
        others = (other for other in self._clients if other is not client)
        taken = any(name in recipe.names for other in others for recipe in other.inputs)
        if taken or name in self._controller.faults.reserved_inputs:
            return "IN_USE"
        return _type_of(name, _INPUTS)


def _names(listed: bytes) -> list[str]:
    return [name for name in listed.decode().split(",") if name]


def _type_of(name: str, known: dict[str, str]) -> str:
    register = _REGISTER.fullmatch(name)
    if register and int(register.group(3)) < _REGISTER_COUNT:
        return _REGISTER_TYPES[register.group(2)]
    return known.get(name, "NOT_FOUND")


def _complete(recipe: Recipe, values: dict[str, Value]) -> dict[str, Value]:
    return {
        name: values[name] if name in values else nothing(OUTPUT_TYPES.get(name, ""))
        for name in recipe.names
    }
