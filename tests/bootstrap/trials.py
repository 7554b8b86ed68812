"""Cells whose layout is wrong in a known way, and what a bootstrap made of them in truth."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from ruamel.yaml import YAML
from scipy.spatial.transform import RigidTransform, Rotation

from calib.chain import rigid
from calib.chain.kinematics import arm
from calib.chain.model import CellModel, Errors, evaluate, predict
from calib.detection import Detection
from calib.views import BoolArray, FloatArray, Views
from cell.devices.simulated_cell import simulated_cell
from cell.errors import CellError
from cell.sequencer.checks import Verdict
from cell.sequencer.guard import Guard
from cell.sequencer.shot import Shot
from cell.sequencer.watcher import Checked
from cell.storage.files.cell_file import CellFile, EffectFile, Layout, read_cell
from cell.storage.files.parts import Pose
from cell.storage.files.plan_file import PlanFile, read_plan
from cell.storage.files.writing import yaml_text
from cell.storage.recording import FrameRecord, read_recording
from cell.verbs.bootstrap import Bootstrap, LayoutUncertainty
from cell.verbs.bootstrap.guide import BootstrapGuide
from cell.verbs.bootstrap.near_guard import FARTHEST_M, FARTHEST_RAD, TRAVEL_RAD, NearGuard
from cell.verbs.bootstrap.result_file import Found
from cell.verbs.plan import design_plan
from drivers.arm import ArmState, Motion
from drivers.camera import Frame
from drivers.errors import SafetyError

CONFIGS = Path(__file__).parents[2] / "configs"

EYE_TO_HAND = """\
schema: cell.cell/1
name: ur5e-outside
robot: {driver: sim, model: ur5e, payload_kg: 0.5}
camera: {driver: sim, model: outside, width: 1280, height: 1024, pixel_size_um: 5.0, focus: fixed,
         lens: {focal_length_mm: 8, f_number: 8}}
board: {type: chessboard, rows: 6, cols: 8, square_m: 0.02}
mount: eye_to_hand
layout:
  mounted: {p_m: [-0.07, 0.05, 0.02], rpy_deg: [180, 0, 0]}
  fixed: {p_m: [0.9, 0.1333, 0.4], rpy_deg: [-90, 0, 90]}
  home_deg: [180, -110, 120, -10, 90, 0]
  distances_m: [0.35, 0.65]
workspace: {low_m: [-0.9, -0.9, 0.0], high_m: [1.0, 0.9, 1.3]}
keep_out:
- {name: tripod, low_m: [0.85, -0.1, 0.0], high_m: [1.2, 0.4, 0.7]}
simulation:
  mounted: {p_m: [-0.07, 0.05, 0.02], rpy_deg: [180, 0, 0]}
  fixed: {p_m: [0.9, 0.1333, 0.4], rpy_deg: [-90, 0, 90]}
  optics: {alpha_px: 1604, beta_px: 1602, u0_px: 648, v0_px: 505, k1: -0.06, k2: 0.05}
  lens: {focus_distance_m: 0.5}
  noise: {corner_px: 0.05, arm_position_m: 3.0e-5, arm_rotation_rad: 1.0e-4}
