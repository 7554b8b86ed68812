"""Plans that would distinguish what a diagnosis could not: few poses, each worth several."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import islice
from typing import Any

import numpy as np

from calib.bodies import arm_bodies
from calib.chain.effect import Effect, Present
from calib.chain.effects import catalogue
from calib.chain.kinematics import ArmKinematics
from calib.chain.model import evaluate, kinematics_of
from calib.chain.optics import COLUMN
from calib.discovery.design.choose import Design, contest, t_optimal
from calib.discovery.design.power import DECISIVE
from calib.discovery.diagnosis import Ambiguity, Diagnosis
from calib.views import FloatArray, Views
from cell.devices.planned_camera import PlannedCamera
from cell.sequencer.bodies import carried_bodies
from cell.sequencer.guard import Guard
from cell.storage.files.cell_file import CellFile
from cell.storage.files.plan_file import SCHEMA as PLAN_SCHEMA
from cell.storage.files.plan_file import PlanFile
from cell.storage.files.writing import yaml_text
from cell.storage.recording import Recording
from cell.verbs.diagnose.twin import twin_cell
from cell.verbs.plan.candidates import parallel, varied
from cell.verbs.plan.planner import view_of
from cell.verbs.plan.reach import Candidate, layout_of, reachable

POSES = 8
_TWICE = 2.0
_DISTANCES, _VARIED = 16, 240
_ROOM_M = 0.03
"""How far beside and above the recorded poses the arm may go; never below them."""

_MOST_ROUNDS = 4
_COMMENT = """\
Distinguishes {0} from {1}: {worth}.
Add these views to the recorded ones and diagnose them together; taken {rounds} times they decide.
The cell is the diagnosis' twin, with simulated arm and camera: put the `robot` and `camera` of
your own cell file in their place to take the views for real. The workspace is where the recorded
arm has been."""


@dataclass(frozen=True)
class Separation:
    """A plan for one ambiguous pair.

    Attributes
    ----------
    file:
        Name of the plan file beside the diagnosis; None where no poses would do.
    text:
        Its content.
    why:
        What it is worth, or why there is none.
    """

    file: str | None
    text: str
    why: str


def separations(found: Diagnosis, recording: Recording) -> tuple[Separation, ...]:
    """One for each ambiguous pair of the diagnosis, in their order."""
    if not found.ambiguous_with:
        return ()
    kinematics = kinematics_of(found.views)
    if kinematics is None or not np.isfinite(found.views.joints_rad).all():
        none = Separation(
            None, "", "the arm's model or its joints are not known, so no poses can be checked"
        )
        return (none,) * len(found.ambiguous_with)
    cell = _cell(found, recording, kinematics)
    guard = Guard(cell, speed_m_s=0.1, joint_speed_rad_s=0.5)
    around = _Around(found, cell, guard)
    return tuple(around.separate(pair) for pair in found.ambiguous_with)


def _cell(found: Diagnosis, recording: Recording, kinematics: ArmKinematics) -> CellFile:
    """The twin's cell, with a layout and walls around where the arm has been."""
    views, content = found.views, twin_cell(found, recording)
    middle = np.median(views.joints_rad, axis=0)
    home = views.joints_rad[np.argmin(np.abs(views.joints_rad - middle).max(axis=1))]
    distance = evaluate(found.twin.model, views).distance_m
    truth = content["simulation"]
    content["layout"] = {
        "mounted": truth["mounted"],
        "fixed": truth["fixed"],
        "home_deg": [round(v, 4) for v in np.degrees(home).tolist()],
        "distances_m": [round(float(v), 4) for v in (distance.min(), distance.max())],
        "alpha_px": round(float(found.twin.model.optics[COLUMN["alpha_px"]]), 2),
    }
    cell = CellFile.model_validate(content)
    content["workspace"] = _walls(cell, views, kinematics)
    return CellFile.model_validate(content)


def _walls(cell: CellFile, views: Views, arm: ArmKinematics) -> dict[str, Any]:
    """The box that the arm's body and what it carries kept to, and a little room."""
    frames = arm.frames(views.joints_rad)
    outlines = []
    for body in (*arm_bodies(arm)[0], *carried_bodies(cell, len(arm.dh))):
        for shape in body.shapes if body.link > 1 else ():
            turned = np.einsum("nij,pj->npi", frames[:, body.link, :3, :3], shape.points_m)
            points = (turned + frames[:, body.link, None, :3, 3]).reshape(-1, 3)
            outlines += [points.min(axis=0) - shape.radius_m, points.max(axis=0) + shape.radius_m]
    low, high = np.min(outlines, axis=0), np.max(outlines, axis=0)
    # the guard keeps the clearance free before a wall, too
    room_m = _ROOM_M + cell.clearance_m
    low = low - np.array([room_m, room_m, 1e-3 + cell.clearance_m])
    high = high + room_m
    return {
        "name": "where the arm has been",
        "low_m": [round(float(v), 4) for v in low],
        "high_m": [round(float(v), 4) for v in high],
    }


def _stops(found: Diagnosis, cell: CellFile, guard: Guard) -> list[Candidate]:
    """Views of the whole board to which a free move leads from the middle of the recorded ones."""
    sight, distances = PlannedCamera.of(cell), layout_of(cell).distances_m
    square = [
        view
        for distance in np.linspace(*distances, _DISTANCES)
        for view in parallel(sight, distance)
    ]
    tilted = islice(varied(sight, distances, seed=1), _VARIED)
    stops = [
        *reachable("parallel", square, cell, guard),
        *reachable("varied", tilted, cell, guard),
    ]
    lowest = found.views.base_from_flange[:, 2, 3].min()
    return [stop for stop in stops if stop.base_from_flange[2, 3] >= lowest]


