"""`plan.yaml`: the views to take, how fast to go, and what a good frame is."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final, Literal, Self

import numpy as np
from pydantic import Discriminator, Field, PositiveInt, Tag, model_validator

from cell.errors import InputError
from cell.storage.files.cell_file import CellFile, read_cell, with_arm_known
from cell.storage.files.parts import Distance, Duration, Finite, Joints, Part, Pose, Positive
from cell.storage.files.yaml_model import check_schema, parse_model, position_of, read_mapping
from cell.storage.incoming import inside, plain_file
from cell.storage.incoming.limits import DURATION_S, FRAME_NUMBER, VIEWS
from drivers.errors import SafetyError

SCHEMA: Final = "cell.plan/1"
REDUCED_SPEED_M_S = 0.25
"""Reduced speed of manual operation, ISO 10218-1: more needs a fence."""
SLOWEST_M_S, FASTEST_M_S = 1e-3, 10.0
"""Slower, and a move takes hours; faster than any arm of this class."""
SLOWEST_DEG_S, FASTEST_DEG_S = 0.1, 1000.0


def _how_given(cell: object) -> str:
    return "path" if isinstance(cell, str) else "inline"


CellOrPath = Annotated[
    Annotated[CellFile, Tag("inline")] | Annotated[str, Tag("path")], Discriminator(_how_given)
]
AnyJoints = Annotated[tuple[Finite, ...], Field(min_length=1, max_length=12)]


class View(Part):
    """One pose to take a frame at: joint angles, or the flange's pose.

    A plan made from a recording (a twin) may carry the log's columns too; they are given to the
    simulated recording as they are and do not move anything, but for `focus_position` where
    `exposure.focus` is `position`: the lens goes there before the frame.
    """

    name: str | None = None
    station: Literal["parallel", "varied"] | None = None
    """`parallel`: the board fronto-parallel, for the scale factors. `varied`: tilted."""
    joints_deg: Joints | None = None
    joints_rad: AnyJoints | None = None
    base_from_flange: Pose | None = None
    frame: int | None = Field(default=None, ge=0, le=FRAME_NUMBER)
    t_s: Finite | None = None
    joint_velocity_rad_s: AnyJoints | None = None
    approach_joints_rad: AnyJoints | None = None
    temperature_c: Finite | None = None
    focus_position: Finite | None = None
    focus_distance_m: Distance | None = None
    exposure_s: Duration | None = None
    log: dict[str, Finite | str] | None = None
    """Further keys of the log, as they are to stand there."""

    @model_validator(mode="after")
    def _one_place(self) -> Self:
        if self.joints_deg is not None and self.joints_rad is not None:
            raise ValueError("has joints_deg and joints_rad; give one of them")
        if self.joints() is None and self.base_from_flange is None:
            raise ValueError("needs a place: joints_deg, joints_rad or base_from_flange")
        return self

    def joints(self) -> tuple[float, ...] | None:
        """Joint angles in radians, or None where the view is a pose."""
        if self.joints_deg is not None:
            return tuple(np.radians(self.joints_deg).tolist())
        return self.joints_rad


class Settle(Part):
    """When the arm stands still: judged from its own state."""

    still_s: float = Field(default=0.1, ge=0, le=DURATION_S)
    """It must have reported so for this long without a break."""
    timeout_s: Duration = 10.0
    """Longer than this after the move, and the view is given up."""


class Exposure(Part):
    """The camera's settings during the run."""

    exposure_s: Duration | None = None
    gain_db: Finite | None = None
    focus: Literal["auto", "hold", "position"] = "hold"
    """`auto`: focus once at every pose, then log; `position`: go to the view's `focus_position`, or
    to the one given here."""
    focus_position: Finite | None = None
    timeout_s: Duration = 5.0
    """How long to wait for a frame."""


class Checks(Part):
    """What a frame must be, or it is taken again."""

    board: bool = True
    """Corners of the board must be found."""
    min_corners: PositiveInt = 6
    max_blur_px: Positive | None = 6.0
    """Edge blur (Gaussian sigma) of the corners; null does not ask."""
    max_saturated: float = Field(default=0.05, ge=0, le=1)
    """Share of the picture's pixels at full scale."""
    pose_agrees_m: Positive = 0.0005
    """Flange poses read before and after the exposure lie this near to each other."""
    pose_agrees_rad: Positive = 0.0005


class Retry(Part):
    """What to do with a frame that fails its checks."""

    attempts: int = Field(default=3, ge=1, le=1000)
    then: Literal["skip", "stop"] = "skip"
    give_up_after: PositiveInt = 5
    """So many views skipped before the first good frame end the run."""