"""


def irb140(shrunk: int = 1) -> CellFile:
    """The larger cell of the paper, its pixels so many times larger."""
    cell = read_cell(CONFIGS / "irb140-eosens.cell.yaml")
    if shrunk == 1:
        return cell
    data = cell.model_dump(by_alias=True, mode="json")
    camera, optics = data["camera"], data["simulation"]["optics"]
    camera |= {key: camera[key] // shrunk for key in ("width", "height")}
    camera["pixel_size_um"] *= shrunk
    optics |= {key: value / shrunk for key, value in optics.items() if key.endswith("_px")}
    data["layout"]["alpha_px"] /= shrunk
    data["simulation"]["effects"][0]["parameters"]["k_px_m2"] /= shrunk
    return CellFile.model_validate(data)


def ur3() -> CellFile:
    """The smaller cell of the paper."""
    return read_cell(CONFIGS / "ur3-robotiq.cell.yaml")


def eye_to_hand() -> CellFile:
    """A camera beside a UR5e that carries the board."""
    return CellFile.model_validate(YAML(typ="safe").load(EYE_TO_HAND))


@dataclass(frozen=True)
class Wrong:
    """By how much at most a layout is wrong, in random directions; by half of it at least."""

    mount_m: float = 0.05
    mount_rad: float = float(np.radians(10.0))
    fixed_m: float = 0.2
    fixed_rad: float = float(np.radians(10.0))
    alpha_share: float = 0.05

    def layout_of(self, cell: CellFile, rng: np.random.Generator) -> CellFile:
        """The cell with its layout as somebody may have guessed it."""
        assert cell.layout is not None
        assert cell.simulation is not None
        mounted = _moved(cell.simulation.mounted, self.mount_m, self.mount_rad, rng)
        fixed = _moved(cell.simulation.fixed, self.fixed_m, self.fixed_rad, rng)
        layout = {"mounted": mounted, "fixed": fixed}
        if cell.layout.alpha_px is not None:
            factor = 1.0 + self.alpha_share * float(rng.uniform(-1, 1))
            layout["alpha_px"] = cell.layout.alpha_px * factor
        return cell.model_copy(update={"layout": cell.layout.model_copy(update=layout)})


def _moved(pose: Pose, by_m: float, by_rad: float, rng: np.random.Generator) -> Pose:
    """Its position moved, and its rotation turned, by half to the whole of so much."""
    direction, axis = (v / np.linalg.norm(v) for v in rng.standard_normal((2, 3)))
    away, turned = rng.uniform(0.5, 1, 2)
    moved = RigidTransform.from_components(
        pose.transform().translation + away * by_m * direction,
        pose.transform().rotation * Rotation.from_rotvec(turned * by_rad * axis),
    )
    return Pose.of(moved)


def worn_out(cell: CellFile, rng: np.random.Generator) -> CellFile:
    """The cell with joints off by a milliradian or so, and a bracket that gives way."""
    assert cell.simulation is not None
    offsets = tuple(rng.normal(0.0, 1e-3, 6).tolist())
    effects = (
        *cell.simulation.effects,
        EffectFile(name="joint_zero_offset", parameters={"offset_rad": offsets}),
        EffectFile(name="mount_flex", parameters={"rad_per_g": 1e-3}),
    )
    truth = cell.simulation.model_copy(update={"effects": effects})
    return cell.model_copy(update={"simulation": truth})


@dataclass(frozen=True)
class Trial:
    """A bootstrap of a wrong layout, with its truth.

    Attributes
    ----------
    cell:
        With the wrong layout; `simulation` is the truth.
    stops_rad:
        (N, 6) where the arm stood, and where it was moved from there.
    found, planned_rad:
        What was found, and the (V, 6) joint angles of the plan.
    error:
        Why nothing was found or planned.
    """

    cell: CellFile
    stops_rad: FloatArray
    found: Found | None
    planned_rad: FloatArray | None
    error: str | None

    @property
    def truth(self) -> CellModel:
        """The simulated cell's own chain."""
        return truth_of(self.cell)

    def mounted_error(self) -> tuple[float, float]:
        """Metres and radians between flange_from_mounted as found and as it is."""
        assert self.found is not None
        off = rigid.inverse(self.truth.flange_from_mounted) @ self.found.flange_from_mounted
        angle = Rotation.from_matrix(off[:3, :3]).magnitude()
        return float(np.linalg.norm(off[:3, 3])), float(angle)

    def planned_views_seen_whole(self) -> tuple[int, int]:
        """How many of the plan's views show the whole board in truth, and how many there are."""
        assert self.planned_rad is not None
        return int(whole(self.cell, self.planned_rad).sum()), len(self.planned_rad)

    def violations(self) -> list[str]:
        """What the moves did against the true boxes and the allowed neighbourhood."""
        found = []
        guard, start = self._guard, self.stops_rad[0]
        home = guard.kinematics.forward(start)
        for number, (here, there) in enumerate(pairwise(self.stops_rad), 1):
            try:
                guard.check_move(here, there, f"move {number}")
            except SafetyError as refusal:
                found.append(str(refusal))
            path = guard.path(here, there)
            away = rigid.inverse(home) @ guard.kinematics.forward(path)
            moved_m = np.linalg.norm(away[:, :3, 3], axis=1).max()
            turned = Rotation.from_matrix(away[:, :3, :3]).magnitude().max()
            far = (np.abs(path - start) > TRAVEL_RAD + 1e-3).any()
            if far or moved_m > FARTHEST_M + 1e-3 or turned > FARTHEST_RAD + 1e-3:
                found.append(f"move {number}: left the neighbourhood of the start")
        return found

    @property
    def _guard(self) -> Guard:
        """Knows the truth."""
        truth, home_deg = self.cell.simulation, tuple(np.degrees(self.stops_rad[0]).tolist())
        assert truth is not None
        layout = Layout(
            mounted=truth.mounted, fixed=truth.fixed, home_deg=home_deg, distances_m=(0.3, 1.0)
        )
        return Guard(self.cell.model_copy(update={"layout": layout}), 1.0, 1.0)


def truth_of(cell: CellFile) -> CellModel:
    """The simulated cell's own chain."""
    return simulated_cell(cell, np.zeros(6)).model


