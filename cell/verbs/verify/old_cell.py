"""The old calibration as a cell of the measurement chain, with its whole uncertainty."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.chain.effect import Present
from calib.chain.effects import make_effect
from calib.chain.model import CellModel
from calib.chain.optics import COLUMN, optics_row
from calib.solver.noise import Noise
from calib.solver.unknowns import Unknown, unknowns_of
from calib.views import FloatArray, Mount
from cell.errors import InputError
from cell.storage.files.calibration_source import (
    DISTORTION,
    CalibrationSource,
    SolutionSource,
    TransformSource,
)

SOLUTION = "joint_ml"
_PLACES: dict[Mount, tuple[str, str]] = {
    "eye_in_hand": ("flange_from_camera", "base_from_board"),
    "eye_to_hand": ("flange_from_board", "base_from_camera"),
}
_CHAIN_PLACES = ("flange_from_mounted", "base_from_fixed")
_FAR = {"alpha0_px": "alpha_px", "alpha_inf_px": "alpha_px"} | {
    "beta0_px": "beta_px",
    "beta_inf_px": "beta_px",
}


@dataclass(frozen=True)
class OldCell:
    """What a calibration stated of camera, mount and board, and how well it knew them.

    Attributes
    ----------
    model:
        The cell.
    unknowns, covariance:
        Its P numbers that were fitted together, and their (P, P) covariance.
    noise:
        What that calibration measured of corners and flange.
    mount, image_size_px, range_m:
        Where the camera sits, (width, height), nearest and farthest distance calibrated.
    """

    model: CellModel
    unknowns: tuple[Unknown, ...]
    covariance: FloatArray
    noise: Noise
    mount: Mount
    image_size_px: tuple[int, int]
    range_m: tuple[float, float]

    @property
    def camera_frame(self) -> str:
        """Name in the chain of the transform that holds the camera's place."""
        return _CHAIN_PLACES[0 if self.mount == "eye_in_hand" else 1]

    @property
    def board_frame(self) -> str:
        """Name in the chain of the transform that holds the board's place."""
        return _CHAIN_PLACES[1 if self.mount == "eye_in_hand" else 0]

    def group(self, name: str) -> NDArray[np.int64]:
        """Places among the unknowns of `mount` (the camera's place), `board` or `lens`."""
        frames = [u.name.partition(".")[0] for u in self.unknowns]
        wanted = {"mount": self.camera_frame, "board": self.board_frame}
        if name == "lens":
            return np.flatnonzero([frame not in _CHAIN_PLACES for frame in frames])
        return np.flatnonzero([frame == wanted[name] for frame in frames])


def old_cell(calibration: CalibrationSource) -> OldCell:
    """The cell behind a calibration's joint fit.

    Raises
    ------
    InputError
        The calibration has no joint fit with the robot, or not its covariance.
    """
    robot, found = calibration.robot, calibration.solutions.get(SOLUTION)
    size, span = calibration.image_size_px, calibration.range_m
    if robot is None or found is None or found.covariance is None or size is None or span is None:
        raise InputError(
            "has no joint fit of camera and robot with its covariance, and without it nothing"
            " says how far off a picture may be. Run cell calibrate anew, on a recording with"
            " flange poses"
        )
    mounted, fixed = (_transform(calibration, name) for name in _PLACES[robot.mount])
    model = CellModel(_optics(found), mounted.matrix, fixed.matrix, _focus(found))
    names = [_chain_name(name, robot.mount) for name in found.covariance.names]
    known = {_plain(u): u for u in unknowns_of(model, (*COLUMN,))}
    if not set(names) <= set(known):
        raise InputError(f"covariance names unknown numbers: {set(names) - set(known)}")
    noise = Noise(robot.corner_sigma_px, robot.flange_sigma_m, robot.flange_sigma_rad)
    return OldCell(
        model=model,
        unknowns=tuple(known[name] for name in names),
        covariance=np.array(found.covariance.matrix),
        noise=noise,
        mount=robot.mount,
        image_size_px=size,
        range_m=span,
    )


def _transform(calibration: CalibrationSource, name: str) -> TransformSource:
    found: TransformSource | None = getattr(calibration, name)
    if found is None:
        raise InputError(f"has no {name}; run cell calibrate anew")
    return found


def _optics(found: SolutionSource) -> FloatArray:
    named = {"u0_px": found.u0_px, "v0_px": found.v0_px, "skew_px": found.skew_px}
    named |= dict(zip(DISTORTION, found.distortion, strict=True))
    named |= {"alpha_px": found.alpha_px, "beta_px": found.beta_px}
    named["equidistant"] = float(found.wide)
    if found.focus is not None:
        reported = found.focus.parameters
        named |= {_FAR[name]: p.value for name, p in reported.items() if name in _FAR}
    return optics_row(**named)


def _focus(found: SolutionSource) -> tuple[Present, ...]:
    if found.focus is None:
        return ()
    bend = {name: p.value for name, p in found.focus.parameters.items() if name not in _FAR}
    return (make_effect("focus_breathing", {"law": found.focus.law, **bend}),)


def _chain_name(name: str, mount: Mount) -> str:
    frame, _, axis = name.partition(".")
    if axis:
        return f"{dict(zip(_PLACES[mount], _CHAIN_PLACES, strict=True)).get(frame, frame)}.{axis}"
    return _FAR.get(name, name)


def _plain(unknown: Unknown) -> str:
    """The unknown's name as `calibration.json` has it, effects without their label."""
    return unknown.name.rpartition(".")[2] if unknown.place[0] == "effect" else unknown.name
