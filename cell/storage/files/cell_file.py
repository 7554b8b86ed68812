"""`cell.yaml`: the arm, the camera, the board, where things stand, and what the truth is.

The section `simulation` holds the truth of a simulated cell and is looked at by a dry run only;
`layout` is what a tape measure gives, good enough to plan poses and to refuse unsafe ones.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Final, Literal, Self

import numpy as np
from pydantic import (
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    model_serializer,
    model_validator,
)

from calib.views import FloatArray, Mount
from cell.storage.files.arm_description import adopt_description
from cell.storage.files.board_file import AprilGrid, Charuco, Chessboard
from cell.storage.files.camera_file import CameraFile
from cell.storage.files.parts import Box, Distance, Duration, Finite, Joints, Part, Pose, Positive
from cell.storage.files.yaml_model import read_model

SCHEMA: Final = "cell.cell/1"


class CellChessboard(Chessboard):
    """A chessboard; a key it does not know is an error."""

    model_config = ConfigDict(extra="forbid")


class CellCharuco(Charuco):
    """A ChArUco board; a key it does not know is an error."""

    model_config = ConfigDict(extra="forbid")


class CellAprilGrid(AprilGrid):
    """An AprilGrid; a key it does not know is an error."""

    model_config = ConfigDict(extra="forbid")


BoardFile = Annotated[CellChessboard | CellCharuco | CellAprilGrid, Field(discriminator="type")]


class SimulatedRobot(Part):
    """An arm in this process."""

    driver: Literal["sim"]
    model: str | None = None
    """Kinematic model: ur3, ur3e, ur5, ..., irb140, ...; null where it is unknown, for a cell that
    is simulated at logged poses and never moved. Not needed with `urdf`."""
    urdf: Path | None = None
    """Description of any other six-joint arm; relative to this file."""
    base: str = "base_link"
    """Link of `urdf` whose frame poses are given in; `base` for a Universal Robot."""
    flange: str = "tool0"
    """Link of `urdf` that is the tool flange."""
    payload_kg: float = Field(default=0.0, ge=0)
    """Mass of camera and bracket at the flange. Where it is given, an arm whose controller reports
    another one is not moved."""
    tcp: Pose | None = None
    """flange_from_tcp as it is set at the controller: an arm with another one is not moved. With
    null any will do, since it is taken out of every pose."""


class UniversalRobot(SimulatedRobot):
    """A Universal Robots controller: CB3, e-Series, or one with PolyScope X."""

    driver: Literal["ur"]  # type: ignore[assignment]
    address: str
    """Name or IP address of the controller."""
    upper_registers: bool = False
    """Use RTDE registers 24 to 47, where a fieldbus or another client holds the lower ones."""
    robot_api_port: int = Field(default=80, gt=0, lt=65536)
    """Where PolyScope X serves its robot API; PolyScope 5 has none."""


class AbbRobot(SimulatedRobot):
    """An ABB IRC5 controller with Robot Web Services."""

    driver: Literal["abb"]  # type: ignore[assignment]
    address: str
    """Name or IP address of the controller, with `:port` where it is neither 443 nor 80. HTTPS is
    spoken where the controller has it."""
    credentials_file: Path | None = None
    """A file of two lines, user name and password; where it is not given, they are taken from the
    environment: `CELL_ROBOT_USER` and `CELL_ROBOT_PASSWORD`."""
    factory_password: bool = False
    """Log in as `Default User` with the password that every controller is delivered with."""
    certificate_sha256: str | None = Field(default=None, pattern=r"^[0-9A-Fa-f:]{64,95}$")
    """Fingerprint of the controller's certificate that you compared and trust; needed for HTTPS."""
    link_watch: bool = True
    """The controller stops a motion by itself when this computer falls silent, for which
    `cell_watch.mod` must be loaded there; with false, a cut cable stops nothing."""
    egm_port: int | None = Field(default=None, gt=0, lt=65536)
    """UDP port of this computer where the controller's EGM feedback arrives; null for none."""

    @model_validator(mode="before")
    @classmethod
    def _without_password(cls, data: Any) -> Any:
        # a cell file is copied, mailed and put under version control
        if isinstance(data, Mapping) and {"user", "password"} & set(data):
            raise ValueError(
                "user and password do not belong in a cell file: set CELL_ROBOT_USER and"
                " CELL_ROBOT_PASSWORD, or name a `credentials_file`, or write"
                " `factory_password: true`"
            )
        return data

    @model_validator(mode="after")
    def _one_login(self) -> AbbRobot:
        if self.factory_password and self.credentials_file is not None:
            raise ValueError("has a credentials_file and factory_password: keep one of them")
        return self


