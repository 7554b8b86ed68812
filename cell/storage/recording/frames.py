"""`frames.jsonl`: one line per frame, whatever else it may carry."""

from __future__ import annotations

import json
import logging
import math
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError
from scipy.spatial.transform import RigidTransform, Rotation

from cell.errors import InputError
from cell.storage.files.yaml_model import plain

FILE_NAME = "frames.jsonl"

log = logging.getLogger(__name__)


def _finite(value: float) -> float:
    if not math.isfinite(value):
        raise ValueError("must be a finite number; write null for an unknown one")
    return value


Number = Annotated[float, AfterValidator(_finite)]


def _turnable(quaternion: tuple[float, ...]) -> tuple[float, ...]:
    norm = math.hypot(*quaternion)
    if not 0.9 < norm < 1.1:
        raise ValueError(f"is no unit quaternion (length {norm:.4g})")
    return quaternion


class PoseRecord(BaseModel):
    """A rigid transform as the files write it: metres, quaternion x, y, z, w."""

    model_config = ConfigDict(frozen=True, extra="allow")

    p_m: tuple[Number, Number, Number]
    q_xyzw: Annotated[tuple[Number, Number, Number, Number], AfterValidator(_turnable)]

    def transform(self) -> RigidTransform:
        """The pose as a rigid transform (the quaternion is brought to unit length)."""
        return RigidTransform.from_components(self.p_m, Rotation.from_quat(self.q_xyzw))

    @classmethod
    def of(cls, transform: RigidTransform) -> PoseRecord:
        """A rigid transform in the words of the files."""
        p_m, rotation = transform.as_components()
        return cls.model_validate(
            {"p_m": tuple(p_m.tolist()), "q_xyzw": tuple(rotation.as_quat().tolist())}
        )


class FrameRecord(BaseModel):
    """One line of `frames.jsonl`; every value but `frame` may be null, unknown keys are kept."""

    model_config = ConfigDict(frozen=True, extra="allow", use_attribute_docstrings=True)

    frame: int = Field(ge=0)
    image: str | None = None
    """Path of the picture, relative to the recording's folder."""
    t_s: Number | None = None
    base_from_flange: PoseRecord | None = None
    joints_rad: tuple[Number, ...] | None = None
    joint_velocity_rad_s: tuple[Number, ...] | None = None
    approach_joints_rad: tuple[Number, ...] | None = None
    station: str | int | None = None
    exposure_s: Number | None = None
    gain_db: Number | None = None
    focus_position: Number | None = None
    focus_distance_m: Number | None = None
    temperature_c: Number | None = None
    sharpness: Number | None = None

    def as_line(self) -> str:
        """The frame as one line of JSON, with its newline; keys never set are left out."""
        return json.dumps(self.model_dump(mode="json", exclude_unset=True)) + "\n"


def read_frames(path: Path) -> tuple[FrameRecord, ...]:
    """Read a `frames.jsonl`.

    A last line that is cut off is what a crash leaves: it is dropped with a warning.

    Raises
    ------
    InputError
        The file cannot be read, a line before the last is broken, a value does not fit, or two
        lines carry the same frame number; the message names file and line.
    """
    try:
        lines = path.read_bytes().split(b"\n")
    except OSError as fault:
        raise InputError(f"{path}: cannot be read: {fault.strerror}") from None
    numbered = [(number, line) for number, line in enumerate(lines, 1) if line.strip(b" \r\t\0")]
    frames: dict[int, FrameRecord] = {}
    for number, line in numbered:
        data = _parse(path, number, line, last=number == numbered[-1][0])
        if data is None:
            continue
        record = _record(path, number, data)
        if record.frame in frames:
            raise InputError(f"{path}:{number}: frame {record.frame} stands in the file twice")
        frames[record.frame] = record
    return tuple(frames.values())


def _parse(path: Path, number: int, line: bytes, *, last: bool) -> dict[str, Any] | None:
    try:
        data = json.loads(line)
        if not isinstance(data, dict):
            raise ValueError(f"a line must be one object {{...}}, not {type(data).__name__}")
    except ValueError as broken:
        if last:
            log.warning("%s:%d: the last line is cut off (a crash?); it is left out", path, number)
            return None
        raise InputError(
            f"{path}:{number}: is not a frame: {broken}. Mend or delete this line."
        ) from None
    return data


def _record(path: Path, number: int, data: dict[str, Any]) -> FrameRecord:
    try:
        return FrameRecord.model_validate(data)
    except ValidationError as invalid:
        frame = data.get("frame", "without a number")
        faults = [_fault(error) for error in invalid.errors()]
        raise InputError(
            "\n".join(f"{path}:{number}: frame {frame}: {fault}" for fault in faults)
        ) from None


def _fault(error: Any) -> str:
    name = ".".join(str(part) for part in error["loc"])
    if error["type"] == "missing":
        return f"{name} is missing"
    message = error["msg"].removeprefix("Value error, ")
    return f"{name}: {message} (got {plain(error['input'])!r})"
