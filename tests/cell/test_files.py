from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import jsonschema
import pytest
from ruamel.yaml import YAML

from cell.errors import EXIT_INPUT, InputError
from cell.storage.files.cell_file import read_cell
from cell.storage.files.plan_file import read_plan
from cell.storage.files.schemas import FOLDER, MODELS, schema_text
from drivers.errors import SafetyError
from tests.cell.plans import CELL, PLAN


def write(folder: Path, plan: str = PLAN, cell: str = CELL) -> Path:
    (folder / "bench.yaml").write_text(cell)
    (folder / "plan.yaml").write_text(plan)
    return folder / "plan.yaml"


def test_plan_and_cell_are_read(tmp_path: Path) -> None:
    plan = read_plan(write(tmp_path))
    assert plan.cell.robot.model == "ur5e"
    assert plan.file.views[1].joints() == pytest.approx([0.0872665] + [-1.5707963, 1.5707963]
                                                        + [-1.5707963] * 2 + [0])  # fmt: skip
    assert plan.view_name(1) == "view 1"


def test_all_errors_of_a_file_at_once_with_line_and_column(tmp_path: Path) -> None:
    broken = (
        PLAN.replace("speed_m_s: 0.2", "spedd_m_s: 0.2")
        .replace("[5, -85, 90, -90, -90, 0]", "[5, -85, 90, -90, -90]")
        .replace("{name: first, ", "{exposure_s: -5, ")
    )
    with pytest.raises(InputError) as caught:
        read_plan(write(tmp_path, broken))
    lines = str(caught.value).splitlines()
    plan = tmp_path / "plan.yaml"
    assert f"{plan}:4:1: spedd_m_s: is not a known key; did you mean `speed_m_s`?" in lines
    assert any(line.startswith(f"{plan}:6:4: views.0.exposure_s: ") for line in lines)
    assert any(line.startswith(f"{plan}:8:4: views.2.joints_deg: ") for line in lines)
    assert len(lines) == 3
    assert caught.value.exit_status == EXIT_INPUT


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("driver: sim", "driver: ur", "yaml:3:1: robot.address: is missing"),
        ("driver: sim, m", "driver: kuka, m", r"bench.yaml:3:\d+: robot"),
        ("rows: 4", "rosw: 4", "board.rosw: is not a known key; did you mean `rows`?"),
        ("low_m: [-1, -1, -0.2]", "low_m: [2, -1, -0.2]", "workspace: low_m must be below"),
        ("rpy_deg: [0, 0, 0]", "q_xyzw: [0, 0, 0, 2]", "q_xyzw: is no unit quaternion"),
        (", rpy_deg: [0, 0, 0]", "", "layout.mounted: needs a rotation"),
    ],
)  # fmt: skip
def test_cell_errors(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in CELL
    with pytest.raises(InputError, match=message):
        read_plan(write(tmp_path, cell=CELL.replace(old, new, 1)))


def test_missing_files(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nowhere.yaml: cannot be read"):
        read_cell(tmp_path / "nowhere.yaml")
    plan = write(tmp_path)
    (tmp_path / "bench.yaml").unlink()
    with pytest.raises(InputError, match=r"plan.yaml: cell: .*bench.yaml is not there"):
        read_plan(plan)


def test_a_process_killed_while_it_writes_leaves_what_was_there(tmp_path: Path) -> None:
    report = tmp_path / "report.html"
    report.write_text("of yesterday")
    script = (
        "import os, sys; from pathlib import Path; from cell.storage.atomic import atomic_file\n"
        "with atomic_file(Path(sys.argv[1])) as file:\n"
        "    file.write('x' * 100_000); file.flush(); os.kill(os.getpid(), 9)\n"
    )
    died = subprocess.run([sys.executable, "-c", script, str(report)], check=False)
    assert died.returncode == -9
    assert report.read_text() == "of yesterday"


def test_key_given_twice_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"plan.yaml:\d+:\d+: is not valid YAML: .*duplicate key"):
        read_plan(write(tmp_path, PLAN + "name: again\n"))


def test_faster_than_reduced_speed_is_refused_unless_fenced(tmp_path: Path) -> None:
    fast = PLAN.replace("speed_m_s: 0.2", "speed_m_s: 0.3")
    with pytest.raises(SafetyError, match=r"plan.yaml:4:1: speed_m_s: 0.3 m/s is faster than 0.25"):
        read_plan(write(tmp_path, fast))
    assert read_plan(write(tmp_path, fast + "fenced: true\n")).file.speed_m_s == 0.3


def test_fingerprint_follows_plan_and_cell(tmp_path: Path) -> None:
    first = read_plan(write(tmp_path)).sha256
    assert read_plan(write(tmp_path)).sha256 == first
    assert read_plan(write(tmp_path, PLAN.replace("0.2", "0.1"))).sha256 != first
    assert read_plan(write(tmp_path, cell=CELL.replace("0.03", "0.02"))).sha256 != first


def test_a_view_may_hold_a_pose_and_the_log_of_a_recording(tmp_path: Path) -> None:
    view = (
        "- {joints_rad: [0, -1.5, 1.5, -1.5, -1.5, 0], t_s: 3.0, temperature_c: 21.5,"
        " base_from_flange: {p_m: [0.5, 0, 0.4], q_xyzw: [0, 1, 0, 0]}}\n"
    )
    plan = read_plan(write(tmp_path, PLAN + view))
    assert plan.file.views[-1].temperature_c == 21.5
    with pytest.raises(InputError, match=r"views.4: needs a place"):
        read_plan(write(tmp_path, PLAN + "- {name: nowhere}\n"))


@pytest.mark.parametrize("name", MODELS)
def test_published_schemas_are_in_step(name: str) -> None:
    assert (FOLDER / name).read_text() == schema_text(MODELS[name]), (
        "python -m cell.storage.files.schemas"
    )


@pytest.mark.parametrize(("name", "text"), [("cell.schema.json", CELL), ("plan.schema.json", PLAN)])
def test_published_schemas_accept_the_files(name: str, text: str) -> None:
    schema = YAML(typ="safe").load((FOLDER / name).read_text())
    jsonschema.validate(YAML(typ="safe").load(text), schema)