RobotFile = Annotated[SimulatedRobot | UniversalRobot | AbbRobot, Field(discriminator="driver")]


class Layout(Part):
    """Where things stand, to a centimetre or two: for planning and for refusing unsafe moves."""

    mounted: Pose
    """flange_from_camera (eye in hand) or flange_from_board (eye to hand)."""
    fixed: Pose
    """base_from_board (eye in hand) or base_from_camera (eye to hand)."""
    home_deg: Joints
    """Joint angles to start from and to plan around."""
    distances_m: tuple[Distance, Distance]
    """Nearest and farthest distance of the board's centre from the camera worth planning."""
    alpha_px: Positive | None = None
    """The camera's scale factor to a few percent; from lens and pixel size where it is null."""


Range = tuple[Finite, Finite]


class JointLimits(Part):
    """Ranges of joints in degrees, low and high; those that are not named keep the maker's."""

    joint_1: Range | None = None
    joint_2: Range | None = None
    joint_3: Range | None = None
    joint_4: Range | None = None
    joint_5: Range | None = None
    joint_6: Range | None = None

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        for name, given in self.given().items():
            if not given[0] < given[1]:
                raise ValueError(f"{name}: {given[0]:g} is not below {given[1]:g}")
        return self

    def given(self) -> dict[str, Range]:
        """The ranges that are given, by the joint's name."""
        ranges = {name: getattr(self, name) for name in type(self).model_fields}
        return {name: value for name, value in ranges.items() if value is not None}

    def narrowed(self, limits_rad: FloatArray) -> FloatArray:
        """(6, 2) limits, each no wider than it was."""
        low, high = limits_rad.T.copy()
        for name, given in self.given().items():
            joint = int(name.removeprefix("joint_")) - 1
            low[joint] = max(low[joint], np.radians(given[0]))
            high[joint] = min(high[joint], np.radians(given[1]))
        return np.stack([low, high], axis=1)


class EffectFile(Part):
    """One effect by its name in the catalogue, with its values."""

    name: str
    law: str | None = None
    parameters: dict[str, Finite | tuple[Finite, ...]] = Field(default_factory=dict)
    """By name, with the unit in it; a list stands for the numbered parameters of that stem."""


class Noise(Part):
    """What scatters in the simulated cell; all are one-sigma."""

    corner_px: float = Field(default=0.0, ge=0)
    """Of detected corners, where corners are made without pictures."""
    arm_position_m: float = Field(default=0.0, ge=0)
    """Repeatability of the flange's position, per axis."""
    arm_rotation_rad: float = Field(default=0.0, ge=0)
    """Repeatability of the flange's rotation, per axis."""
    read_levels: float = Field(default=0.5, ge=0)
    """The sensor's read noise, in levels of an 8-bit image."""
    full_well_electrons: Positive | None = 10_000.0
    """Electrons at which a pixel is full; null for light without photon noise."""


class SimulatedLens(Part):
    """What the picture's sharpness follows from."""

    best_blur_px: float = Field(default=0.5, ge=0)
    """Blur at best focus, Gaussian sigma."""
    focus_distance_m: Distance | None = None
    """Where the lens stands focused at first; at the board, as the first pose sees it, if null."""
    nearest_focus_m: Distance = 0.1
    """Nearest distance of the focus drive."""


