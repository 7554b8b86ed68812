"""`recording.yaml`: what was recorded, of which board, with which robot and camera."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Final, Literal, Self

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, PositiveFloat, model_validator

from calib.views import Mount
from cell.storage.files.board_file import BoardFile
from cell.storage.files.camera_file import Side
from cell.storage.files.writing import yaml_text
from cell.storage.files.yaml_model import read_model
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
    return read_model(folder / FILE_NAME, Header, schema=SCHEMA)


def write_header(folder: Path, header: Header) -> None:
    """Write a new `recording.yaml`; raises `FileExistsError` rather than overwrite one."""
    with (folder / FILE_NAME).open("x", encoding="utf-8") as file:
        file.write(yaml_text(header.as_mapping()))