def _in_order(stops: list[Candidate], home: Candidate, guard: Guard) -> list[Candidate]:
    """Always on to the nearest that a free move leads to; over the home view where none does."""
    left, here, way = list(stops), home, list[Candidate]()
    while left:
        left.sort(key=lambda stop: float(np.abs(stop.joints_rad - here.joints_rad).max()))
        near = [s for s in left if guard.may_move(here.joints_rad, s.joints_rad)]
        here = near[0] if near else home
        way.append(here)
        left = [s for s in left if s is not here]
    if not guard.may_move(here.joints_rad, way[0].joints_rad):
        way.append(home)
    return way


class _Around:
    """The recorded poses and the candidates around them, and the contests held on them."""

    def __init__(self, found: Diagnosis, cell: CellFile, guard: Guard) -> None:
        self.found, self.cell, self.guard = found, cell, guard
        self.stops = _stops(found, cell, guard)
        self.home_rad = np.radians(cell.layout.home_deg) if cell.layout else np.zeros(6)

    def separate(self, pair: Ambiguity) -> Separation:
        """Design for one pair."""
        if len(self.stops) < 2 * POSES:
            return Separation(None, "", "too few other views can be reached from where it was")
        effects = self.found.twin.model.effects
        first = next((p for p in effects if p.effect.name == pair.names[0]), None)
        if all(effect.name != pair.names[1] for effect in catalogue()):
            return Separation(None, "", f"no plan is made for a law: {pair.experiment}")
        if first is None:
            return Separation(None, "", f"no plan of poses can: {pair.experiment}")
        design = self._design(first, _rival(pair.names[1], self.found.views))
        rounds = _rounds(design)
        worth = (
            f"{POSES} more views chosen for it add {design.ratio:.1f} times what as many random"
            f" ones add (noncentrality {design.before:.1f} now, {design.after:.1f} with them,"
            f" {design.at_random:.1f} with random ones; {DECISIVE:g} decides)"
        )
        if rounds > _MOST_ROUNDS or design.ratio < _TWICE:
            return Separation(None, "", f"no plan of poses decides it: {worth}")
        name = "separate-" + "-".join(pair.names)
        comment = _COMMENT.format(*pair.names, worth=worth, rounds=rounds)
        return Separation(f"{name}.plan.yaml", self._plan(name, design, rounds, comment), worth)

    def _design(self, first: Present, second: Effect) -> Design:
        found = self.found
        rest = [p for p in found.twin.model.effects if p.effect.name != first.effect.name]
        model = found.twin.model.with_effects(rest)
        views = found.views.joined(self._log())
        given = contest(model, first, second, views, len(found.views), found.twin.noise)
        return t_optimal(given, POSES)

    def _log(self) -> Views:
        """What the arm would log at the candidates, all after the recording's last frame."""
        views, n = self.found.views, len(self.stops)
        last = views.take(np.full(n, len(views) - 1))
        joints = np.array([stop.joints_rad for stop in self.stops])
        return replace(
            last,
            frame=int(views.frame.max()) + 1 + np.arange(n),
            base_from_flange=np.array([stop.base_from_flange for stop in self.stops]),
            joints_rad=joints,
            approach_joints_rad=np.repeat(self.home_rad[None], n, axis=0),
            joint_velocity_rad_s=np.zeros_like(joints),
            focus_distance_m=_focus(views.focus_distance_m, n),
        )

    def _plan(self, name: str, design: Design, rounds: int, comment: str) -> str:
        pose = self.guard.kinematics.forward(self.home_rad)
        home = Candidate("varied", self._home_distance_m(), pose, self.home_rad)
        way = _in_order([self.stops[k] for k in design.picked], home, self.guard) * rounds
        plan: dict[str, Any] = {
            "schema": PLAN_SCHEMA,
            "name": name,
            "cell": self.cell,
            "views": [view_of(k, stop) for k, stop in enumerate(way)],
        }
        if self.cell.camera.focus == "auto":
            plan["exposure"] = {"focus": "auto"}
        return yaml_text(PlanFile.model_validate(plan).as_mapping(), comment=comment)

    def _home_distance_m(self) -> float:
        """Distance at the recorded pose that serves as home."""
        views = self.found.views
        at = int(np.argmin(np.abs(views.joints_rad - self.home_rad).max(axis=1)))
        return float(evaluate(self.found.twin.model, views).distance_m[at])


def _rounds(design: Design) -> int:
    """How often the views must be taken until they decide: the arm scatters anew each time."""
    gain = max(design.after - design.before, 1e-9)
    return max(1, int(np.ceil(min((DECISIVE - design.before) / gain, 1e6))))


def _rival(name: str, views: Views) -> Effect:
    return next(e for e in catalogue() if e.name == name and e.missing(views) is None)


def _focus(logged: FloatArray, frames: int) -> FloatArray:
    """The focus stays where it stood, or follows the board where it was not logged or moved."""
    stands = np.isfinite(logged).all() and np.ptp(logged) < 1e-9
    return np.full(frames, logged[0] if stands else np.nan)
