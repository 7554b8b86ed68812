"""Study files: what is refused, and where the error stands."""

from __future__ import annotations

from pathlib import Path

import jsonschema
import pytest
from ruamel.yaml import YAML

from cell.errors import InputError
from cell.storage.files.schemas import FOLDER
from cell.verbs.study.kinds import kind_of
from cell.verbs.study.kinds.power import NONE
from tests.study.studies import seeds, study, write_study

CASES = """\
monte_carlo:
  plan: small.plan.yaml
  seeds: 3
  first_seed: 10
  cases:
  - {name: as it is}
  - name: bracket
    effects: [{name: mount_flex, parameters: {rad_per_g: {normal: [0, 0.001]}}}]
    noise: {corner_px: {uniform: [0.02, 0.1]}}
"""


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("seeds: 3", "sedes: 3", "5:3: monte_carlo.sedes: is not a known key; did you mean"),
        ("seeds: 3", "seeds: 0", "5:3: monte_carlo.seeds: Input should be greater than 0"),
        ("[0.02, 0.1]", "[0.2, 0.1]", r"uniform: the first value must be below the second"),
        ("[0.02, 0.1]", "[-0.2, 0.1]", r"11:\d+: monte_carlo.cases.1.noise.corner_px.uniform.0"),
        ("{normal: [0, 0.001]}", "{}", r"10:\d+: .*rad_per_g: needs exactly one of uniform and"),
        ("bracket", "as it is", "4:1: monte_carlo: two cases are called 'as it is'|3:1: monte"),
        ("small.plan", "other.plan", r"4:3: monte_carlo.plan: .*other.plan.yaml is not there"),
        ("monte_carlo:", "power: {plan: a, seeds: 1}\nmonte_carlo:", "needs exactly one of"),
    ],
)  # fmt: skip
def test_errors_stand_at_their_place(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in CASES
    with pytest.raises(InputError, match=message):
        study(tmp_path, CASES.replace(old, new, 1))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (CASES.replace("mount_flex", "mount_flax"), "case 'bracket': no effect is called"),
        (CASES.replace("rad_per_g", "rad"), "case 'bracket': mount_flex has no parameter 'rad'"),
        ("power: {plan: small.plan.yaml, seeds: 1, effects: [{name: x}]}", "power.effects: no eff"),
        ("recordings: {folders: [nothing/*]}", "nothing is at .*nothing/"),
        ("recordings: {folders: ['*.yaml']}", "nothing that .*.yaml means is a recording"),
    ],
)
def test_what_a_study_names_must_be_there(tmp_path: Path, content: str, message: str) -> None:
    asked = study(tmp_path, content)
    with pytest.raises(InputError, match=message):
        kind_of(asked).tasks(asked)


def test_every_case_is_run_with_every_seed(tmp_path: Path) -> None:
    asked = study(tmp_path, CASES)
    keys = [task.key for task in kind_of(asked).tasks(asked)]
    names = ("as it is", "bracket")
    assert keys == [f"{name}/seed {seed}" for name in names for seed in (10, 11, 12)]


def test_power_without_effects_takes_all_that_the_plan_can_show(tmp_path: Path) -> None:
    asked = study(tmp_path, "power: {plan: small.plan.yaml, seeds: 2, sizes: [1, 2]}\n")
    tasks = kind_of(asked).tasks(asked)
    labels = {task.label for task in tasks}  # type: ignore[attr-defined]
    assert {NONE, "mount_flex", "focus_breathing:thin_lens"} <= labels
    assert not {"focus_breathing:free", "rolling_shutter", "pose_time_lag"} & labels
    assert len(tasks) == 2 + 2 * 2 * (len(labels) - 1)
    assert len({task.key for task in tasks}) == len(tasks)
    slipped = next(t.effect for t in tasks if t.label == "mount_slip")  # type: ignore[attr-defined]
    assert slipped.parameters["at_frame"] > 0


def test_the_published_schema_accepts_the_files(tmp_path: Path) -> None:
    yaml = YAML(typ="safe")
    schema = yaml.load((FOLDER / "study.schema.json").read_text())
    for content in (CASES, seeds(2), "recordings: {folders: [runs/*]}\n"):
        jsonschema.validate(yaml.load(write_study(tmp_path, content).read_text()), schema)
