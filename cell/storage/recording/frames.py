"""`frames.jsonl`: one line per frame, whatever else it may carry."""

from __future__ import annotations

import json
import math
from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field
from scipy.spatial.transform import RigidTransform, Rotation

from cell.storage.incoming.limits import DISTANCE_M, FRAME_NUMBER, JOINTS, MAGNITUDE, REACH_M

FILE_NAME = "frames.jsonl"


def _finite(value: float) -> float:
    if not math.isfinite(value):
        raise ValueError("must be a finite number; write null for an unknown one")
    return value


Number = Annotated[float, AfterValidator(_finite), Field(ge=-MAGNITUDE, le=MAGNITUDE)]
Coordinate = Annotated[float, AfterValidator(_finite), Field(ge=-REACH_M, le=REACH_M)]
JointValues = Annotated[tuple[Number, ...], Field(max_length=JOINTS)]


def _turnable(quaternion: tuple[float, ...]) -> tuple[float, ...]:
    norm = math.hypot(*quaternion)
    if not 0.9 < norm < 1.1:
        raise ValueError(f"is no unit quaternion (length {norm:.4g})")
    return quaternion


class PoseRecord(BaseModel):
    """A rigid transform as the files write it: metres, quaternion x, y, z, w."""

    model_config = ConfigDict(frozen=True, extra="allow")

    p_m: tuple[Coordinate, Coordinate, Coordinate]
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

    frame: int = Field(ge=0, le=FRAME_NUMBER)
    image: str | None = None
    """Path of the picture, relative to the recording's folder."""
    t_s: Number | None = None
    base_from_flange: PoseRecord | None = None
    joints_rad: JointValues | None = None
    joint_velocity_rad_s: JointValues | None = None
    approach_joints_rad: JointValues | None = None
    station: str | int | None = None
    exposure_s: Number | None = None
    gain_db: Number | None = None
    focus_position: Number | None = None
    focus_distance_m: Annotated[Number, Field(gt=0, le=DISTANCE_M)] | None = None
    temperature_c: Number | None = None
    sharpness: Number | None = None

    def as_line(self) -> str:
        """The frame as one line of JSON, with its newline; keys never set are left out."""
        return json.dumps(self.model_dump(mode="json", exclude_unset=True)) + "\n"
