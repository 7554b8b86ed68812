"""`calibration.json` as other verbs read it: what they need must be there, anything else may."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PositiveFloat,
    PositiveInt,
    ValidationError,
    model_validator,
)

from calib.paper.focus_law import LAWS
from calib.views import FloatArray
from cell.errors import InputError
from cell.storage.files.camera_numbers import CameraNumbers
from cell.storage.files.yaml_model import read_model
from cell.storage.incoming.text import read_json

SCHEMA = "cell.calibration/1"
PREFERENCE = (
    "joint_ml",
    "fixed_alpha_mle",
    "fixed_alpha_algebraic",
    "zhang_mle_no_skew",
    "zhang_mle",
    "zhang_algebraic",
)
"""Names of solutions, the one that knows most first."""
DISTORTION = (
    *("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
    *("s1", "s2", "s3", "s4", "tilt_x_rad", "tilt_y_rad"),
)
"""Coefficients in OpenCV's order, which ROS, mrcal and COLMAP share as far as they go."""


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="ignore", allow_inf_nan=False)


class Fitted(_Part):
    """A value with its one-sigma."""

    value: float
    sigma: float = 0.0


class LawSource(_Part):
    """How the focal length follows the distance."""

    law: str
    parameters: dict[str, Fitted]
    beta_parameters: dict[str, Fitted] = {}

    @property
    def moves(self) -> bool:
        """Whether the focal length is another one at another distance."""
        return self.law != "constant"

    def values(self) -> FloatArray:
        """(2,) the law's value far away and its bend; raises `InputError` for an unknown law."""
        names = LAWS.get(self.law)
        if names is None or not set(names) <= set(self.parameters):
            known = "; ".join(f"{law} with {', '.join(of)}" for law, of in LAWS.items())
            given = ", ".join(self.parameters)
            raise InputError(f"focus law {self.law} with {given} is not known; known are {known}")
        return np.array([self.parameters[name].value for name in names])


class CovarianceSource(_Part):
    """Covariance of the numbers fitted together."""

    names: tuple[str, ...]
    matrix: tuple[tuple[float, ...], ...]


class SolutionSource(CameraNumbers, _Part):
    """One camera model."""

    at_distance_m: float | None = None
    focus: LawSource | None = None
    sigma: dict[str, float] = {}
    covariance: CovarianceSource | None = None

    @property
    def wide(self) -> bool:
        """Whether the image is an equidistant one."""
        return self.projection == "equidistant"

    @property
    def distortion(self) -> tuple[float, ...]:
        """The fourteen coefficients of `DISTORTION`."""
        return tuple(float(getattr(self, name)) for name in DISTORTION)


class ZonesSource(_Part):
    """Where the focal length stands still."""

    near_limit_m: PositiveFloat
    far_limit_m: PositiveFloat
    alpha_px: PositiveFloat
    beta_px: PositiveFloat
    alpha_sigma_px: float = 0.0
    method: str = "tolerance"


class ScaleFactorSource(_Part):
    """Of one near-parallel view."""

    distance_m: PositiveFloat


class TransformSource(_Part):
    """A rigid transform."""

    p_m: tuple[float, float, float]
    q_xyzw: tuple[float, float, float, float]
    sigma_p_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    sigma_r_rad: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def matrix(self) -> FloatArray:
        """(4, 4)."""
        from scipy.spatial.transform import RigidTransform, Rotation

        rotation = Rotation.from_quat(self.q_xyzw)
        return RigidTransform.from_components(self.p_m, rotation).as_matrix()


class RobotSource(_Part):
    """What the joint fit found of robot and noise."""

    mount: Literal["eye_in_hand", "eye_to_hand"]
    source: Literal["joint", "hand_eye"]
    flange_sigma_m: PositiveFloat
    flange_sigma_rad: PositiveFloat
    corner_sigma_px: PositiveFloat


def _fitted_or_none(robot: Any) -> Any:
    """None for a robot that no fit describes."""
    return robot if isinstance(robot, dict) and robot.get("source") else None


class CrossValidationSource(_Part):
    """Whether other frames would have given the same."""

    factor: PositiveFloat = 1.0
    """How many times the stated sigmas the frames ask for."""


class _Device(_Part):
    """Which camera or robot it was."""

    model: str | None = None
    serial: str | None = None


class OriginSource(_Part):
    """When, by which program and of which devices it was made, as far as the file says."""

    recorded: str | None = None
    created: str | None = None
    program: str | None = None
    camera: _Device | None = None
    robot: _Device | None = None


class PlacementSource(_Part):
    """Where camera and board are, as far as it was determined."""

    recording: str = ""
    created: str | None = None
    undetermined: dict[str, str] = {}
    flange_from_camera: TransformSource | None = None
    base_from_board: TransformSource | None = None
    flange_from_board: TransformSource | None = None
    base_from_camera: TransformSource | None = None


class CalibrationSource(PlacementSource):
    """What a reader of `calibration.json` relies on."""

    schema_: Literal["cell.calibration/1"] = Field(alias="schema")
    image_size_px: tuple[PositiveInt, PositiveInt] | None = None
    distance_range_m: tuple[PositiveFloat, PositiveFloat] | None = None
    scale_factors: tuple[ScaleFactorSource, ...] = ()
    zones: ZonesSource | None = None
    focus_law: LawSource | None = None
    solutions: dict[str, SolutionSource]
    origin: OriginSource = OriginSource()
    robot: Annotated[RobotSource | None, BeforeValidator(_fitted_or_none)] = None
    cross_validation: CrossValidationSource | None = None

    @model_validator(mode="before")
    @classmethod
    def _with_origin(cls, data: Any) -> Any:
        """The file's own keys of its origin; `robot` has the fit's numbers beside them."""
        if not isinstance(data, dict):
            return data
        return data | {"origin": {key: data.get(key) for key in OriginSource.model_fields}}

    @property
    def range_m(self) -> tuple[float, float] | None:
        """Nearest and farthest distance calibrated, or None where nothing states."""
        if self.distance_range_m is not None:
            return self.distance_range_m
        seen = [factor.distance_m for factor in self.scale_factors]
        return (min(seen), max(seen)) if seen else None

    def recommended(self) -> str:
        """Name of the solution to use: the one that knows most.

        Raises
        ------
        InputError
            The file has none.
        """
        names = [n for n in (*PREFERENCE, *self.solutions) if n in self.solutions]
        if not names:
            raise InputError("the calibration has no solutions; run cell calibrate anew")
        return names[0]

    def solution(self, name: str) -> SolutionSource:
        """The solution of that name; raises `InputError` for one the file does not have."""
        if name not in self.solutions:
            raise InputError(
                f"the calibration has no solution {name}; it has {', '.join(self.solutions)}"
            )
        return self.solutions[name]


def read_calibration(path: Path) -> CalibrationSource:
    """Read a `calibration.json`.

    Raises
    ------
    InputError
        It cannot be read or is something else; with line and column of every error.
    """
    try:
        return CalibrationSource.model_validate(read_json(path))
    except ValidationError:
        # JSON is YAML, and the YAML reader knows line and column.
        return read_model(path, CalibrationSource, schema=SCHEMA)