class Simulation(Part):
    """The truth of a simulated cell."""

    mounted: Pose
    """As in `layout`, exactly."""
    fixed: Pose
    """As in `layout`, exactly."""
    optics: dict[str, Finite]
    """Columns of the chain's optics: alpha_px, beta_px, skew_px, u0_px, v0_px, k1, k2, ...; with
    `equidistant: 1` a wide lens whose image grows with the angle (Kannala and Brandt, k1 to k4)."""
    effects: tuple[EffectFile, ...] = ()
    """What a plain model leaves out."""
    noise: Noise = Noise()
    lens: SimulatedLens = SimulatedLens()
    white_exposure_s: Duration = 0.012
    """Exposure at which a white board is just not saturated: how well the cell is lit."""
    seed: int = Field(default=0, ge=0)


class CellFile(Part):
    """The whole of a cell file."""

    schema_: Literal["cell.cell/1"] = Field(default=SCHEMA, alias="schema")
    name: str
    robot: RobotFile
    camera: CameraFile
    board: BoardFile
    mount: Mount = "eye_in_hand"
    layout: Layout | None = None
    workspace: Box | None = None
    """The arm's links and what it carries stay inside this box."""
    keep_out: tuple[Box, ...] = ()
    """They stay out of these: the board's stand, a cabinet, a post. A real arm
    is refused until the key is there, even if empty: `[]`."""
    no_workspace_because: str | None = Field(default=None, min_length=10)
    """Why nothing around this arm can be hit: with it, a real arm is moved without `workspace`."""
    joint_limits_deg: JointLimits | None = None
    """Narrower ranges of joints than the maker's: for cables, or a wrist that must not turn far."""
    floor_m: Finite | None = None
    """Height of the floor, or of the table, in the robot base; nothing goes below it."""
    carried: tuple[Box, ...] = ()
    """What else hangs on the flange, boxes in the flange's frame: bracket, lamp, cable. Where none
    is given, a rod of 4 cm from the flange to the camera (or the board) stands for the bracket."""
    clearance_m: float = Field(default=0.01, ge=0)
    """Nearer than this no body comes to another one; plans are designed with 2 cm more."""
    simulation: Simulation | None = None

    @model_serializer(mode="wrap")
    def _with_stated_keep_out(self, serialize: SerializerFunctionWrapHandler) -> dict[str, Any]:
        # that nothing is to be kept out of is something else than not having stated it
        data: dict[str, Any] = serialize(self)
        return data | ({"keep_out": []} if self.states_keep_out and not self.keep_out else {})

    @property
    def states_keep_out(self) -> bool:
        """Whether the file has the key, if only to say that there is nothing."""
        return "keep_out" in self.model_fields_set

    def as_mapping(self) -> dict[str, Any]:
        """Plain dicts and lists, keys as in the file, defaults left out."""
        data = self.model_dump(mode="json", by_alias=True, exclude_defaults=True)
        return {"schema": SCHEMA, **data}


def read_cell(path: Path) -> CellFile:
    """Read a cell file; raises `InputError` with every error in it."""
    return with_arm_known(path, read_model(path, CellFile, schema=SCHEMA))


def with_arm_known(path: Path, cell: CellFile) -> CellFile:
    """The cell with the arm of its `robot.urdf` known by a name; `path` is the file it is in.

    Raises `InputError` where the description cannot be used.
    """
    if cell.robot.urdf is None:
        return cell
    urdf = (path.parent / cell.robot.urdf).resolve()
    name = adopt_description(f"{path}: robot.urdf", urdf, cell.robot.base, cell.robot.flange)
    robot = cell.robot.model_copy(update={"model": name, "urdf": urdf})
    return cell.model_copy(update={"robot": robot})
