"""`recording.yaml`: what was recorded, of which board, with which robot and camera."""

from __future__ import annotations

from pathlib import Path
from shutil import copyfile
from typing import Annotated, Any, Final, Literal, Self

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, PositiveFloat, model_validator

from calib.views import Mount
from cell.storage.files.arm_description import COPY_NAME, adopt_description
from cell.storage.files.board_file import BoardFile
from cell.storage.files.camera_file import Side
from cell.storage.files.writing import yaml_text
from cell.storage.files.yaml_model import read_model
from cell.storage.incoming import inside
from cell.storage.incoming.pictures import check_pixels

SCHEMA: Final = "cell.recording/1"
FILE_NAME = "recording.yaml"


class _Part(BaseModel):
    """Recordings come from elsewhere too: keys this program does not know are kept."""

    model_config = ConfigDict(frozen=True, extra="allow", use_attribute_docstrings=True)


def _or_empty(value: Any) -> Any:
    return {} if value is None else value


class RecordedRobot(_Part):
    """The arm, as far as it is known."""

    model: str | None = None
    """Name of its kinematic model (`ur5e`, `irb140`, ...), or null."""
    urdf: Path | None = None
    """Description of an arm that has no name here, in the recording's folder."""
    base: str = "base_link"
    flange: str = "tool0"
    """Links of `urdf` that count as base and flange."""
    payload_kg: float | None = Field(default=None, ge=0)
    """Mass at the flange, or null."""


class RecordedCamera(_Part):
    """The camera, as far as it is known."""

    model: str | None = None
    width: Side | None = None
    height: Side | None = None
    pixel_size_um: PositiveFloat | None = None
    focus: Literal["auto", "manual", "motorised", "fixed"] | None = None

    @model_validator(mode="after")
    def _affordable(self) -> Self:
        check_pixels(self.width or 1, self.height or 1)
        return self


class Capture(_Part):
    """Whether the arm stood still or moved while the frames were taken."""

    mode: Literal["stop", "moving"] = "stop"


class Header(_Part):
    """The whole of `recording.yaml`."""

    schema_: Literal["cell.recording/1"] = Field(default=SCHEMA, alias="schema")
    name: str | None = None
    robot: Annotated[RecordedRobot, BeforeValidator(_or_empty)] = RecordedRobot()
    camera: Annotated[RecordedCamera, BeforeValidator(_or_empty)] = RecordedCamera()
    board: BoardFile
    mount: Mount = "eye_in_hand"
    capture: Annotated[Capture, BeforeValidator(_or_empty)] = Capture()
    images: str | None = None
    """Folder of the pictures, or null when only corners were kept."""
    simulated: bool = False
    """Whether arm and camera were simulated."""

    def as_mapping(self) -> dict[str, Any]:
        """Plain dicts and lists, keys as in the file."""
        return self.model_dump(mode="json", by_alias=True)


def read_header(folder: Path) -> Header:
    """Read a recording's `recording.yaml`; raises `InputError`."""
    path = folder / FILE_NAME
    header = read_model(path, Header, schema=SCHEMA)
    robot = header.robot
    if robot.urdf is None:
        return header
    urdf = inside(folder, str(robot.urdf), f"{path}: robot.urdf")
    name = adopt_description(f"{path}: robot.urdf", urdf, robot.base, robot.flange)
    return header.model_copy(update={"robot": robot.model_copy(update={"model": name})})


def write_header(folder: Path, header: Header) -> None:
    """Write a new `recording.yaml`, and a copy of the arm's description where it has one.

    Raises `FileExistsError` rather than overwrite a header.
    """
    if header.robot.urdf is not None:
        copyfile(header.robot.urdf, folder / COPY_NAME)
        robot = header.robot.model_copy(update={"urdf": Path(COPY_NAME)})
        header = header.model_copy(update={"robot": robot})
    with (folder / FILE_NAME).open("x", encoding="utf-8") as file:
        file.write(yaml_text(header.as_mapping()))
