"""`study.yaml`: many simulated runs of a plan, or many recordings, and what is varied in them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final, Literal, Self

from pydantic import AfterValidator, Discriminator, Field, Tag, model_validator

from cell.errors import InputError
from cell.storage.files.cell_file import EffectFile
from cell.storage.files.parts import Finite, Part, Positive
from cell.storage.files.plan_file import Plan, read_plan
from cell.storage.files.yaml_model import check_schema, parse_model, position_of, read_mapping
from cell.storage.incoming import inside, plain_file
from cell.storage.incoming.limits import FRAME_NUMBER, TASKS

SCHEMA: Final = "cell.study/1"
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
KINDS = ("monte_carlo", "power", "recordings")


def _in_order(ends: tuple[float, float]) -> tuple[float, float]:
    if not ends[0] < ends[1]:
        raise ValueError("the first value must be below the second")
    return ends


class Spread(Part):
    """A value drawn anew for every seed."""

    uniform: Annotated[tuple[Finite, Finite], AfterValidator(_in_order)] | None = None
    """Between these two."""
    normal: tuple[Finite, Positive] | None = None
    """Mean and one sigma."""

    @model_validator(mode="after")
    def _one_law(self) -> Self:
        if (self.uniform is None) == (self.normal is None):
            raise ValueError("needs exactly one of uniform and normal")
        return self


class LevelSpread(Part):
    """A noise level drawn anew for every seed."""

    uniform: Annotated[tuple[NotNegative, NotNegative], AfterValidator(_in_order)]
    """Between these two."""


def _how_given(value: object) -> str:
    if isinstance(value, (dict, Spread, LevelSpread)):
        return "spread"
    return "list" if isinstance(value, (list, tuple)) else "number"


Amount = Annotated[
    Annotated[Spread, Tag("spread")]
    | Annotated[tuple[Finite, ...], Tag("list")]
    | Annotated[Finite, Tag("number")],
    Discriminator(_how_given),
]
Level = Annotated[
    Annotated[LevelSpread, Tag("spread")] | Annotated[NotNegative, Tag("number")],
    Discriminator(_how_given),
]


class VariedEffect(Part):
    """An effect of the catalogue; each of its values may be drawn."""

    name: str
    law: str | None = None
    parameters: dict[str, Amount] = Field(default_factory=dict)


class VariedNoise(Part):
    """Noise in place of the cell's own; a level that is not given stays the cell's."""

    corner_px: Level | None = None
    arm_position_m: Level | None = None
    arm_rotation_rad: Level | None = None


class Case(Part):
    """One way the cell may be; every seed is run in it."""

    name: str
    effects: tuple[VariedEffect, ...] | None = None
    """In place of the cell's own; null keeps those, an empty list takes them away."""
    noise: VariedNoise = VariedNoise()


class MonteCarlo(Part):
    """Simulate a plan, calibrate it, and hold the result against the truth."""

    plan: str
    """Path of a plan, in the study file's folder or below."""
    seeds: int = Field(gt=0, le=TASKS)
    """How many seeds every case is run with."""
    first_seed: int = Field(default=0, ge=0, le=FRAME_NUMBER)
    cases: tuple[Case, ...] = Field(default=(Case(name="as it is"),), min_length=1)

    @model_validator(mode="after")
    def _names_differ(self) -> Self:
        names = [case.name for case in self.cases]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"two cases are called {twice[0]!r}")
        return self


class PowerStudy(Part):
    """Simulate a plan with one effect at a time, and see whether the diagnosis names it."""

    plan: str
    """Path of a plan, in the study file's folder or below."""
    seeds: int = Field(gt=0, le=TASKS)
    """How many seeds each effect is run with at each size, and the cell without any effect."""
    first_seed: int = Field(default=0, ge=0, le=FRAME_NUMBER)
    effects: tuple[EffectFile, ...] | None = None
    """At size 1; amounts not given stand at their usual size. Null: all that such a plan can
    show."""
    sizes: tuple[Positive, ...] = Field(default=(1.0,), min_length=1)
    """Factors on the effects' amounts."""
    noise: VariedNoise = VariedNoise()


class Recordings(Part):
    """Calibrate or diagnose recordings."""

    folders: tuple[str, ...] = Field(min_length=1)
    """Folders of recordings below the study file's own, or patterns such as `runs/*`."""
    verbs: tuple[Literal["calibrate", "diagnose"], ...] = Field(
        default=("calibrate",), min_length=1
    )


class StudyFile(Part):
    """The whole of a study file: a name, and one kind of study."""

    schema_: Literal["cell.study/1"] = Field(default=SCHEMA, alias="schema")
    name: str
    monte_carlo: MonteCarlo | None = None
    power: PowerStudy | None = None
    recordings: Recordings | None = None

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        if sum(getattr(self, kind) is not None for kind in KINDS) != 1:
            raise ValueError(f"needs exactly one of {', '.join(KINDS)}")
        return self

    @property
    def kind(self) -> str:
        """Which of `KINDS` it is."""
        return next(kind for kind in KINDS if getattr(self, kind) is not None)


@dataclass(frozen=True)
class Study:
    """A study with what it names, read.

    Attributes
    ----------
    path:
        Where it was read.
    file:
        The study.
    plan:
        The plan it simulates, with its cell; None for recordings.
    """

    path: Path
    file: StudyFile
    plan: Plan | None

    def as_mapping(self) -> dict[str, Any]:
        """All that its results depend on, in plain dicts and lists."""
        content: dict[str, Any] = {"study": self.file.model_dump(mode="json", by_alias=True)}
        if self.plan is not None:
            content["plan"] = self.plan.file.model_dump(mode="json", by_alias=True)
            content["cell"] = self.plan.cell.model_dump(mode="json", by_alias=True)
        return content


def read_study(path: Path) -> Study:
    """Read a study, its plan and its cell.

    Raises
    ------
    InputError
        With every error of the file, each with line and column.
    SafetyError
        As `read_plan` does.
    """
    data = read_mapping(path)
    check_schema(path, data, SCHEMA)
    file = parse_model(path, data, StudyFile)
    simulated = file.monte_carlo or file.power
    if simulated is None:
        return Study(path, file, None)
    line, column = position_of(data, (file.kind, "plan"))
    where = f"{path}:{line}:{column}: {file.kind}.plan"
    plan_path = inside(path.parent, simulated.plan, where)
    if not plain_file(plan_path):
        raise InputError(
            f"{where}: {plan_path} is not there; the path counts from the study's folder"
        )
    plan = read_plan(plan_path)
    if plan.cell.simulation is None:
        raise InputError(
            f"{plan_path}: cell {plan.cell.name} has no section `simulation`; a study needs the"
            " truth to simulate"
        )
    return Study(path, file, plan)
