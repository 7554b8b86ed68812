"""`diagnosis.json` as a model: all that is written is checked against it."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import Field

from cell.storage.files.provenance_part import ProvenancePart
from cell.storage.files.result_part import ResultPart

SCHEMA: Final = "cell.diagnosis/1"
Probability = Annotated[float, Field(ge=0, le=1)]
NotNegative = Annotated[float, Field(ge=0)]


class RejectedPart(ResultPart):
    """A frame left out."""

    frame: int
    reason: str


class ValuePart(ResultPart):
    """A number with its one-sigma uncertainty; zero sigma: given or exact."""

    value: float
    sigma: NotNegative
    unit: str


class HoldoutPart(ResultPart):
    """Whole frames that no fit has seen, predicted from the robot's log alone."""

    frames: list[int]
    rms_px_before: NotNegative
    """By the plain model."""
    rms_px_after: NotNegative
    """By the final one."""
    noise_px: NotNegative
    """What corner noise and the robot's scatter alone would make."""
    nll_before: float
    nll_after: float
    """Negative log likelihood per frame."""


class SplitPart(ResultPart):
    """Squared misfit in units of the noise, per degree of freedom: one where only noise is left."""

    pose: NotNegative
    """Of what a free camera pose could absorb: where focus and every fault of the arm hide."""
    picture: NotNegative
    """Of what it could not: seen in the pictures alone."""


class MisfitPart(ResultPart):
    """The misfit of the plain model and of the final one, judged by the final noise."""

    before: SplitPart
    after: SplitPart


class MismatchPart(ResultPart):
    """Where the misfit of the plain model lives."""

    link: str
    site: str
    """The constant of the chain that is none."""
    covariate: str
    where: str
    share_of_excess: Probability
    """Share of the squared misfit above the noise that a curve along the covariate takes away."""
    p_value: Probability


class EffectPart(ResultPart):
    """Named physics, or a mix-up in the log."""

    name: str
    link: str
    law: str | None
    physics: str
    remedy: str
    parameters: dict[str, ValuePart]
    p_value: Probability
    holdout_gain_px: float | None
    """How much worse the held-out frames are predicted without it; null for a mix-up in the log."""


class AmbiguityPart(ResultPart):
    """Names that these data cannot distinguish."""

    names: list[str]
    why: str
    experiment: str
    """What would distinguish them, as text."""
    separate_with: str | None
    """A plan file that would, beside this file; null where no poses can."""


class LawPart(ResultPart):
    """What is known of physics without a name."""

    form: Literal[
        "linear",
        "quadratic",
        "product",
        "periodic",
        "saturating",
        "relaxation",
        "step",
        "play",
        "field",
        "curve",
    ]
    equation: str
    """In symbols and units."""
    covariates: list[str]
    parameters: dict[str, ValuePart]
    holdout_gain_px: float | None
    """How much worse the held-out frames are predicted without it; null where none were."""
    rivals: list[str]
    """Other laws that these data do not rule out."""


class UnexplainedPart(ResultPart):
    """Something real without a name: where it lives."""

    link: str
    site: str
    covariate: str
    where: str
    p_value: Probability
    law: LawPart | None = None
    """By which law the site follows the covariate; null where none was found."""


class NoisePart(ResultPart):
    """One-sigma levels, estimated from the recording."""

    corner_px: NotNegative
    flange_m: NotNegative | None
    flange_rad: NotNegative | None
    print_m: NotNegative
    focal_relative: NotNegative = 0.0
    """Scatter of the focal length frame by frame, as a share of it; zero where none is needed."""


class DiagnosisFile(ProvenancePart):
    """The whole of diagnosis.json."""

    schema_: Literal["cell.diagnosis/1"] = Field(default=SCHEMA, alias="schema")
    recording: str
    verdict: Literal["consistent", "explained", "unexplained"]
    holdout: HoldoutPart | None
    misfit: MisfitPart
    mismatch: list[MismatchPart]
    effects: list[EffectPart]
    ambiguous_with: list[AmbiguityPart]
    unexplained: UnexplainedPart | None
    """The first of `unexplained_all`."""
    unexplained_all: list[UnexplainedPart]
    noise: NoisePart
    frames_used: list[int]
    frames_rejected: list[RejectedPart]
    notes: list[str]
    """What was worked out rather than logged, and which effects could not have been seen."""
