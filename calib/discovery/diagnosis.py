"""What a diagnosis says."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from calib.calibration.result import Rejection
from calib.discovery.prove import Proof
from calib.discovery.split import Split
from calib.notebook import Row, Shown, axes_of
from calib.solver.joint import JointFit
from calib.views import Views

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Verdict = Literal["consistent", "explained", "unexplained"]


@dataclass(frozen=True)
class Value:
    """A number with its one-sigma uncertainty and unit."""

    value: float
    sigma: float
    unit: str


@dataclass(frozen=True)
class Mismatch:
    """Where the misfit of the plain cell lives."""

    link: str
    site: str
    covariate: str
    where: str
    share_of_excess: float
    p_value: float


@dataclass(frozen=True)
class NamedEffect:
    """One piece of physics, or mix-up in the log, that the recording demands."""

    name: str
    link: str
    law: str | None
    physics: str
    remedy: str
    parameters: dict[str, Value]
    p_value: float
    holdout_gain_px: float


@dataclass(frozen=True)
class Ambiguity:
    """Names that these data cannot distinguish, why, and what would."""

    names: tuple[str, ...]
    why: str
    experiment: str


@dataclass(frozen=True)
class FoundLaw:
    """What is known of physics without a name.

    Attributes
    ----------
    form, equation, covariates:
        How the site follows what, in symbols and units.
    parameters:
        Its numbers.
    holdout_gain_px:
        How much worse the held-out frames are predicted without it; NaN where none were held out.
    rivals:
        Other laws that these data do not rule out, as text.
    """

    form: str
    equation: str
    covariates: tuple[str, ...]
    parameters: dict[str, Value]
    holdout_gain_px: float
    rivals: tuple[str, ...]


@dataclass(frozen=True)
class Unexplained:
    """Something real that no known effect accounts for: where it lives, and by which law."""

    link: str
    site: str
    covariate: str
    where: str
    p_value: float
    law: FoundLaw | None


@dataclass(frozen=True, repr=False)
class Diagnosis(Shown):
    """The whole answer.

    Attributes
    ----------
    verdict, effects, ambiguous_with, unexplained_all, mismatch, proof:
        As in the contract's diagnosis.json.
    split:
        The misfit of the plain cell and of the twin, judged by the twin's noise.
    plain, twin:
        The plain cell and the cell with all that was found, each fitted to every usable frame.
    views, log:
        The mended frames that were used, and every mended row of the log.
    rejected, notes:
        Frames left out; what was worked out, filled in, or could not be seen.
    """

    verdict: Verdict
    effects: tuple[NamedEffect, ...]
    ambiguous_with: tuple[Ambiguity, ...]
    unexplained_all: tuple[Unexplained, ...]
    mismatch: tuple[Mismatch, ...]
    split: tuple[Split, Split]
    proof: Proof | None
    plain: JointFit
    twin: JointFit
    views: Views
    log: Views
    rejected: tuple[Rejection, ...]
    notes: tuple[str, ...]

    @property
    def unexplained(self) -> Unexplained | None:
        """The first of the terms without a name: what was missed most."""
        return self.unexplained_all[0] if self.unexplained_all else None

    def headline(self) -> tuple[str, ...]:
        """What matters, a line each."""
        lines = [f"Diagnosis: {self.verdict}"]
        if self.proof is not None:
            before, after = self.proof.rms_px_before, self.proof.rms_px_after
            lines.append(
                f"{len(self.proof.frames)} frames held out: {before:.3f} px before, {after:.3f} px"
                f" after; noise {self.proof.noise_px:.3f} px"
            )
        lines += [f"{effect.name}: {effect.physics}" for effect in self.effects]
        lines += [
            f"unexplained: {term.link}, along {term.covariate} ({term.where})"
            for term in self.unexplained_all
        ]
        lines += [f"cannot be distinguished: {' and '.join(a.names)}" for a in self.ambiguous_with]
        return tuple(lines)

    def rows(self) -> list[Row]:
        """One row for each number of each effect."""
        return [
            {
                "effect": effect.name,
                "link": effect.link,
                "law": effect.law,
                "parameter": name,
                "value": number.value,
                "sigma": number.sigma,
                "unit": number.unit,
                "p_value": effect.p_value,
                "holdout_gain_px": effect.holdout_gain_px,
            }
            for effect in self.effects
            for name, number in effect.parameters.items()
        ]

    def plot(self) -> Figure:
        """Where the plain cell's misfit lives, and how held-out frames are predicted."""
        figure, (where, proof) = axes_of(2)
        largest = self.mismatch[:8][::-1]
        names = [f"{m.link}: {m.covariate}" for m in largest]
        where.barh(range(len(names)), [m.share_of_excess for m in largest], tick_label=names)
        where.set(xlabel="share of the misfit beyond noise")
        if self.proof is not None:
            sizes = (self.proof.rms_px_before, self.proof.rms_px_after, self.proof.noise_px)
            proof.bar(range(3), sizes, tick_label=["before", "after", "noise"])
            proof.set(ylabel="frames held out, RMS (px)")
        figure.suptitle(f"verdict: {self.verdict}")
        figure.tight_layout()
        return figure
