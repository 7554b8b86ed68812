"""`calibration.json` as a model: all that is written is checked against it."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import ConfigDict, Field, PositiveFloat

from cell.storage.files.camera_numbers import CameraNumbers
from cell.storage.files.provenance_part import DevicePart, OriginPart
from cell.storage.files.result_part import LeftOutPart, ResultPart

Vector = tuple[float, float, float]
Sigma = Annotated[float, Field(ge=0)]


class ScaleFactorPart(ResultPart):
    """Scale factors of one view nearly parallel to the board (the paper's Eqs. 14, 15)."""

    frame: int
    distance_m: PositiveFloat
    """Depth of the board's centre along the optical axis, from the robot."""
    alpha_px: PositiveFloat
    alpha_sigma_px: Sigma
    """One sigma, without the error common to all distances."""
    beta_px: PositiveFloat
    beta_sigma_px: Sigma
    tilt_rad: float


class ZonesPart(ResultPart):
    """Where the focal length stands still (zone 2)."""

    near_limit_m: PositiveFloat
    near_sigma_m: float | None
    """Null where the limit is no change point."""
    far_limit_m: PositiveFloat
    near_is_bound: bool
    """True where the zone reaches at least to the nearest view."""
    far_is_bound: bool
    alpha_px: PositiveFloat
    alpha_sigma_px: Sigma
    beta_px: PositiveFloat
    beta_sigma_px: Sigma
    method: Literal["change_point", "tolerance", "constant"]
    why: str


class ParameterPart(ResultPart):
    """A fitted number."""

    value: float
    sigma: Sigma
    unit: str


class CandidateLaw(ResultPart):
    """A law that was fitted; of AICc and BIC only differences mean something."""

    law: str
    aicc: float | None
    bic: float
    scatter: Sigma
    """Standard deviation of the weighted residuals; 1 where the sigmas explain all."""
    parameters: dict[str, ParameterPart]


class FocusLawPart(ResultPart):
    """How alpha moves with distance."""

    law: str
    parameters: dict[str, ParameterPart]
    beta_parameters: dict[str, ParameterPart]
    """The same law fitted to beta; the names are alpha's."""
    why: str
    decisive: bool
    candidates: tuple[CandidateLaw, ...]


class Reprojection(ResultPart):
    """Residuals, detected minus predicted: signed statistics of the components, rms per corner."""

    mean: float
    median: float
    std: Sigma
    rms: Sigma


class PositionStatistics(ResultPart):
    """Computed camera in the true camera's frame, metres; z forward, positive is too close."""

    mean: Vector
    std: Vector
    rms: Sigma


class PositionErrorPart(PositionStatistics):
    """Against the robot through the transforms of the joint fit."""

    own_hand_eye: PositionStatistics | None
    """Against transforms solved from this solution alone: a constant error disappears in them."""
    robot_in_it: bool
    """True where the solution was made with the robot's distances: its z against that same robot
    is small by construction."""


class Consistency(ResultPart):
    """How far this solution's poses and the robot's disagree after hand-eye on them."""

    rms_m: Sigma
    rms_rad: Sigma


class FocusPart(ResultPart):
    """How alpha and beta follow the distance by this solution's own fit."""

    law: Literal["inverse_square", "thin_lens"]
    parameters: dict[str, ParameterPart]


class CovariancePart(ResultPart):
    """Covariance of the numbers fitted together, in the units their names state.

    Transforms are freed by increments (x, y, z, rx, ry, rz) in their second-named frame. Where
    the focus moves, alpha and beta are the law's own, far away.
    """

    names: tuple[str, ...]
    matrix: tuple[tuple[float, ...], ...]


class DomainPart(ResultPart):
    """Where a camera may be asked: angles off its axis."""

    invertible_angle_rad: PositiveFloat
    """Up to here every direction has a pixel of its own; beyond, the distortion folds."""
    supported_angle_rad: PositiveFloat
    """Up to here corners were used: beyond, the distortion is an extrapolation."""


class SolutionPart(ResultPart, CameraNumbers):
    """One camera model."""

    # in the place that the camera has given them, but never left away
    skew_px: float
    k1: float
    k2: float
    domain: DomainPart | None = None
    at_distance_m: float | None
    """Where alpha and beta move with distance: the distance they are given at."""
    focus: FocusPart | None = None
    sigma: dict[str, Sigma]
    covariance: CovariancePart | None = None
    reprojection_px: Reprojection
    camera_position_error_m: PositionErrorPart | None
    robot_consistency: Consistency | None


class TransformPart(ResultPart):
    """A rigid transform; the sigmas are of increments in the second-named frame."""

    p_m: Vector
    q_xyzw: tuple[float, float, float, float]
    sigma_p_m: Vector
    sigma_r_rad: Vector


class RobotPart(DevicePart):
    """Which robot, and what the fit with its poses found; null where there was no such fit."""

    mount: Literal["eye_in_hand", "eye_to_hand"] | None = None
    source: Literal["joint", "hand_eye"] | None = None
    focus_law: str | None = None
    focus_law_gain_aic: float | None = None
    flange_sigma_m: Sigma | None = None
    flange_sigma_rad: Sigma | None = None
    corner_sigma_px: Sigma | None = None
    outliers: tuple[int, ...] = ()
    """Frames whose logged pose disagrees with their picture."""


class WarningPart(ResultPart):
    """One thing that is known to be wrong or undetermined."""

    what: str
    where: str
    remedy: str


class WorkPieceErrorPart(ResultPart):
    """How far from its true place the arm would meet a part located by one picture, metres."""

    p95: Sigma
    """What 95 % of pictures stay below, with two sigma of what all pictures share."""
    rms: Sigma
    """RMS of the pictures, with one sigma of what they share."""
    each_picture_p95: Sigma
    each_picture_rms: Sigma
    calibration_sigma: Sigma | None
    """One sigma that all pictures share, at the worst distance; null without a joint fit."""
    against: str
    """What the pictures were held against."""


class AnswerPart(ResultPart):
    """For which distances the camera may be used, with what error at the work piece."""

    usable_distances_m: tuple[PositiveFloat, PositiveFloat] | None
    error_at_work_piece_m: WorkPieceErrorPart | None
    limits: tuple[str, ...]


class NotSeparable(ResultPart):
    """Quantities that the views see nearly only together."""

    quantities: tuple[str, ...]
    inflation: PositiveFloat
    """How many times worse the combination is known than its members would be, each alone."""
    separate_with: str
    """Views that would distinguish them."""
    gain: PositiveFloat
    """By what factor four such views lower the combination's uncertainty."""


class UncertaintyPart(ResultPart):
    """One sigma of the joint fit's camera where it is used: D distances, G places in the image.

    From the full covariance of lens, focus law and the camera's place on the robot; a next
    picture's corner noise and the robot's repeatability come on top.
    """

    distance_m: tuple[PositiveFloat, ...]
    """(D,) depths, the lens focused at each."""
    pixels_px: tuple[tuple[float, float], ...]
    """(G, 2) places in the image."""
    part_m: tuple[PositiveFloat, ...]
    """(D,) side of the part that is located: the board's, at most a fifth of the image."""
    projection_sigma_px: tuple[tuple[tuple[Sigma, Sigma], ...], ...]
    """(D, G, 2) along u and v: of where a thing appears that the robot has the place of."""
    workpiece_sigma_m: tuple[tuple[tuple[Sigma, Sigma, Sigma], ...], ...]
    """(D, G, 3) right, down, away: of where a part is for the robot, from one picture."""


class ChiSquarePart(ResultPart):
    """Square sum of misses in units of what is expected of them."""

    per_freedom: Sigma
    """One where the stated uncertainty is true."""
    freedom: PositiveFloat
    band: tuple[float, float]
    """Where it then lies at least 99 times in a hundred."""


class HeldOutPart(ResultPart):
    """Every frame, predicted by the fit that had no say of it; distances of corners, RMS."""

    rms_px: Sigma
    """From where the fit and the logged pose put them."""
    expected_px: Sigma
    """What corner noise, the robot's scatter and the fit's uncertainty would make."""
    expected_band_px: tuple[float, float]
    """Where `rms_px` then lies at least 99 times in a hundred."""
    robot: ChiSquarePart
    """Of the six numbers a frame that a free pose of the robot absorbs."""
    picture: ChiSquarePart
    """Of what the pictures show whatever the robot does."""


class EstimateMoved(ResultPart):
    """How far the fits without a fold are from the fit of all frames, in units of uncertainty."""

    quantity: str
    largest_z: Sigma
    """In sigmas of the difference: root of the fold's variance less that of all frames."""
    fold: int
    """Which fold was left out there."""
    factor: Sigma
    """RMS of the moves in all directions; about one where the stated sigma is right."""
    p_value: float
    """Of moves as large as these by chance."""
    drift_p_value: float
    """Of moves that grow as much from the earliest frames to the latest, by chance."""


class InfluentialFrame(ResultPart):
    """A frame without which an estimate would be another one, by more than chance."""

    frame: int
    quantity: str
    sigmas: Sigma
    """How far it moves, in sigmas of the fit of all frames."""
    z: Sigma
    """The same in sigmas of that move."""


class CrossValidationPart(ResultPart):
    """The joint fit repeated without each fold of its frames."""

    verdict: Literal["agree", "sigma_too_small", "single_frames"]
    why: str
    factor: PositiveFloat
    """How many times the stated sigmas the frames ask for; one where they do not."""
    folds: tuple[tuple[int, ...], ...]
    """Frames of each fold; the earliest of each distance in the first."""
    held_out: HeldOutPart
    estimates: tuple[EstimateMoved, ...]
    influential_frames: tuple[InfluentialFrame, ...]


class CornersLeftOut(ResultPart):
    """Corners of a used frame that lie too far off to be detections of the board."""

    frame: int
    corners: tuple[int, ...]
    """Counted row by row from the board's first corner."""


class CalibrationFile(OriginPart):
    """The whole of `calibration.json`; metres, radians, pixels."""

    model_config = ConfigDict(populate_by_name=True)

    schema_: Literal["cell.calibration/1"] = Field(alias="schema")
    recording: str
    answer: AnswerPart | None = None
    """What the report's first screen and the terminal say."""
    warnings: tuple[WarningPart, ...] = ()
    """What is known to be wrong or undetermined, what is undetermined first."""
    undetermined: dict[Literal["camera", "hand_eye"], str] = Field(default_factory=dict)
    """Parts that the data do not determine, and why; `cell export` refuses them."""
    image_size_px: tuple[int, int] | None = None
    """Width and height."""
    distance_range_m: tuple[PositiveFloat, PositiveFloat] | None = None
    """Nearest and farthest board centre in the frames used."""
    frames_used: tuple[int, ...]
    frames_rejected: tuple[LeftOutPart, ...]
    corners_left_out: tuple[CornersLeftOut, ...] = ()
    scale_factors: tuple[ScaleFactorPart, ...]
    zones: ZonesPart | None
    zones_reason: str | None
    focus_law: FocusLawPart | None
    solutions: dict[str, SolutionPart]
    flange_from_camera: TransformPart | None
    base_from_board: TransformPart | None
    flange_from_board: TransformPart | None
    """With a fixed camera: the board on the flange."""
    base_from_camera: TransformPart | None
    """With a fixed camera: the camera in the base."""
    robot: RobotPart | None
    uncertainty: UncertaintyPart | None = None
    """Null without a joint fit."""
    cross_validation: CrossValidationPart | None = None
    """Whether other frames would have given the same; null with a reason in `missing`."""
    not_separable: tuple[NotSeparable, ...] = ()
    """What the views of the joint fit cannot distinguish, the worst first."""
    missing: dict[str, str]
    """What could not be known, and why."""
