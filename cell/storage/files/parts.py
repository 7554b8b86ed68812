"""What plan and cell files are made of: strict frozen parts, numbers, poses, boxes."""

from __future__ import annotations

from typing import Annotated, Self

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator
from scipy.spatial.transform import RigidTransform, Rotation

from cell.storage.incoming.limits import DISTANCE_M, DURATION_S, MAGNITUDE, SMALLEST

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=SMALLEST, le=MAGNITUDE, allow_inf_nan=False)]
Duration = Annotated[float, Field(gt=SMALLEST, le=DURATION_S, allow_inf_nan=False)]
Distance = Annotated[float, Field(gt=SMALLEST, le=DISTANCE_M, allow_inf_nan=False)]
Point = tuple[Finite, Finite, Finite]
Joints = Annotated[tuple[Finite, ...], Field(min_length=6, max_length=6)]


class Part(BaseModel):
    """A part of a plan or cell file: frozen, and a key it does not know is an error."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", use_attribute_docstrings=True, populate_by_name=True
    )


def _unit(quaternion: tuple[float, ...]) -> tuple[float, ...]:
    norm = float(np.linalg.norm(quaternion))
    if abs(norm - 1.0) > 1e-3:
        raise ValueError(f"is no unit quaternion (length {norm:.4g})")
    return quaternion


Quaternion = Annotated[tuple[Finite, Finite, Finite, Finite], AfterValidator(_unit)]


class Pose(Part):
    """A rigid transform a_from_b: where b is in a."""

    p_m: Point
    """Origin of b in a, metres."""
    q_xyzw: Quaternion | None = None
    """Rotation as a unit quaternion, x y z w."""
    rpy_deg: Point | None = None
    """Rotation as roll, pitch, yaw about a's fixed x, y, z axes, degrees."""

    @model_validator(mode="after")
    def _one_rotation(self) -> Self:
        if (self.q_xyzw is None) == (self.rpy_deg is None):
            raise ValueError("needs a rotation: exactly one of q_xyzw and rpy_deg")
        return self

    def transform(self) -> RigidTransform:
        """The pose as a rigid transform."""
        if self.q_xyzw is not None:
            return RigidTransform.from_components(self.p_m, Rotation.from_quat(self.q_xyzw))
        turn = Rotation.from_euler("xyz", np.asarray(self.rpy_deg), degrees=True)
        return RigidTransform.from_components(self.p_m, turn)

    @classmethod
    def of(cls, transform: RigidTransform) -> Pose:
        """A rigid transform in the words of the files, rounded to what a file needs."""
        p_m, turn = transform.as_components()
        quaternion = turn.as_quat(canonical=True)
        return cls.model_validate(
            {
                "p_m": tuple(round(value, 6) for value in p_m.tolist()),
                "q_xyzw": tuple(round(value, 9) for value in quaternion.tolist()),
            }
        )


class Box(Part):
    """An axis-parallel box in the robot base, metres."""

    name: str = "box"
    low_m: Point
    high_m: Point

    @model_validator(mode="after")
    def _not_inside_out(self) -> Self:
        if not all(low < high for low, high in zip(self.low_m, self.high_m, strict=True)):
            raise ValueError("low_m must be below high_m along every axis")
        return self
