"""What a calibration or a diagnosis reported, held against the simulator's truth."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pyarrow as pa

from calib.calibration import Calibration, Solution, Statistics
from calib.calibration.mapping import TRANSFORMS
from calib.calibration.result import Focus
from calib.calibration.shared import FAR_NAMES
from calib.calibration.simulated_views import views_that_see
from calib.chain import rigid
from calib.chain.model import CellModel, evaluate
from calib.chain.optics import COLUMN
from calib.discovery.diagnosis import NamedEffect
from calib.handeye import camera_position_error_m
from cell.verbs.study.trial import Trial

ROBOT = "robot"
"""Whose the transforms are: the joint fit's, or of hand-eye where that failed."""
CAMERA_Z, CAMERA_RMS = "camera_z_mean_m", "camera_rms_m"

COLUMN_OF = pa.list_(
    pa.struct(
        [
            ("of", pa.string()),
            ("quantity", pa.string()),
            ("value", pa.float64()),
            ("sigma", pa.float64()),
            ("truth", pa.float64()),
            ("error", pa.float64()),
            ("z", pa.float64()),
        ]
    )
)
"""Of a column of estimates."""


@dataclass(frozen=True)
class Estimate:
    """One number of a result.

    Attributes
    ----------
    of, quantity:
        Whose it is (a solution's, an effect's), and its name with its unit.
    value, sigma, truth:
        As stated, its one sigma where one was reported, and as it is where that means something.
    """

    of: str
    quantity: str
    value: float
    sigma: float | None
    truth: float | None

    def as_mapping(self) -> dict[str, Any]:
        """With `error`, estimate less truth, and `z`, that in sigmas."""
        error = None if self.truth is None else self.value - self.truth
        z = error / self.sigma if error is not None and self.sigma else None
        return {**vars(self), "error": error, "z": z}


def of_calibration(found: Calibration, trial: Trial) -> list[Estimate]:
    """Every solution's camera and camera positions, and the robot's two transforms."""
    reported = [
        e for name, s in found.solutions.items() for e in _of_solution(name, s, found, trial)
    ]
    return [*reported, *_of_robot(found, trial)]


def of_effect(found: NamedEffect, trial: Trial) -> list[Estimate]:
    """The amounts of an effect that is there and was named with its law."""
    truth = {
        name: value
        for present in trial.cell.model.effects
        if (present.effect.name, present.effect.law) == (found.name, found.law)
        for name, value in present.as_mapping().items()
    }
    return [
        Estimate(found.name, name, reported.value, reported.sigma or None, truth[name])
        for name, reported in found.parameters.items()
        if name in truth
    ]


def _of_solution(
    name: str, solution: Solution, found: Calibration, trial: Trial
) -> Iterator[Estimate]:
    values, sigma = dict(solution.values), dict(solution.sigma)
    true = dict(_mean_optics(found, trial))
    if solution.at_distance_m is not None:
        true |= _optics_at(solution.at_distance_m, trial)
    if solution.focus is not None:
        for old in ("alpha_px", "beta_px"):
            del values[old]
        values |= {n: p.value for n, p in solution.focus.parameters.items()}
        sigma |= {n: p.sigma for n, p in solution.focus.parameters.items()}
        true |= _focus_truth(solution.focus, trial.cell.model)
    for quantity, value in values.items():
        yield Estimate(name, quantity, value, sigma.get(quantity), true.get(quantity))
    error = camera_position_error_m(solution.camera_from_board, trial.truth.camera_from_board)
    statistics = Statistics.of(error)
    yield Estimate(name, CAMERA_Z, statistics.mean[2], None, 0.0)
    yield Estimate(name, CAMERA_RMS, statistics.rms, None, 0.0)


def _mean_optics(found: Calibration, trial: Trial) -> Iterator[tuple[str, float]]:
    """What one camera for all frames used could at best be: the mean where a number moves."""
    for name in COLUMN:
        yield name, float(trial.truth.column(name)[found.used].mean())


def _optics_at(distance_m: float, trial: Trial) -> dict[str, float]:
    """Scale factors of a lens focused at that distance, as far as focus alone moves them."""
    model = trial.cell.model
    lens = [p for p in model.effects if p.effect.link == "lens" and not p.effect.needs]
    pose = np.eye(4)[None]
    pose[0, :3, 3] = [0.0, 0.0, distance_m] - trial.cell.board.corners_m.mean(axis=0)
    made = views_that_see(model, trial.views, trial.cell.board, pose)
    state = evaluate(model.with_effects(lens), replace(made, robot_model=None))
    return {name: float(state.column(name)[0]) for name in ("alpha_px", "beta_px")}


def _focus_truth(focus: Focus, model: CellModel) -> dict[str, float]:
    """The law's numbers; of another law than the cell's only the scale factors far away."""
    breathing = [p for p in model.effects if p.effect.name == "focus_breathing"]
    same = [p.as_mapping() for p in breathing if p.effect.law == focus.law]
    true = {far: float(model.optics[COLUMN[n]]) for n, far in FAR_NAMES[focus.law].items()}
    for name in set(focus.parameters) - set(true):
        if same or not breathing:
            true[name] = same[0][name] if same else 0.0
    return true


def _of_robot(found: Calibration, trial: Trial) -> Iterator[Estimate]:
    """Increments from the true transforms to those found, in the second-named frame."""
    robot = found.robot
    if robot is None:
        return
    model, names = trial.cell.model, TRANSFORMS[robot.mount]
    sigma = np.sqrt(np.maximum(np.diag(robot.covariance), 0.0))
    pairs = (
        (model.flange_from_mounted, robot.flange_from_mounted),
        (model.base_from_fixed, robot.base_from_fixed),
    )
    off = np.concatenate(
        [rigid.to_vector(rigid.inverse(true) @ reported) for true, reported in pairs]
    )
    axes = ("x_m", "y_m", "z_m", "rx_rad", "ry_rad", "rz_rad")
    labels = [f"{name}.{axis}" for name in names for axis in axes]
    for label, value, one in zip(labels, off.tolist(), sigma.tolist(), strict=True):
        yield Estimate(ROBOT, label, value, one or None, 0.0)
