"""Small studies to test on: a dozen views, a third of a second a run."""

from __future__ import annotations

from pathlib import Path

from cell.storage.files.plan_file import read_plan
from cell.storage.files.study_file import Study, read_study
from cell.storage.files.writing import yaml_text

PLAN = Path(__file__).parents[2] / "configs" / "irb140-eosens-by-hand.plan.yaml"


def write_plan(folder: Path) -> Path:
    """Every third view of the paper's plan, its cell beside it."""
    plan = read_plan(PLAN)
    file = plan.file.model_copy(update={"views": plan.file.views[::3], "cell": plan.cell})
    path = folder / "small.plan.yaml"
    path.write_text(yaml_text(file.as_mapping()), encoding="utf-8")
    return path


def write_study(folder: Path, content: str) -> Path:
    """A study file; `content` is what stands below its name."""
    if not (folder / "small.plan.yaml").exists():
        write_plan(folder)
    path = folder / "small.study.yaml"
    path.write_text(f"schema: cell.study/1\nname: small\n{content}", encoding="utf-8")
    return path


def study(folder: Path, content: str) -> Study:
    return read_study(write_study(folder, content))


def seeds(count: int) -> str:
    return f"monte_carlo: {{plan: small.plan.yaml, seeds: {count}}}\n"
