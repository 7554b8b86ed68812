"""A cell file's `simulation` section as the simulator's own truth, and the logs of its plans."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calib.chain.effect import Present
from calib.chain.effects import make_effect
from calib.chain.model import CellModel
from calib.chain.optics import OPTICS, optics_row
from calib.views import FloatArray, Views
from cell.devices.log_mixups import MIXUPS
from cell.devices.nominal_cell import nominal
from cell.errors import InputError
from cell.sequencer.guard import Guard
from cell.storage.files.camera_file import Lens
from cell.storage.files.cell_file import CellFile, EffectFile, Simulation
from cell.storage.files.plan_file import Plan
from cell.storage.recording.additional_columns import additional_labels, additional_numbers
from sim.arm import Repeatability
from sim.cell import CameraSpec, SimulatedCell
from sim.log import tour
from sim.render import Sensor

_UNKNOWN_LENS = Lens(focal_length_mm=8.0, f_number=8.0)
"""Where the file does not state; it shapes the blur in pictures and nothing else."""
LOGGED_COLUMNS = (
    "t_s",
    "joint_velocity_rad_s",
    "approach_joints_rad",
    "temperature_c",
    "focus_position",
    "focus_distance_m",
    "exposure_s",
)
"""What a plan's views may carry of a log of their own, besides joints and pose."""


def simulated_cell(
    cell: CellFile, home_rad: FloatArray, *, seed: int | None = None
) -> SimulatedCell:
    """The truth of a cell.

    Parameters
    ----------
    cell:
        With the truth in `simulation`; as its `layout` says where there is none.
    home_rad:
        (6,) joint angles the arm stands at first.
    seed:
        In place of the file's.

    Raises
    ------
    InputError
        Neither section is there, or one names an effect or a column that does not exist.
    """
    truth = nominal(cell).simulation
    assert truth is not None
    noise = truth.noise
    return SimulatedCell(
        name=cell.name,
        robot_model=cell.robot.model or "",
        home_rad=home_rad,
        board=cell.board.board(),
        model=_model(cell, truth),
        camera=_camera(cell, truth),
        mount=cell.mount,
        repeatability=Repeatability(noise.arm_position_m, noise.arm_rotation_rad),
        corner_sigma_px=noise.corner_px,
        payload_kg=cell.robot.payload_kg,
        seed=truth.seed if seed is None else seed,
    )


def present_effect(effect: EffectFile, where: str) -> Present:
    """An effect of the catalogue with its values; raises `InputError` for one it does not have.

    `where` is the place in a file that the error names.
    """
    law = {} if effect.law is None else {"law": effect.law}
    try:
        return make_effect(effect.name, {**effect.parameters, **law})
    except KeyError as unknown:
        raise InputError(f"{where}: {unknown.args[0]}") from None


def _model(cell: CellFile, truth: Simulation) -> CellModel:
    unknown = sorted(set(truth.optics) - set(OPTICS))
    if unknown:
        raise InputError(
            f"cell {cell.name}: simulation.optics: {', '.join(unknown)} is not known; known are"
            f" {', '.join(OPTICS)}"
        )
    for name in ("alpha_px", "beta_px"):
        if name in truth.optics and not truth.optics[name] > 0:
            raise InputError(
                f"cell {cell.name}: simulation.optics.{name}: {truth.optics[name]:g} is not above 0"
            )
    if truth.optics.get("equidistant", 0.0) not in (0.0, 1.0):
        raise InputError(
            f"cell {cell.name}: simulation.optics.equidistant: {truth.optics['equidistant']:g} is"
            " neither 0 (perspective lens) nor 1 (wide lens, image height by the angle)"
        )
    where = f"cell {cell.name}: simulation.effects"
    return CellModel(
        optics=optics_row(**{"height_px": cell.camera.height, **truth.optics}),
        flange_from_mounted=truth.mounted.transform().as_matrix(),
        base_from_fixed=truth.fixed.transform().as_matrix(),
        effects=tuple(
            present_effect(effect, where) for effect in truth.effects if effect.name not in MIXUPS
        ),
    )


