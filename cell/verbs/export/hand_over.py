"""`cell export`: from a calibration to the text of a file for another program."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from cell.errors import InputError
from cell.storage.files.calibration_source import CalibrationSource, SolutionSource
from cell.verbs.export.camera import Camera
from cell.verbs.export.domain import domain_of
from cell.verbs.export.focal_length import focal_lengths_px, moving_law, refusal
from cell.verbs.export.formats import colmap, kalibr, mrcal, opencv, ros
from cell.verbs.export.formats.json_text import json_text
from cell.views.poses import abb, easy_handeye2, plain_text, tf, ur, urdf
from cell.views.poses.placement import Placement, placements, refuse_undetermined

if TYPE_CHECKING:
    from cell.storage.recording import Recording

_SKEW_PX = 1e-9

TEXTS: dict[str, Callable[[Camera], str]] = {
    "ros": ros.text,
    "opencv": opencv.text,
    "mrcal": mrcal.text,
    "kalibr": kalibr.text,
    "colmap": colmap.text,
}
LENGTHS: dict[str, tuple[int, ...]] = {
    "ros": ros.LENGTHS,
    "opencv": opencv.LENGTHS,
    "mrcal": mrcal.LENGTHS,
    "kalibr": kalibr.LENGTHS,
    "colmap": colmap.LENGTHS,
}
"""How many coefficients of `DISTORTION` each of them takes."""
FISHEYE_TOOLS = ("ros", "opencv", "kalibr", "colmap")
"""Those that have a wide lens of Kannala and Brandt's four terms."""
POSES: dict[str, Callable[[Sequence[Placement]], str]] = {
    "tf": tf.text,
    "moveit": tf.launch_file,
    "easy_handeye2": easy_handeye2.text,
    "urdf": urdf.text,
    "ur": ur.text,
    "abb": abb.text,
    "text": plain_text.text,
}
"""Formats that say where camera and board are, and nothing of the lens."""

FORMATS = (*TEXTS, "json", *POSES)


@dataclass(frozen=True)
class Exported:
    """What was handed over.

    Attributes
    ----------
    text, warnings:
        The text of the file, and what its reader should know besides.
    files:
        Of a model that is a folder, the text of each file by its name; that of `text` among them.
    """

    text: str
    warnings: tuple[str, ...]
    files: Mapping[str, str] = field(default_factory=dict)


def export_calibration(
    calibration: CalibrationSource,
    tool: str,
    *,
    distance_m: float | None = None,
    solution: str | None = None,
    image_size_px: tuple[int, int] | None = None,
    frames: Mapping[str, str] | None = None,
    views: Recording | None = None,
    refit: bool = False,
) -> Exported:
    """The calibrated camera in a tool's own format.

    Parameters
    ----------
    calibration:
        From `read_calibration`.
    tool:
        One of `FORMATS`.
    distance_m:
        Where a focal length that moves is taken; `json` alone can do without.
    solution:
        Name of the solution; the recommended one where None.
    image_size_px:
        (width, height) for a file that does not state it.
    frames:
        Names of `FRAMES` in the reader's tool, for the formats of `POSES`.
    views:
        The recording whose pictures become a whole model; `colmap` alone has such.
    refit:
        Take the tool's model that fits best where it cannot say the camera exactly.

    Raises
    ------
    InputError
        The format cannot say this camera, or the calibration does not determine it; the
        message says what to choose.
    """
    if views is not None and tool != "colmap":
        raise InputError(f"--views: {tool} holds a camera and no pictures; colmap does")
    if refit and tool not in TEXTS:
        raise InputError(f"--refit: {tool} loses nothing; it is for {', '.join(TEXTS)}")
    if tool in POSES:
        return Exported(POSES[tool](placements(calibration, frames)), ())
    refuse_undetermined(calibration, "camera")
    name = calibration.recommended() if solution is None else solution
    found, law = calibration.solution(name), moving_law(calibration, name)
    if tool not in FORMATS:
        raise InputError(f"--format {tool}: is not known; known are {', '.join(FORMATS)}")
    if distance_m is not None and not distance_m > 0:
        raise InputError(f"--distance {distance_m:g}: must be a positive number of metres")
    warnings = _warnings(calibration, name, distance_m)
    if tool == "json":
        return Exported(json_text(calibration, name, distance_m), warnings)
    if law is not None and distance_m is None:
        raise InputError(refusal(calibration, name, tool))
    _refuse_skew(found, name, tool)
    size = calibration.image_size_px or image_size_px
    camera, more = _sayable(_camera(calibration, name, size, distance_m), tool, refit=refit)
    warnings += more
    if views is None:
        return Exported(TEXTS[tool](camera), warnings)
    from cell.verbs.export.model import model_texts

    return Exported(TEXTS[tool](camera), warnings, model_texts(calibration, camera, views))


def _sayable(camera: Camera, tool: str, *, refit: bool) -> tuple[Camera, tuple[str, ...]]:
    """The camera, refitted where that is asked for and needed, with what its reader must know."""
    notes: list[str] = []
    wide = camera.wide and tool in FISHEYE_TOOLS
    exact = camera.is_kannala_brandt if wide else camera.enough(LENGTHS[tool]) is not None
    if refit and exact and wide == camera.wide:
        notes.append(f"nothing to refit: {tool} says this camera exactly")
    elif refit:
        from cell.verbs.export.refit import refit as fitted  # the solver takes a while to load

        found = fitted(camera, LENGTHS[tool], wide=wide)
        camera = replace(found.camera, about=f"{camera.about}; {found.description}")
        notes.append(found.description)
    domain = domain_of(camera)
    if domain is not None:
        camera = replace(camera, about=f"{camera.about}; {domain.description}")
        notes.append(domain.description)
    return camera, tuple(notes)


def _camera(
    calibration: CalibrationSource,
    name: str,
    image_size_px: tuple[int, int] | None,
    distance_m: float | None,
) -> Camera:
    found = calibration.solution(name)
    alpha, beta = found.alpha_px, found.beta_px
    at = "at every distance"
    if distance_m is not None and moving_law(calibration, name) is not None:
        alpha, beta = focal_lengths_px(calibration, name, distance_m)
        at = f"at {distance_m:g} m only, its focal length moves"
    recording = " ".join(calibration.recording.split())
    return Camera(
        image_size_px=image_size_px,
        alpha_px=alpha,
        beta_px=beta,
        u0_px=found.u0_px,
        v0_px=found.v0_px,
        distortion=found.distortion,
        about=f"calibration of recording {recording}, solution {name}; holds {at}",
        wide=found.wide,
    )


def _refuse_skew(found: SolutionSource, name: str, tool: str) -> None:
    if abs(found.skew_px) > _SKEW_PX:
        raise InputError(
            f"solution {name} has a skew of {found.skew_px:.4g} px, which {tool} cannot say."
            " Choose one without, such as --solution joint_ml or zhang_mle_no_skew,"
            " or --format json"
        )


def _warnings(
    calibration: CalibrationSource, name: str, distance_m: float | None
) -> tuple[str, ...]:
    reported: list[str] = []
    law, span = calibration.focus_law, calibration.range_m
    if law is not None and law.moves and moving_law(calibration, name) is None:
        reported.append(
            f"solution {name} has one focal length for all distances, but it follows the distance"
            f" by {law.law}: this camera is wrong nearly everywhere"
        )
    if distance_m is not None and span is not None and not span[0] <= distance_m <= span[1]:
        reported.append(
            f"--distance {distance_m:g} lies outside the calibrated range, {span[0]:.3f} to"
            f" {span[1]:.3f} m: the focal length there is an extrapolation"
        )
    return tuple(reported)
