"""The binary motion programs of abb-motion-program-exec, as its RAPID interpreter reads them.

Little-endian float32 throughout: file version, tool, work object, grip load, time stamp, sequence
number, EGM mode, then for every command its number, its opcode and its parameters.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from calib.views import FloatArray
from drivers.abb.units import transform_of
from drivers.arm import MoveTarget

FILE_VERSION = 10011
MOVE_ABS_J, MOVE_J, MOVE_L, WAIT_TIME = 1, 2, 3, 5
_STRING = 9  # a length and 32 bytes, counted in float32
_TOOL, _WORK_OBJECT, _LOAD = 19, 2 + _STRING + 14, 11
_POSE, _CONFIGURATION, _EXTERNAL, _SPEED, _ZONE = 7, 4, 6, 4, 7


class BadProgram(ValueError):
    """The file is not a motion program that this interpreter knows."""


@dataclass(frozen=True)
class Wait:
    """A pause, seconds."""

    duration_s: float


Command = MoveTarget | Wait


class _Reader:
    def __init__(self, data: bytes) -> None:
        self._values = np.frombuffer(data, "<f4").astype(float)
        self._at = 0

    def take(self, count: int) -> FloatArray:
        values = self._values[self._at : self._at + count]
        if len(values) < count:
            raise BadProgram("the file ends in the middle of a command")
        self._at += count
        return values

    @property
    def ended(self) -> bool:
        return self._at >= len(self._values)


def decode(data: bytes) -> list[Command]:
    """Return the commands of a program; raises `BadProgram`."""
    reader = _Reader(data)
    version = reader.take(1)[0]
    if version != FILE_VERSION:
        raise BadProgram(f"file version {version:g} instead of {FILE_VERSION}")
    reader.take(_TOOL + _WORK_OBJECT + _LOAD + _STRING + 1)
    if reader.take(1)[0] != 0:
        raise BadProgram("externally guided motion is not simulated, only its feedback")
    commands: list[Command] = []
    while not reader.ended:
        _, opcode = reader.take(2)
        commands.append(_command(int(opcode), reader))
    return commands


def _command(opcode: int, reader: _Reader) -> Command:
    if opcode == WAIT_TIME:
        return Wait(float(reader.take(1)[0]))
    if opcode == MOVE_ABS_J:
        joints = np.radians(reader.take(6))
        reader.take(_EXTERNAL)
        return _with_speeds(MoveTarget(joints_rad=tuple(joints.tolist())), reader)
    if opcode in (MOVE_J, MOVE_L):
        pose = reader.take(_POSE)
        reader.take(_CONFIGURATION + _EXTERNAL)
        return _with_speeds(MoveTarget(base_from_flange=transform_of(pose[:3], pose[3:])), reader)
    raise BadProgram(f"unknown command {opcode}")


def _with_speeds(target: MoveTarget, reader: _Reader) -> MoveTarget:
    """Speed data bounds the tool (mm/s) and its turning (deg/s); zone data is not simulated."""
    tool_mm_s, turn_deg_s, *_ = reader.take(_SPEED)
    reader.take(_ZONE)
    return replace(
        target,
        tcp_speed_m_s=float(tool_mm_s) / 1000.0,
        joint_speed_rad_s=float(np.radians(turn_deg_s)),
    )
