"""`verify.json` as a model: all that is written is checked against it."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import ConfigDict, Field, PositiveFloat

from cell.storage.files.provenance_part import ProvenancePart
from cell.storage.files.result_part import LeftOutPart, ResultPart

SCHEMA: Final = "cell.verify/1"
Probability = Annotated[float, Field(ge=0, le=1)]
NotNegative = Annotated[float, Field(ge=0)]
Vector = tuple[float, float, float]


class MountPart(ResultPart):
    """By how much the camera moved on its mount: an increment in the camera's own frame."""

    shift_m: Vector
    sigma_shift_m: Vector
    turn_rad: Vector
    """A rotation vector."""
    sigma_turn_rad: Vector


class AlphaPart(ResultPart):
    """By how much the focal length changed at a distance."""

    distance_m: PositiveFloat
    alpha_px: PositiveFloat
    """By the old calibration."""
    change_px: float
    sigma_px: NotNegative


class BoardPart(ResultPart):
    """Where the board is against where it was calibrated; moving it is no fault of the camera."""

    moved: bool
    p_value: Probability
    shift_m: NotNegative
    turn_rad: NotNegative


class NoisePart(ResultPart):
    """What these frames measured of noise, and what the old calibration had."""

    corner_px: PositiveFloat
    corner_before_px: PositiveFloat
    arm_scatter_ratio: NotNegative
    """Scatter of the flange now, over that of the calibration."""
    arm_p_value: Probability
    """Of a scatter as large by chance."""


class FramePart(ResultPart):
    """One frame: the board where it fits all frames best, everything else as calibrated."""

    frame: int
    distance_m: PositiveFloat
    rms_px: NotNegative
    sigma_px: NotNegative
    """One sigma of it by the uncertainties of calibration, arm and corners."""
    limit_px: NotNegative
    """What these uncertainties exceed once in a hundred times."""
    lateral_m: NotNegative
    workpiece_m: NotNegative
    """By which the robot would miss a part of the board's size that this picture locates."""


class DistancePart(ResultPart):
    """The misfit over a range of distances."""

    near_m: PositiveFloat
    far_m: PositiveFloat
    corners: int
    rms_px: NotNegative
    sigma_px: NotNegative
    limit_px: NotNegative
    worst_px: NotNegative
    worst_at_px: tuple[float, float]
    lateral_m: NotNegative


class ImagePart(ResultPart):
    """The misfit in a part of the image."""

    from_px: tuple[float, float]
    to_px: tuple[float, float]
    corners: int
    rms_px: NotNegative
    sigma_px: NotNegative
    limit_px: NotNegative
    mean_px: tuple[float, float]
    """What points one way is no noise."""
    lateral_m: NotNegative


class NoticeablePart(ResultPart):
    """The smallest changes these views would have shown nine times in ten."""

    shift_m: NotNegative
    turn_rad: NotNegative
    alpha_share: NotNegative
    workpiece_m: NotNegative
    tolerance_m: PositiveFloat
    """Above it the check is inconclusive."""


class LengthPart(ResultPart):
    """A known length measured with the old calibration: the error of length measurement."""

    known_m: PositiveFloat
    known_sigma_m: NotNegative
    corners: tuple[tuple[int, int], tuple[int, int]]
    """(row, col) of both ends."""
    frames: int
    measured_m: PositiveFloat
    error_m: float
    """Measured less known."""
    sigma_m: NotNegative
    """One sigma of the error, the known length's own included."""
    p_value: Probability


Verdict = Literal[
    "good",
    "within_tolerance",
    "moved",
    "lens_changed",
    "moved_and_lens_changed",
    "changed",
    "length_wrong",
    "cannot_tell",
]


class VerifyFile(ProvenancePart):
    """The whole of `verify.json`; metres, radians, pixels."""

    model_config = ConfigDict(populate_by_name=True)

    schema_: Literal["cell.verify/1"] = Field(alias="schema")
    calibration: str
    """File of the old calibration."""
    recording: str
    """Name of the recording it was held against."""
    verdict: Verdict
    """`within_tolerance`: it changed, by less than the tolerance that was given, and is still good.
    `changed`: it is not the camera that was calibrated, but these views do not show what
    changed."""
    sentence: str
    """The verdict in words."""
    p_value: Probability | None
    """That neither the camera's place nor its lens changed; null where nothing could be held
    against it."""
    frames_used: tuple[int, ...]
    frames_left_out: tuple[LeftOutPart, ...]
    mount: MountPart | None = None
    alpha: tuple[AlphaPart, ...] = ()
    board: BoardPart | None = None
    noise: NoisePart | None = None
    frames: tuple[FramePart, ...] = ()
    distances: tuple[DistancePart, ...] = ()
    image: tuple[ImagePart, ...] = ()
    noticeable: NoticeablePart | None = None
    length: LengthPart | None = None
    notes: tuple[str, ...] = ()
