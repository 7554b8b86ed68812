"""`cell bootstrap`: look, move a little, find camera and board, plan the rest."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calib.views import FloatArray
from cell.devices.factory import real_devices, simulated_devices
from cell.devices.planned_camera import PlannedCamera
from cell.errors import InputError
from cell.sequencer.guard import Guard
from cell.sequencer.sequencer import Devices
from cell.sequencer.session import record_plan
from cell.sequencer.states import Finish, RunResult
from cell.sequencer.watcher import Watcher
from cell.storage.files.cell_file import CellFile, read_cell
from cell.storage.files.plan_file import SCHEMA, Plan, PlanFile
from cell.storage.files.writing import check_new, write_new, yaml_text
from cell.verbs.bootstrap.guide import BootstrapGuide
from cell.verbs.bootstrap.layout_uncertainty import LayoutUncertainty
from cell.verbs.bootstrap.near_guard import JOINT_SPEED_DEG_S, SPEED_M_S, NearGuard
from cell.verbs.bootstrap.probing import ProbingGuide
from cell.verbs.bootstrap.result_file import Found
from cell.verbs.bootstrap.start_pose import start_joints_rad
from cell.verbs.plan import design_plan

_MOVED_THROUGH = (Finish.COMPLETED, Finish.COMPLETED_WITH_LOSSES)


@dataclass(frozen=True)
class Bootstrap:
    """A cell to be found, and where the results go.

    Attributes
    ----------
    path, cell:
        The cell file, read; its layout may be missing.
    uncertainty:
        How far the layout may be off.
    recording:
        Folder of the frames.
    found_path, plan_path:
        Files to be written.
    """

    path: Path
    cell: CellFile
    uncertainty: LayoutUncertainty
    recording: Path
    found_path: Path
    plan_path: Path

    @classmethod
    def of(
        cls, path: Path, recording: Path, beside: Path, uncertainty: LayoutUncertainty
    ) -> Bootstrap:
        """Read the cell; nothing has moved yet.

        Parameters
        ----------
        path, recording:
            The cell file, and the folder of the frames.
        beside:
            Folder of the new cell and plan.
        uncertainty:
            How far the layout may be off.

        Raises
        ------
        InputError
            The cell does not say enough, or the results are in the way of older ones.
        """
        cell = read_cell(path)
        PlannedCamera.of(cell)  # a lens nobody knows is found out before anything moves
        stem = path.name.split(".")[0]
        found, plan = beside / f"{stem}.found.yaml", beside / f"{stem}.found.plan.yaml"
        check_new(found)
        check_new(plan)
        return cls(path, cell, uncertainty, recording, found, plan)

    def devices(self, *, dry_run: bool, start_deg: tuple[float, ...] | None = None) -> Devices:
        """Arm and camera; in a dry run the arm stands at `start_deg`, or the layout's home.

        Raises
        ------
        InputError
            The cell's devices are simulated and this is no dry run, or nobody states where the
            simulated arm stands.
        """
        if not dry_run:
            return real_devices(self._plan(np.zeros(6), self.cell))
        cell, layout = self.cell, self.cell.layout
        if start_deg is None and layout is None:
            raise InputError(
                f"{self.path}: has no layout.home_deg: say with --start-deg where the simulated"
                " arm stands"
            )
        if start_deg is None:
            assert layout is not None
            start_deg = layout.home_deg
        elif layout is not None:
            layout = layout.model_copy(update={"home_deg": start_deg})
            cell = cell.model_copy(update={"layout": layout})
        return simulated_devices(self._plan(np.radians(start_deg), cell))

    def run(
        self, devices: Devices, *, simulated: bool, watchers: Iterable[Watcher] = ()
    ) -> Bootstrapped:
        """Move, and find what the frames show.

        Raises
        ------
        InputError, SafetyError, DeviceError
            Nothing was moved.
        """
        named = Guard(self.cell, SPEED_M_S, np.radians(JOINT_SPEED_DEG_S)).kinematics
        start_rad = start_joints_rad(devices, named)
        guard = NearGuard.around(self.cell, start_rad, self.uncertainty)
        guard.check_surroundings()
        guide = self._guide(guard)
        result = record_plan(
            self._plan(start_rad, self.cell),
            self.recording,
            devices,
            simulated=simulated,
            watchers=watchers,
            guide=guide,
        )
        finder = guide.then if isinstance(guide, ProbingGuide) else guide
        if result.finish not in _MOVED_THROUGH or finder is None or finder.knowledge is None:
            return Bootstrapped(result)
        return Bootstrapped(result, Found.of(finder.knowledge, finder.layout), finder.refusal)

    def _guide(self, guard: NearGuard) -> BootstrapGuide | ProbingGuide:
        layout = self.cell.layout
        if layout is None:
            return ProbingGuide(self.cell, guard, self.uncertainty)
        return BootstrapGuide(self.cell, layout, guard, self.uncertainty)

    def _plan(self, start_rad: FloatArray, cell: CellFile) -> Plan:
        """The view from where the arm stands; the guide adds the others."""
        data = {
            "schema": SCHEMA,
            "name": f"bootstrap of {cell.name}",
            "cell": cell,
            "speed_m_s": SPEED_M_S,
            "joint_speed_deg_s": JOINT_SPEED_DEG_S,
            "exposure": {"focus": "auto" if cell.camera.focus == "auto" else "hold"},
            "retry": {"attempts": 2, "give_up_after": 1},
            "views": [{"name": "where it stood", "joints_rad": start_rad.tolist()}],
        }
        return Plan(self.path, PlanFile.model_validate(data), cell)

    def write(self, done: Bootstrapped) -> int:
        """Write the new cell and its plan; returns how many views that has.

        Raises
        ------
        BadAnswer
            What was found is not enough to plan with; nothing is written.
        InputError
            A file cannot be written, or the arm can take too few views: the cell is written then.
        """
        found = done.found
        assert found is not None
        found.check_good(done.refusal)
        cell = found.in_cell(self.cell)
        comment = [f"Found by `cell bootstrap {self.path.name}`; frames in {self.recording}."]
        text = yaml_text(cell.as_mapping(), comment="\n".join(comment + found.lines()))
        write_new(self.found_path, text)
        try:
            plan = design_plan(cell, cell_path=self.found_path.name)
        except InputError as unplanned:
            raise InputError(
                f"{self.found_path} is written, but has no plan: {unplanned}"
            ) from None
        comment = [f"Made by `cell bootstrap {self.path.name}` for {self.found_path.name}."]
        write_new(self.plan_path, yaml_text(plan.as_mapping(), comment=comment[0]))
        return len(plan.views)


@dataclass(frozen=True)
class Bootstrapped:
    """How the moves ended, and what they found.

    Attributes
    ----------
    result:
        How the moves ended.
    found:
        None where they ended too early.
    refusal:
        Why the last move that was left out, or made smaller, was.
    """

    result: RunResult
    found: Found | None = None
    refusal: str = ""