def whole(cell: CellFile, joints_rad: FloatArray) -> BoolArray:
    """(N,) whether the true camera has every corner, and half a square around, in view."""
    board, camera, model = cell.board.board(), cell.camera, truth_of(cell)
    blank = Views.blank(
        board, width_px=camera.width, height_px=camera.height, frames=len(joints_rad),
        mount=cell.mount,
    )  # fmt: skip
    poses = arm(cell.robot.model or "").forward(joints_rad)
    log = {"robot_model": cell.robot.model, "joints_rad": joints_rad, "base_from_flange": poses}
    views = replace(blank, **log)
    state = evaluate(model, views)
    px = predict(model, views)
    border = (0.5 * board.square_m * state.optics[:, 0] / state.distance_m)[:, None, None]
    size = np.array([camera.width, camera.height])
    inside = ((px > border) & (px < size - border)).all(axis=(1, 2))
    return np.asarray(inside & (state.distance_m > 0))


def start_in_view(cell: CellFile, rng: np.random.Generator) -> tuple[float, ...]:
    """Six angles near home, degrees, from which the true camera has the whole board in view."""
    assert cell.layout is not None
    while True:
        start = np.array(cell.layout.home_deg) + rng.uniform(-6.0, 6.0, 6)
        if whole(cell, np.radians(start)[None])[0]:
            return tuple(start.tolist())


def run_trial(cell: CellFile, folder: Path, start_deg: tuple[float, ...] | None = None) -> Trial:
    """Bootstrap a cell in a dry run: pictures, the loop that moves the arm, files."""
    folder.mkdir(parents=True)
    path = folder / f"{cell.name}.cell.yaml"
    path.write_text(yaml_text(cell.as_mapping()))
    task = Bootstrap.of(path, folder / "run", folder, LayoutUncertainty())
    done = task.run(task.devices(dry_run=True, start_deg=start_deg), simulated=True)
    frames = read_recording(task.recording).frames
    stops = np.array([frame.joints_rad for frame in frames])
    if done.found is None:
        return Trial(cell, stops, None, None, done.result.reason)
    task.write(done)
    plan = read_plan(task.plan_path)
    return Trial(cell, stops, done.found, _joints(plan.file), None)


def run_on_corners(
    cell: CellFile, rng: np.random.Generator, start_deg: tuple[float, ...] | None = None
) -> Trial:
    """Bootstrap a cell without pictures: the true cell's corners go straight to the guide."""
    assert cell.layout is not None
    start = np.radians(cell.layout.home_deg if start_deg is None else start_deg)
    guard = NearGuard.around(cell, start, LayoutUncertainty())
    stops = [start]
    try:
        guard.check_surroundings()
        guide = BootstrapGuide(cell, cell.layout, guard, LayoutUncertainty())
        guide.checked(frame_of(cell, start, 0, rng))
        while (view := guide.next_view()) is not None:
            stops.append(np.array(view.joints()))
            if whole(cell, stops[-1][None])[0]:
                guide.checked(frame_of(cell, stops[-1], len(stops), rng))
        assert guide.knowledge is not None
        found = Found.of(guide.knowledge, guide.layout)
    except (CellError, SafetyError) as refusal:
        return Trial(cell, np.array(stops), None, None, str(refusal))
    try:
        found.check_good(guide.refusal)
        plan = design_plan(found.in_cell(cell))
    except CellError as refusal:
        return Trial(cell, np.array(stops), found, None, str(refusal))
    return Trial(cell, np.array(stops), found, _joints(plan), None)


def frame_of(
    cell: CellFile, joints_rad: FloatArray, index: int, rng: np.random.Generator
) -> Checked:
    """What a run's check would say of the true cell at these joints, its arm's scatter in it."""
    board, camera, truth = cell.board.board(), cell.camera, cell.simulation
    assert truth is not None
    logged = arm(cell.robot.model or "").forward(joints_rad)
    scatter = np.repeat([truth.noise.arm_position_m, truth.noise.arm_rotation_rad], 3)
    error = scatter * rng.standard_normal((1, 6))
    blank = Views.blank(
        board, width_px=camera.width, height_px=camera.height, frames=1, mount=cell.mount
    )
    log = {"robot_model": cell.robot.model, "joints_rad": joints_rad[None]}
    views = replace(blank, base_from_flange=logged[None], **log)
    corners = predict(truth_of(cell), views, errors=Errors(error))[0]
    corners = corners + truth.noise.corner_px * rng.standard_normal(corners.shape)
    state = ArmState(
        host_t_s=0.0,
        controller_t_s=None,
        joints_rad=tuple(joints_rad.tolist()),
        joint_velocity_rad_s=None,
        base_from_flange=RigidTransform.from_matrix(logged),
        motion=Motion.STEADY,
    )
    shot = Shot(index, Frame(np.zeros((2, 2), np.uint8), 0.0), (state,), state.joints_rad or ())
    each = np.ones(board.corner_count)
    covariance = np.tile(np.eye(2), (board.corner_count, 1, 1))
    detection = Detection(corners, covariance, each, each, each, True, 0.0)
    return Checked(shot, Verdict(None, detection), FrameRecord(frame=index))


def _joints(plan: PlanFile) -> FloatArray:
    return np.array([view.joints() for view in plan.views])