def _camera(cell: CellFile, truth: Simulation) -> CameraSpec:
    camera = cell.camera
    lens = camera.lens or _UNKNOWN_LENS
    pixel_um = camera.pixel_size_um
    return CameraSpec(
        width_px=camera.width,
        height_px=camera.height,
        focal_length_m=1e-3 * lens.focal_length_mm,
        f_number=lens.f_number,
        pixel_size_m=None if pixel_um is None else 1e-6 * pixel_um,
        focus=camera.focus or "fixed",
        lens_sigma_px=truth.lens.best_blur_px,
        focus_distance_m=truth.lens.focus_distance_m,
        nearest_focus_m=truth.lens.nearest_focus_m,
        sensor=Sensor(
            full_well_e=truth.noise.full_well_electrons,
            read_noise_levels=truth.noise.read_levels,
            white_exposure_s=truth.white_exposure_s,
        ),
    )


def home_of(plan: Plan) -> FloatArray:
    """(6,) joint angles a simulated arm starts from; NaN where neither cell nor plan states."""
    if plan.cell.layout is not None:
        return np.asarray(np.radians(plan.cell.layout.home_deg))
    joints = plan.file.views[0].joints()
    return np.full(6, np.nan) if joints is None else np.array(joints, dtype=float)


def log_of(plan: Plan, cell: SimulatedCell) -> Views:
    """What a run of the plan would log, without its corners.

    Views that carry a log of their own (a twin's) keep it; the others get the times and poses of
    an undisturbed run.

    Raises
    ------
    InputError
        A view gives only a pose, and the arm cannot reach it or is unknown.
    """
    if all(view.base_from_flange is not None for view in plan.file.views):
        log = _with_logged(plan, _blank(plan, cell))
    else:
        log = _with_logged(plan, _tour(plan, cell, _joints(plan, cell)))
    return _focused(plan, log, cell.camera) if plan.file.exposure.focus == "position" else log


def _focused(plan: Plan, log: Views, camera: CameraSpec) -> Views:
    """The log of lenses that went to the plan's positions, where none says how far they focus."""
    indices = range(len(plan.file.views))
    position = np.array([plan.file.focus_position(k) for k in indices], dtype=np.float64)
    focused_m = np.array([camera.focus_distance_at(step) for step in position])
    logged = log.focus_distance_m
    return replace(
        log,
        focus_position=position,
        focus_distance_m=np.where(np.isfinite(logged), logged, focused_m),
    )


def _tour(plan: Plan, cell: SimulatedCell, joints: FloatArray) -> Views:
    return tour(
        cell,
        joints,
        speed_m_s=plan.file.speed_m_s,
        joint_speed_rad_s=float(np.radians(plan.file.joint_speed_deg_s)),
    )


def _joints(plan: Plan, cell: SimulatedCell) -> FloatArray:
    """(N, 6) joint angles of the views, poses solved by the branch nearest to the one before."""
    guard = Guard.of(plan)
    here, rows = cell.home_rad, []
    for index in range(len(plan.file.views)):
        here = guard.joints_of(plan, index, here)
        rows.append(here)
    return np.array(rows)


def _blank(plan: Plan, cell: SimulatedCell) -> Views:
    joints = [view.joints() for view in plan.file.views]
    blank = Views.blank(
        cell.board,
        width_px=cell.camera.width_px,
        height_px=cell.camera.height_px,
        frames=len(joints),
        mount=cell.mount,
        joints=max((len(given) for given in joints if given is not None), default=6),
    )
    for row, given in zip(blank.joints_rad, joints, strict=True):
        if given is not None:
            row[:] = given
    return replace(blank, payload_kg=cell.payload_kg, robot_model=cell.robot_model or None)


def _with_logged(plan: Plan, log: Views) -> Views:
    """`log` with whatever the plan's views carry of a log of their own."""
    columns = {
        name: getattr(log, name).copy() for name in (*LOGGED_COLUMNS, "base_from_flange", "frame")
    }
    for index, view in enumerate(plan.file.views):
        for name in LOGGED_COLUMNS:
            value = getattr(view, name)
            if value is not None:
                columns[name][index] = value
        if view.base_from_flange is not None:
            columns["base_from_flange"][index] = view.base_from_flange.transform().as_matrix()
        if view.frame is not None:
            columns["frame"][index] = view.frame
    moving = bool((np.nan_to_num(columns["joint_velocity_rad_s"]) != 0).any())
    further = [view.log or {} for view in plan.file.views]
    return replace(
        log,
        moving=moving,
        extra=additional_numbers(further),
        labels=additional_labels(further),
        **columns,
    )