class Until(Part):
    """When the run may end before it has taken all its views."""

    alpha_sigma_px: Positive
    """Goal: one sigma of the scale factor alpha, at every distance that the plan has, pixels."""
    min_views: int = Field(default=12, ge=6)
    """No end before so many frames take part."""


class PlanFile(Part):
    """The whole of a plan file."""

    schema_: Literal["cell.plan/1"] = Field(default=SCHEMA, alias="schema")
    name: str
    cell: CellOrPath
    """Path of a cell file in the plan's folder or below, or the cell itself."""
    speed_m_s: float = Field(default=0.1, ge=SLOWEST_M_S, le=FASTEST_M_S)
    """Greatest speed of the flange; above 0.25 only with `fenced: true`."""
    joint_speed_deg_s: float = Field(default=30.0, ge=SLOWEST_DEG_S, le=FASTEST_DEG_S)
    fenced: bool = False
    """People cannot reach the arm while it moves: it may be faster than 0.25 m/s."""
    settle: Settle = Settle()
    exposure: Exposure = Exposure()
    checks: Checks = Checks()
    retry: Retry = Retry()
    until: Until | None = None
    """End early when the camera is known well enough; all views are taken where this is absent."""
    views: tuple[View, ...] = Field(min_length=1, max_length=VIEWS)

    @model_validator(mode="after")
    def _corners_for_until(self) -> Self:
        if self.until is not None and not self.checks.board:
            raise ValueError("until needs the board's corners: take checks.board: false away")
        return self

    @model_validator(mode="after")
    def _position_given(self) -> Self:
        if self.exposure.focus != "position" or self.exposure.focus_position is not None:
            return self
        without = [k for k, view in enumerate(self.views) if view.focus_position is None]
        if without:
            raise ValueError(
                "exposure.focus: position needs exposure.focus_position, or a focus_position in"
                f" every view; views.{without[0]} has none"
            )
        return self

    def focus_position(self, index: int) -> float | None:
        """Where the focus drive goes for a view with `exposure.focus: position`."""
        own = self.views[index].focus_position
        return self.exposure.focus_position if own is None else own

    def as_mapping(self) -> dict[str, Any]:
        """Plain dicts and lists, keys as in the file, defaults left out."""
        data = self.model_dump(mode="json", by_alias=True, exclude_defaults=True)
        first = {"schema": SCHEMA, "name": self.name, "cell": data["cell"]}
        return first | {"speed_m_s": self.speed_m_s} | data


@dataclass(frozen=True)
class Plan:
    """A plan with its cell, checked.

    Attributes
    ----------
    path:
        Where it was read.
    file:
        The plan.
    cell:
        Its cell, read too.
    """

    path: Path
    file: PlanFile
    cell: CellFile

    @property
    def sha256(self) -> str:
        """Fingerprint of plan and cell: what a resumed run must have in common.

        When the run may end early is not: the frames are the same ones.
        """
        content = [
            self.file.model_dump(mode="json", exclude={"until"}),
            self.cell.model_dump(mode="json"),
        ]
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()

    def view_name(self, index: int) -> str:
        """A view's name, or its number."""
        return self.file.views[index].name or f"view {index}"

    def where(self, index: int) -> str:
        """Where a view stands, for messages."""
        return f"{self.path}: views.{index} ({self.view_name(index)})"


def read_plan(path: Path) -> Plan:
    """Read a plan and its cell.

    Raises
    ------
    InputError
        With every error of the file, each with line and column.
    SafetyError
        The plan is faster than 0.25 m/s and does not say that the cell is fenced.
    """
    data = read_mapping(path)
    check_schema(path, data, SCHEMA)
    file = parse_model(path, data, PlanFile)
    if file.speed_m_s > REDUCED_SPEED_M_S and not file.fenced:
        line, column = position_of(data, ("speed_m_s",))
        raise SafetyError(
            f"{path}:{line}:{column}: speed_m_s: {file.speed_m_s} m/s is faster than"
            f" {REDUCED_SPEED_M_S} m/s. Slow down, or, where nobody can reach the moving arm,"
            " write `fenced: true`."
        )
    return Plan(path, file, _cell_of(path, file))


def _cell_of(path: Path, file: PlanFile) -> CellFile:
    if isinstance(file.cell, CellFile):
        return with_arm_known(path, file.cell)
    cell_path = inside(path.parent, file.cell, f"{path}: cell")
    if not plain_file(cell_path):
        raise InputError(
            f"{path}: cell: {cell_path} is not there; the path counts from the plan's folder"
        )
    return read_cell(cell_path)
