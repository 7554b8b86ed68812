"""EGM feedback: while a program runs, the controller sends joints and pose over UDP.

Source: ABB, "Application manual, Externally Guided Motion"; protocol buffers as in its egm.proto.
"""

from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Callable
from typing import Protocol

import numpy as np
from ABBRobotEGM._egm_protobuf import egm_pb2
from scipy.spatial.transform import RigidTransform

from drivers.abb.units import millimetres, scalar_first
from drivers.arm import ArmState
from sim.peers.controller_faults import ControllerFaults

_PERIOD_S = 0.008
_HOST = "127.0.0.1"


class Controller(Protocol):
    """What the stream reports of its controller."""

    running: bool
    world_from_base: RigidTransform

    @property
    def faults(self) -> ControllerFaults:
        """What goes wrong with it."""

    @property
    def reported(self) -> Callable[[], ArmState]:
        """Returns the arm's state as the controller reports it."""


class EgmSender:
    """Sends one message a period from the controller's address to one port of this host."""

    def __init__(self, controller: Controller, address: str, port: int) -> None:
        self._controller = controller
        self._address, self._target = address, (_HOST, port)
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._send, name="egm", daemon=True)
        self._number = 0

    def start(self) -> None:
        """Begin to send."""
        self._thread.start()

    def close(self) -> None:
        """Send no more."""
        self._closing.set()
        if self._thread.is_alive():
            self._thread.join(timeout=1.0)

    def _send(self) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
            link.bind((self._address, 0))
            while not self._closing.wait(_PERIOD_S):
                if self._controller.running and not self._controller.faults.mute:
                    with contextlib.suppress(OSError):
                        link.sendto(self._message(), self._target)

    def _message(self) -> bytes:
        state = self._controller.reported()
        message = egm_pb2.EgmRobot()
        self._number += 1
        message.header.seqno = self._number
        message.header.tm = int((state.controller_t_s or 0.0) * 1000) % 2**32
        message.header.mtype = egm_pb2.EgmHeader.MSGTYPE_DATA
        joints = np.degrees(state.joints_rad or ())
        message.feedBack.joints.joints.extend(joints.tolist())
        pose = self._controller.world_from_base * state.base_from_flange
        x, y, z = millimetres(pose)
        position = message.feedBack.cartesian.pos
        position.x, position.y, position.z = x, y, z
        turn = message.feedBack.cartesian.orient
        turn.u0, turn.u1, turn.u2, turn.u3 = scalar_first(pose)
        message.motorState.state = egm_pb2.EgmMotorState.MOTORS_ON
        message.rapidExecState.state = egm_pb2.EgmRapidCtrlExecState.RAPID_RUNNING
        return bytes(message.SerializeToString())
