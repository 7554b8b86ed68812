"""One datagram of EGM feedback: decoded, and believed only where it makes sense.

Source: ABB, "Application manual, Externally Guided Motion"; protocol buffers as in its egm.proto.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from drivers.abb.plausible import implausible
from drivers.errors import DeviceRefused


class NotBelieved(ValueError):
    """A datagram that is no reading of this arm; the message says why, without its bytes."""


@dataclass(frozen=True)
class EgmMessage:
    """Joints and pose of one instant, in ABB's units.

    Attributes
    ----------
    number:
        Sequence number, modulo 2**32.
    clock_ms:
        The controller's time stamp, milliseconds modulo 2**32.
    joints_deg, mm, wxyz:
        Six joint angles; position and quaternion (scalar first) of tool0 in the world.
    """

    number: int
    clock_ms: int
    joints_deg: tuple[float, ...]
    mm: tuple[float, ...]
    wxyz: tuple[float, ...]


class EgmDecoder:
    """Decodes datagrams.

    Parameters
    ----------
    limits_rad:
        Lowest and highest angle of each joint, radians.

    Raises
    ------
    DeviceRefused
        The package with ABB's message definitions is not installed.
    """

    def __init__(self, limits_rad: Sequence[tuple[float, float]]) -> None:
        try:
            from ABBRobotEGM._egm_protobuf import egm_pb2
            from google.protobuf.message import DecodeError
        except ImportError as error:
            raise DeviceRefused(f"EGM: {error}: pip install 'calibration-cell[abb]'") from None
        self._egm_pb2, self._decode_error = egm_pb2, DecodeError
        self._limits_rad = limits_rad

    def decode(self, datagram: bytes) -> EgmMessage:
        """Return what a datagram says; raises `NotBelieved`."""
        robot = self._egm_pb2.EgmRobot()
        try:
            robot.ParseFromString(datagram)
        except self._decode_error:
            raise NotBelieved("it is no EGM message") from None
        if robot.header.mtype != self._egm_pb2.EgmHeader.MSGTYPE_DATA:
            raise NotBelieved("it is no EGM message with a reading")
        position, turn = robot.feedBack.cartesian.pos, robot.feedBack.cartesian.orient
        message = EgmMessage(
            robot.header.seqno,
            robot.header.tm,
            tuple(robot.feedBack.joints.joints),
            (position.x, position.y, position.z),
            (turn.u0, turn.u1, turn.u2, turn.u3),
        )
        wrong = implausible(message.joints_deg, message.mm, message.wxyz, self._limits_rad)
        if wrong is not None:
            raise NotBelieved(wrong)
        return message
