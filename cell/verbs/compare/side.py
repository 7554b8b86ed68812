"""One of the two calibrations: its camera as named numbers with their covariance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.chain.optics import optics_row
from calib.chain.projection import project
from calib.chain.rigid import from_vector, inverse
from calib.paper.focus_law import LAWS, law_scale_px
from calib.views import FloatArray
from cell.errors import InputError
from cell.storage.files.calibration_source import (
    DISTORTION,
    CalibrationSource,
    LawSource,
    OriginSource,
    SolutionSource,
    TransformSource,
)
from cell.verbs.export.focal_length import moving_law

OPTICS_NAMES = ("alpha", "beta", "bend", "u0_px", "v0_px", "skew_px", *DISTORTION)
NAMES = (*OPTICS_NAMES, *(f"mount.{axis}" for axis in ("x", "y", "z", "rx", "ry", "rz")))
"""Alpha and beta far away, the focus law's bend, then the camera's place by a small increment in
its own frame."""

PLACE = slice(len(OPTICS_NAMES), len(NAMES))
"""Where the increment stands."""

_ALIASES = {
    **dict.fromkeys(("alpha_px", "alpha0_px", "alpha_inf_px"), "alpha"),
    **dict.fromkeys(("beta_px", "beta0_px", "beta_inf_px"), "beta"),
    **dict.fromkeys(("k_px_m2", "f_m"), "bend"),
}
_ALWAYS_FITTED = ("alpha", "beta", "u0_px", "v0_px", "k1", "k2")
_PLACES = ("flange_from_camera", "base_from_camera")


@dataclass(frozen=True)
class Side:
    """A calibration as the comparison sees it.

    Attributes
    ----------
    label, recording, solution:
        What it is called, for the reader.
    wide:
        Whether its image is an equidistant one.
    law:
        Of the focal length: a name of `calib.paper.focus_law.LAWS`.
    values, covariance:
        (P,) and (P, P) of `NAMES`.
    correlated:
        False where only single sigmas are known.
    place_name, place:
        `flange_from_camera` or `base_from_camera` and its (4, 4); empty and None where unknown.
    has_corner:
        True where the scale factors have a corner that no smooth law has.
    origin:
        When, by which program and of which devices it was made.
    too_sure:
        How many times the stated sigmas its cross-validation asks for; one where it does not.
    """

    label: str
    recording: str
    solution: str
    wide: bool
    image_size_px: tuple[int, int]
    range_m: tuple[float, float]
    law: str
    values: FloatArray
    covariance: FloatArray
    correlated: bool
    place_name: str
    place: FloatArray | None
    has_corner: bool
    too_sure: float
    origin: OriginSource

    @property
    def knows_chance(self) -> bool:
        """Whether the uncertainty of every number that is always fitted is known."""
        always = [NAMES.index(name) for name in _ALWAYS_FITTED]
        return bool((np.diag(self.covariance)[always] > 0).all())

    def scale_px(self, values: FloatArray, distance_m: float) -> tuple[float, float]:
        """Alpha and beta at a distance."""
        parameters = values[[0, 2]][: len(LAWS[self.law])]
        alpha = float(law_scale_px(self.law, parameters, distance_m))
        return alpha, alpha * float(values[1] / values[0])

    def optics(self, values: FloatArray, distance_m: float) -> FloatArray:
        """(K,) of the camera focused at a distance."""
        alpha, beta = self.scale_px(values, distance_m)
        named = dict(zip(OPTICS_NAMES[3:], values[3 : PLACE.start], strict=True))
        return optics_row(alpha_px=alpha, beta_px=beta, **named, equidistant=float(self.wide))

    def pixels(
        self, values: FloatArray, points_m: FloatArray, distance_m: float, place: FloatArray
    ) -> FloatArray:
        """(G, 2) of (G, 3) points in the frame that `place` takes the camera to."""
        camera_from_frame = inverse(place @ from_vector(values[PLACE]))
        optics = self.optics(values, distance_m)
        seen: FloatArray = project(optics[None], camera_from_frame[None], points_m)[0]
        return seen

    def steps(self) -> FloatArray:
        """(P,) steps for numeric derivatives."""
        sigma = np.sqrt(np.diag(self.covariance))
        return np.where(sigma > 0, 0.1 * sigma, 1e-7)


def side_of(calibration: CalibrationSource, label: str) -> Side:
    """A calibration's recommended solution as one side of a comparison.

    Raises
    ------
    InputError
        What a comparison needs is not in the file.
    """
    if calibration.image_size_px is None or calibration.range_m is None:
        raise InputError(
            f"{label}: does not state the image's size and distances: it was written by an older"
            " version. Run cell calibrate anew"
        )
    name, zones = calibration.recommended(), calibration.zones
    checked = calibration.cross_validation
    solution, law = calibration.solution(name), moving_law(calibration, name)
    place_name = next((n for n in _PLACES if getattr(calibration, n) is not None), "")
    place: TransformSource | None = getattr(calibration, place_name) if place_name else None
    covariance, correlated = _covariance(solution, law, place, place_name)
    return Side(
        label=label,
        recording=calibration.recording,
        solution=name,
        wide=solution.wide,
        image_size_px=calibration.image_size_px,
        range_m=calibration.range_m,
        law="constant" if law is None else law.law,
        values=_values(solution, law),
        covariance=covariance,
        correlated=correlated,
        place_name=place_name,
        place=None if place is None else place.matrix,
        has_corner=law is not None and zones is not None and zones.method == "change_point",
        too_sure=1.0 if checked is None else checked.factor,
        origin=calibration.origin,
    )


def _values(solution: SolutionSource, law: LawSource | None) -> FloatArray:
    alpha, bend, beta = solution.alpha_px, 0.0, solution.beta_px
    if law is not None:
        (alpha, bend), reported = law.values(), solution.alpha_px
        named = {_ALIASES.get(n): p.value for n, p in law.parameters.items()}
        beta = named.get("beta", alpha * solution.beta_px / reported)
    optics = [solution.u0_px, solution.v0_px, solution.skew_px]
    return np.array([alpha, beta, bend, *optics, *solution.distortion, *np.zeros(6)])


def _covariance(
    solution: SolutionSource,
    law: LawSource | None,
    place: TransformSource | None,
    place_name: str,
) -> tuple[FloatArray, bool]:
    """(P, P), and whether it is more than a diagonal."""
    found = np.zeros((len(NAMES), len(NAMES)))
    if solution.covariance is not None:
        names = [_name(n, place_name) for n in solution.covariance.names]
        pairs = [(k, NAMES.index(n)) for k, n in enumerate(names) if n in NAMES]
        rows, at = (list(column) for column in zip(*pairs, strict=True))
        found[np.ix_(at, at)] = np.array(solution.covariance.matrix)[np.ix_(rows, rows)]
        return found, True
    sigma = {_name(n, place_name): s for n, s in solution.sigma.items()}
    if law is not None:
        sigma |= {_name(n, place_name): p.sigma for n, p in law.parameters.items()}
    if place is not None:
        sigma |= dict(zip(NAMES[PLACE], (*place.sigma_p_m, *place.sigma_r_rad), strict=True))
    known = np.array([sigma.get(name, 0.0) for name in NAMES])
    return np.diag(known**2), False


def _name(name: str, place_name: str) -> str:
    frame, _, axis = name.partition(".")
    return f"mount.{axis}" if axis and frame == place_name else _ALIASES.get(name, name)
