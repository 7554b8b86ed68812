"""The `camera` of a cell file: which driver, at which address, and the names of its features."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, PositiveInt, model_validator

from cell.storage.files.parts import Finite, Part, Positive
from cell.storage.incoming.limits import PICTURE_SIDE
from cell.storage.incoming.pictures import check_pixels


class Lens(Part):
    """The lens, as its barrel says."""

    focal_length_mm: Positive
    f_number: Positive = 4.0


Side = Annotated[int, Field(gt=0, le=PICTURE_SIDE)]


class CameraBody(Part):
    """The room that camera, lens and cable take: a box along the optical axis.

    It is placed by where the camera is (`layout.mounted`, or `layout.fixed` for a fixed camera),
    whose origin is the lens's entrance pupil.
    """

    width_m: Positive = 0.07
    """Along the picture's rows."""
    height_m: Positive = 0.07
    """Along its columns."""
    behind_m: Positive = 0.07
    """From the entrance pupil back to the camera's rear."""
    ahead_m: Positive = 0.03
    """From the entrance pupil to the front of the lens, with its light or shade."""
    cable_m: float = Field(default=0.03, ge=0)
    """Behind the camera: the plug, and the bend of the cable."""


class SimulatedCamera(Part):
    """A camera in this process, and what all cameras have in common."""

    driver: Literal["sim"]
    model: str | None = None
    width: Side
    height: Side
    pixel_size_um: Positive | None = None
    focus: Literal["auto", "manual", "motorised", "fixed"] | None = None
    focus_positions: tuple[Finite, ...] | None = Field(default=None, min_length=1, max_length=100)
    """Positions of a motorised focus drive, in its steps: a plan's views take them in turn."""
    lens: Lens | None = None
    body: CameraBody | None = None
    """Where it is not given: 7 x 7 cm across, 3 cm ahead of the pupil, and from there back to the
    flange, at most 10 cm."""

    @model_validator(mode="after")
    def _affordable(self) -> Self:
        check_pixels(self.width, self.height)
        return self

    @model_validator(mode="after")
    def _positions_of_a_drive(self) -> Self:
        if self.focus_positions is not None and self.focus != "motorised":
            raise ValueError("focus_positions needs focus: motorised")
        return self


class FeatureNamesFile(Part):
    """A vendor's own feature names, where they are not those of GenICam's SFNC."""

    exposure: str | None = None
    """Exposure time; ExposureTime or ExposureTimeAbs where it is not given."""
    exposure_unit_s: Positive = 1e-6
    """Seconds in one unit of it."""
    gain: str | None = None
    """Gain; Gain where it is not given."""
    gain_is_factor: bool = False
    """The gain is a linear factor and not in dB."""
    temperature: str | None = None
    """Temperature of the camera, °C; DeviceTemperature where it is not given."""
    focus_selector: str | None = None
    """Which lens controller; OpticControllerSelector where it is not given."""
    focus_controller: str | None = None
    """The selector's entry, such as Optic1; left as it is where it is not given."""
    focus_position: str | None = None
    """Position of the focus drive, in its steps; FocusStepper where it is not given."""
    focus_auto: str | None = None
    """Automatic focus; FocusAuto where it is not given."""
    focus_status: str | None = None
    """Whether the lens is ready; FocusStatus or OpticControllerStatus where it is not given."""


class GenicamOptionsFile(SimulatedCamera):
    """What all cameras with GenICam features have in common."""

    driver: Literal["gige", "genicam"]  # type: ignore[assignment]
    pixel_format: str = "Mono8"
    features: dict[str, str | float | int | bool] = Field(default_factory=dict)
    """GenICam features to set once at start, by name."""
    software_trigger: bool = True
    """False for a camera that cannot be triggered and streams by itself."""
    feature_names: FeatureNamesFile = FeatureNamesFile()


class GigeCamera(GenicamOptionsFile):
    """A GigE Vision camera, through Aravis."""

    driver: Literal["gige"]
    address: str
    """IP address of the camera."""
    packet_bytes: int | None = Field(default=None, ge=576, le=16384)
    """Stream packet size with IP and UDP headers; what the network carries where it is null."""


class GenicamCamera(GenicamOptionsFile):
    """A camera behind a GenTL producer (CoaXPress grabbers), through harvesters."""

    driver: Literal["genicam"]
    producer: Path
    """The vendor's .cti file."""
    serial: str | None = None
    """Serial number; where it is not given the producer must show one camera only."""


class RobotiqCamera(SimulatedCamera):
    """A Robotiq wrist camera, over HTTP."""

    driver: Literal["robotiq"]  # type: ignore[assignment]
    address: str
    """The robot's address, with `:port` where it is not 4242."""
    display_size: tuple[PositiveInt, PositiveInt] | None = None
    """Width and height to ask the server for; pictures are taken as they come where it is null."""


CameraFile = Annotated[
    SimulatedCamera | GigeCamera | GenicamCamera | RobotiqCamera, Field(discriminator="driver")
]
