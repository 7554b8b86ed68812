"""The controller's own kinematics: its factory-calibrated Denavit-Hartenberg parameters.

Source: Universal Robots, "Remote Control Via TCP/IP", primary client interface, port 30001: robot
state package (type 16), sub-packages 5 and 6 (configuration). Calibrated a and d may be hundreds of
metres long where axes are almost parallel: they are parameters of the chain, not lengths of links.
"""

from __future__ import annotations

import socket
import struct
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.errors import DeviceError
from drivers.outside import exactly

PRIMARY_PORT = 30001
_ROBOT_STATE, _KINEMATICS, _CONFIGURATION = 16, 5, 6
_HEADER = struct.Struct(">IB")
_BODY = struct.Struct(">6I6d6d6d6dI")
_LIMITS = struct.Struct(">12d")
_STATUS = {0: "not initialised", 1: "not linearised", 2: "linearised"}
_LONGEST_PACKAGE = 1 << 20


@dataclass(frozen=True)
class KinematicsInfo:
    """Denavit-Hartenberg parameters of the six joints, as the controller uses them.

    Attributes
    ----------
    theta_rad, a_m, d_m, alpha_rad:
        Six each, standard convention.
    checksum:
        The controller's six checksums; they distinguish one arm from another.
    calibration_status:
        ``linearised`` where a factory calibration is in force.
    joint_limits_rad:
        Six ranges of the safety settings, or None where they are not there or are no ranges.
    """

    theta_rad: tuple[float, ...]
    a_m: tuple[float, ...]
    d_m: tuple[float, ...]
    alpha_rad: tuple[float, ...]
    checksum: tuple[int, ...]
    calibration_status: str
    joint_limits_rad: tuple[tuple[float, float], ...] | None = None

    def flange_positions_m(self, joints_rad: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return (N, 3) flange positions in the base for (N, 6) joint angles."""
        pose = np.broadcast_to(np.eye(4), (len(joints_rad), 4, 4))
        for i in range(6):
            pose = pose @ self._link(i, joints_rad[:, i])
        return np.asarray(pose[:, :3, 3])

    def _link(self, i: int, joint_rad: NDArray[np.float64]) -> NDArray[np.float64]:
        angle = joint_rad + self.theta_rad[i]
        c, s = np.cos(angle), np.sin(angle)
        ca, sa = np.cos(self.alpha_rad[i]), np.sin(self.alpha_rad[i])
        link = np.zeros((len(angle), 4, 4))
        link[:, 0, :] = np.stack([c, -s * ca, s * sa, self.a_m[i] * c], axis=-1)
        link[:, 1, :] = np.stack([s, c * ca, -c * sa, self.a_m[i] * s], axis=-1)
        link[:, 2, 1:] = sa, ca, self.d_m[i]
        link[:, 3, 3] = 1.0
        return link


def read_kinematics(host: str, timeout_s: float = 1.0) -> KinematicsInfo | None:
    """Return what the primary port states, or None where it sends nothing within the time-out.

    Raises `DeviceError` for kinematics that are not finite.
    """
    deadline = time.monotonic() + timeout_s
    try:
        with socket.create_connection((host, PRIMARY_PORT), timeout_s) as link:
            while True:
                found = _find(_package(link, deadline))
                if found is not None:
                    return _checked(host, found)
    except (OSError, struct.error):
        return None


def _package(link: socket.socket, deadline: float) -> tuple[int, bytes]:
    size, kind = _HEADER.unpack(exactly(link, _HEADER.size, deadline))
    if not _HEADER.size <= size <= _LONGEST_PACKAGE:
        raise ConnectionError(f"a package claims a size of {size} bytes")
    return kind, exactly(link, size - _HEADER.size, deadline)


def _checked(host: str, found: KinematicsInfo) -> KinematicsInfo:
    tables = (found.theta_rad, found.a_m, found.d_m, found.alpha_rad)
    if not np.isfinite(tables).all():
        raise DeviceError(
            f"UR controller {host}: the kinematics on port {PRIMARY_PORT} are not finite. Restart "
            "the controller; if it goes on, its calibration file is damaged"
        )
    return found


def _find(package: tuple[int, bytes]) -> KinematicsInfo | None:
    kind, body = package
    parts = _parts(body) if kind == _ROBOT_STATE else {}
    if _KINEMATICS not in parts:
        return None
    values = _BODY.unpack_from(parts[_KINEMATICS])
    theta, a, d, alpha = (values[i : i + 6] for i in range(6, 30, 6))
    status = _STATUS.get(values[30], f"status {values[30]}")
    limits = _limits(parts.get(_CONFIGURATION, b""))
    return KinematicsInfo(theta, a, d, alpha, values[:6], status, limits)


def _limits(configuration: bytes) -> tuple[tuple[float, float], ...] | None:
    """Each joint's range; unbounded where it turns without end (wrist 3 of a UR3)."""
    if len(configuration) < _LIMITS.size:
        return None
    flat = _LIMITS.unpack_from(configuration)
    limits = tuple(zip(flat[::2], flat[1::2], strict=True))
    return limits if all(low < high for low, high in limits) else None


def _parts(body: bytes) -> dict[int, bytes]:
    """Sub-packages of a robot state, by their number."""
    found: dict[int, bytes] = {}
    at = 0
    while at + _HEADER.size <= len(body):
        size, part = _HEADER.unpack_from(body, at)
        if size < _HEADER.size:
            break
        found[part] = body[at + _HEADER.size : at + size]
        at += size
    return found
