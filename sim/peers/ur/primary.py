"""The controller's primary port, 30001: robot state packages out, URScript programs in.

Source: Universal Robots, "Remote Control Via TCP/IP", client interfaces: a package is int32 size,
uint8 type (16 robot state, 20 message); a robot state holds sub-packages of the same shape, of
which type 5 is the kinematics information and type 6 the configuration, which begins with each
joint's lower and upper limit.
"""

from __future__ import annotations

import contextlib
import socket
import struct
import threading
import time
from collections.abc import Callable
from typing import Protocol

from calib.chain.kinematics import ArmKinematics
from calib.views import FloatArray
from sim.peers.controller_faults import ControllerFaults

_PERIOD_S = 0.1
_MESSAGE, _ROBOT_STATE = 20, 16
_ROBOT_MODE, _KINEMATICS, _CONFIGURATION = 0, 5, 6
_REST_OF_CONFIGURATION = bytes(344)
"""Speeds, accelerations, defaults and kinematics once more: nobody here asks for them."""
_LINEARISED = 2


class Controller(Protocol):
    """What this port shows of its controller."""

    kinematics: ArmKinematics | None
    joint_limits_rad: FloatArray

    @property
    def faults(self) -> ControllerFaults:
        """What goes wrong with it."""


class PrimaryServer:
    """Sends robot states of one controller, and takes programs.

    Parameters
    ----------
    controller:
        Whose states.
    run_scripts:
        Runs whatever programs come in on a connection, until it ends.
    """

    def __init__(
        self, controller: Controller, run_scripts: Callable[[socket.socket], None]
    ) -> None:
        self._controller, self._run_scripts = controller, run_scripts

    def serve(self, link: socket.socket) -> None:
        """Send a version message, then a robot state ten times a second."""
        threading.Thread(target=self._listen, args=(link,), daemon=True).start()
        link.sendall(_package(_MESSAGE, struct.pack(">QBB", 0, 254, 3) + b"\x09URControl"))
        while True:
            if not self._controller.faults.mute:
                link.sendall(_package(_ROBOT_STATE, self._state()))
            time.sleep(_PERIOD_S)

    def _listen(self, link: socket.socket) -> None:
        with contextlib.suppress(OSError):
            self._run_scripts(link)

    def _state(self) -> bytes:
        mode = _package(_ROBOT_MODE, bytes(41))
        if self._controller.kinematics is None:
            return mode
        theta, d, a, alpha = self._controller.kinematics.dh[:, :4].T
        body = struct.pack(">6I24dI", *range(6), *theta, *a, *d, *alpha, _LINEARISED)
        limits = struct.pack(">12d", *self._controller.joint_limits_rad.ravel())
        return (
            mode
            + _package(_KINEMATICS, body)
            + _package(_CONFIGURATION, limits + _REST_OF_CONFIGURATION)
        )


def _package(kind: int, body: bytes) -> bytes:
    return struct.pack(">IB", len(body) + 5, kind) + body
