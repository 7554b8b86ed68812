"""Studies on real worker processes: killed, stopped, gone on with; and on a scheduler's workers."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import dask
import pyarrow.parquet as pq
import pytest
from distributed import LocalCluster

from cell.cli.app import main
from cell.errors import InputError
from cell.storage.files.plan_file import read_plan
from cell.storage.files.study_file import read_study
from cell.verbs.doctor import examine
from cell.verbs.simulate import simulate_corners, with_truth
from cell.verbs.study import cluster, extra, run
from cell.verbs.study.folder import FAILURES, MANIFEST, RESULTS, StudyFolder
from cell.verbs.study.kinds import kind_of
from cell.verbs.study.run import Outcome, run_study
from cell.verbs.study.trial import truth_of
from tests.study.killers import KILLER, kill_or_work
from tests.study.studies import seeds, study, write_plan, write_study

pytestmark = pytest.mark.slow

CommandResult = tuple[int, str, str]
Cell = Callable[..., CommandResult]


def rows_on_disk(folder: Path, table: str = RESULTS) -> list[dict[str, Any]]:
    """As anybody would read them."""
    rows: list[dict[str, Any]] = pq.read_table(folder / table).to_pylist()
    return rows


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    """The address of a scheduler with a worker, in this process to be quick."""
    with dask.config.set({"distributed.scheduler.http.routes": []}), LocalCluster(
        n_workers=1,
        threads_per_worker=1,
        processes=False,
        protocol="tcp://",
        host="127.0.0.1",
        dashboard_address="127.0.0.1:0",
    ) as there:  # fmt: skip
        yield there.scheduler_address


@pytest.fixture
def cell(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., CommandResult]:
    def call(*words: str | Path) -> CommandResult:
        monkeypatch.setattr(sys, "argv", ["cell", *map(str, words)])
        with pytest.raises(SystemExit) as left:
            main()
        output = capsys.readouterr()
        return int(left.value.code or 0), output.out, output.err

    return call


def test_a_worker_killed_in_the_middle_costs_nothing_but_its_task(tmp_path: Path) -> None:
    asked, folder, killed = study(tmp_path, seeds(4)), tmp_path / "out", []

    def kill_the_first_to_deliver(done: int, total: int) -> None:
        if done and not killed:
            killed.append(int(rows_on_disk(folder)[0]["worker"].split(":")[1]))
            os.kill(killed[0], signal.SIGKILL)

    outcome = run_study(asked, folder, workers=2, listener=kill_the_first_to_deliver)
    assert killed
    rows = rows_on_disk(folder)
    assert sorted(row["key"] for row in rows) == [f"as it is/seed {k}" for k in range(4)]
    assert {row["status"] for row in rows} == {"done"}
    assert not outcome.failed


def test_a_task_that_kills_its_workers_fails_and_all_others_are_done(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked, folder = study(tmp_path, seeds(3)), tmp_path / "out"
    monkeypatch.setattr(run, "work", kill_or_work)
    # one worker has the killer and an innocent at once; a death each is enough to give up both
    with dask.config.set({"distributed.scheduler.allowed-failures": 0}):
        outcome = run_study(asked, folder, workers=1)
    (failed,) = outcome.failed
    assert failed["key"] == f"as it is/seed {KILLER}"
    assert failed["reason"].startswith("it kills its workers: 1 died while nothing else ran, the")
    assert [row["seed"] for row in outcome.rows] == [0, 2]
    assert [row["key"] for row in rows_on_disk(folder, FAILURES)] == [failed["key"]]

    monkeypatch.undo()
    assert not run_study(asked, folder, workers=1).failed
    assert sorted(row["seed"] for row in rows_on_disk(folder)) == [0, 1, 2]


def test_ctrl_c_stops_with_status_4_and_the_rest_is_done_later(
    tmp_path: Path, scheduler: str
) -> None:
    path, folder = write_study(tmp_path, seeds(4)), tmp_path / "out"
    program = [sys.executable, "-c", "from cell.cli import main; main()"]
    words = ["study", str(path), "-o", str(folder), "--workers", "1"]
    # in a group of its own, all of which hears Ctrl-C as it would in a terminal
    running = subprocess.Popen(
        [*program, *words], stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    while not (parts := list((folder / RESULTS).glob("part-*"))):
        assert running.poll() is None
        time.sleep(0.02)
    os.killpg(running.pid, signal.SIGINT)
    _, output = running.communicate(timeout=60)
    done = rows_on_disk(folder)
    assert running.returncode == 4, output
    assert 0 < len(done) < 4
    assert output == (
        f"error: Ctrl-C: {len(done)} of 4 tasks are done and written to {folder}; the same"
        " command goes on from there\n"
    )
    before = {part: part.read_bytes() for part in parts}
    run_study(read_study(path), folder, scheduler=scheduler)
    assert {row["number"] for row in rows_on_disk(folder)} == set(range(4))
    assert len(rows_on_disk(folder)) == 4
    assert {part: part.read_bytes() for part in parts} == before


@pytest.fixture(scope="module")
def finished(
    tmp_path_factory: pytest.TempPathFactory, scheduler: str
) -> tuple[Path, Path, Outcome]:
    """A study's file and folder, and what came out."""
    content = """\
monte_carlo:
  plan: small.plan.yaml
  seeds: 2
  cases:
  - {name: as it is}
  - name: still
    effects: []
    noise: {corner_px: {uniform: [0.02, 0.1]}}
"""
    home = tmp_path_factory.mktemp("finished")
    path, reported = write_study(home, content), []
    outcome = run_study(
        read_study(path),
        home / "out",
        scheduler=scheduler,
        listener=lambda done, total: reported.append((done, total)),
    )
    assert reported == sorted(reported)
    assert (reported[0], reported[-1]) == ((0, 4), (4, 4))
    return path, home / "out", outcome


Finished = tuple[Path, Path, Outcome]


def test_nothing_is_done_twice(finished: Finished) -> None:
    path, folder, outcome = finished
    parts = sorted((folder / RESULTS).iterdir())
    again = run_study(read_study(path), folder, scheduler="tcp://127.0.0.1:1")
    assert again.rows == outcome.rows
    assert len(again.rows) == 4
    assert sorted((folder / RESULTS).iterdir()) == parts


def test_errors_are_held_against_the_truth(finished: Finished) -> None:
    _, _, outcome = finished
    cases = {case["case"]: case for case in outcome.summary["cases"]}
    z = {
        (name, solution["of"]): solution["z_rms"]
        for name, case in cases.items()
        for solution in case["solutions"]
    }
    assert z["as it is", "zhang_mle"] > 8
    for reported in ("zhang_mle", "fixed_alpha_mle", "joint_ml", "robot"):
        assert 0.2 < z["still", reported] < 3
    assert 0.2 < z["as it is", "joint_ml"] < 3
    drawn = [row["drawn"][0]["value"] for row in outcome.rows if row["case"] == "still"]
    assert len(set(drawn)) == 2
    assert all(0.02 < value < 0.1 for value in drawn)


def test_a_changed_study_is_refused(finished: Finished) -> None:
    path, folder, _ = finished
    changed = path.with_name("changed.study.yaml")
    changed.write_text(path.read_text().replace("0.1]", "0.2]"))
    with pytest.raises(InputError, match=r"changed: study.monte_carlo.cases.1.noise.corner_px.uni"):
        run_study(read_study(changed), folder)
    plan = path.with_name("small.plan.yaml")
    changed.with_name("other.plan.yaml").write_text(plan.read_text().replace("57.1", "50"))
    changed.write_text(path.read_text().replace("small.plan", "other.plan"))
    with pytest.raises(
        InputError, match=r"changed: cell\.simulation\.effects\.0\.parameters\.k_px"
    ):
        run_study(read_study(changed), folder)


def test_two_at_one_folder_are_refused(finished: Finished) -> None:
    path, folder, _ = finished
    asked = read_study(path)
    with (
        StudyFolder.opened(folder, asked, kind_of(asked).schema),
        pytest.raises(InputError, match="another `cell study` is at work there"),
    ):
        run_study(asked, folder)


def test_a_part_that_a_crash_left_is_dropped_and_none_is_overwritten(
    tmp_path: Path, finished: Finished
) -> None:
    path, folder, _ = finished
    copy = tmp_path / "copy"
    shutil.copytree(folder, copy)
    (copy / RESULTS / ".part-000009.parquet").write_bytes(b"PAR1 half")
    asked = read_study(path)
    with StudyFolder.opened(copy, asked, kind_of(asked).schema) as store:
        rows = store.done()
        store.add([{**rows[0], "key": "one more", "number": 99}])
        assert len(store.done()) == len(rows) + 1
    last = sorted((copy / RESULTS).iterdir())[-1]
    last.write_bytes(last.read_bytes()[:-20])
    with pytest.raises(InputError, match=rf"{last.name}: is no whole Parquet file"):
        run_study(asked, copy)


def test_what_failed_is_reported_and_tried_again(
    tmp_path: Path, scheduler: str, cell: Cell
) -> None:
    plan = read_plan(write_plan(tmp_path))
    for name in ("good", "broken"):
        simulate_corners(plan, tmp_path / "runs" / name)
    frames = tmp_path / "runs" / "broken" / "frames.jsonl"
    frames.rename(frames.with_suffix(".away"))
    path = write_study(tmp_path, "recordings: {folders: ['runs/*'], verbs: [calibrate]}\n")
    folder = tmp_path / "out"
    words = ("study", path, "-o", folder, "--scheduler", scheduler)

    status, out, err = cell(*words, "--json")
    assert (status, err) == (1, "")
    reported = json.loads(out)
    assert reported["tasks"] == 2
    (failed,) = reported["failed"]
    assert failed["key"].endswith("runs/broken")
    assert "frames.jsonl: cannot be read" in failed["reason"]
    assert failed["tries"] == 1
    parts = {part: part.read_bytes() for part in folder.rglob("part-*")}
    assert len(parts) == 2

    status, out, err = cell(*words)
    assert status == 1
    assert err == (
        f"1 task that failed before will be tried again; the reasons stay in {folder / FAILURES}\n"
    )
    assert "failed (2 times): calibrate " in out
    assert "2 tasks, 1 failed" in out

    frames.with_suffix(".away").rename(frames)
    status, out, err = cell(*words)
    assert status == 0
    assert "2 tasks, 0 failed" in out
    assert {part: part.read_bytes() for part in parts} == parts
    done = rows_on_disk(folder)
    assert sorted(Path(row["recording"]).name for row in done) == ["broken", "good"]
    assert {row["status"] for row in done} == {"done"}
    failures = rows_on_disk(folder, FAILURES)
    assert [Path(row["recording"]).name for row in failures] == ["broken", "broken"]
    status, _, err = cell(*words)
    assert (status, err) == (0, "")


def test_a_folder_of_another_version_is_refused(tmp_path: Path, finished: Finished) -> None:
    path, folder, _ = finished
    copy = tmp_path / "copy"
    shutil.copytree(folder, copy)
    manifest = copy / MANIFEST
    manifest.write_text(manifest.read_text().replace("study-results/2", "study-results/1"))
    with pytest.raises(InputError, match=r"another version of this program \(cell.study-results/1"):
        run_study(read_study(path), copy)


def test_power_counts_what_the_diagnosis_names(tmp_path: Path, scheduler: str) -> None:
    flexing = "{name: mount_flex, parameters: {rad_per_g: 0.0005}}"
    content = f"power: {{plan: small.plan.yaml, seeds: 1, effects: [{flexing}]}}\n"
    outcome = run_study(study(tmp_path, content), tmp_path / "out", scheduler=scheduler)
    plain, flex = outcome.summary["effects"]
    assert (plain["detected"]["share"], flex["detected"]["share"]) == (0.0, 1.0)
    assert flex["alone"]["hits"] == flex["alone"]["runs"] == 1
    estimates = next(row for row in outcome.rows if row["effect"] == "mount_flex")["estimates"]
    reported = next(estimate for estimate in estimates if estimate["quantity"] == "rad_per_g")
    assert reported["truth"] == 0.0005
    assert abs(reported["z"]) < 5


def test_recordings_of_a_folder(tmp_path: Path, scheduler: str) -> None:
    plan = read_plan(write_plan(tmp_path))
    still = with_truth(plan, truth_of(plan).model_copy(update={"effects": ()}))
    for name in ("good", "broken"):
        simulate_corners(still, tmp_path / "runs" / name)
    (tmp_path / "runs" / "broken" / "frames.jsonl").unlink()
    (tmp_path / "runs" / "something else").mkdir()
    before = sorted((tmp_path / "runs").rglob("*"))
    asked = study(tmp_path, "recordings: {folders: ['runs/*'], verbs: [calibrate, diagnose]}\n")
    outcome = run_study(asked, tmp_path / "out", scheduler=scheduler)
    rows = {(row["verb"], Path(row["recording"]).name): row for row in outcome.rows}
    assert {name for _, name in rows} == {"good"}
    assert [(row["verb"], Path(row["recording"]).name) for row in outcome.failed] == [
        ("calibrate", "broken"),
        ("diagnose", "broken"),
    ]
    assert all("frames.jsonl: cannot be read" in row["reason"] for row in outcome.failed)
    assert rows["diagnose", "good"]["verdict"] == "consistent"
    calibration = json.loads(rows["calibrate", "good"]["document"])
    assert calibration["schema"] == "cell.calibration/1"
    assert sorted((tmp_path / "runs").rglob("*")) == before
    (tmp_path / "runs" / "good").rename(tmp_path / "runs" / "later")
    assert "later" in {Path(task.recording).name for task in kind_of(asked).tasks(asked)}  # type: ignore[attr-defined]


def test_a_scheduler_that_is_not_there(
    tmp_path: Path, cell: Cell, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "REACH_S", 0.5)
    path = write_study(tmp_path, seeds(1))
    for address in ("tcp://127.0.0.1:1", "nonsense://x"):
        status, _, err = cell("study", path, "-o", tmp_path / "out", "--scheduler", address)
        assert status == 3
        assert f"--scheduler {address}: no Dask scheduler answers there" in err
        assert err.count("\n") == 1


def test_a_cluster_with_another_version_is_refused(
    tmp_path: Path, scheduler: str, cell: Cell, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "version", lambda name: "9.9")
    path = write_study(tmp_path, seeds(1))
    status, _, err = cell("study", path, "-o", tmp_path / "out", "--scheduler", scheduler)
    assert status == 3
    assert err == (
        f"error: --scheduler {scheduler}: scheduler and workers need calibration-cell[study] 9.9,"
        f" as here; the scheduler has: {version('calibration-cell')}\n"
    )


@pytest.mark.parametrize("name", extra.PACKAGES)
def test_without_the_extra_it_says_how_to_install_it(
    tmp_path: Path, cell: Cell, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setitem(sys.modules, name, None)
    status, _, err = cell("study", write_study(tmp_path, seeds(1)))
    assert status == 3
    assert err.startswith(f"error: cell study needs {name} (")
    assert "pip install 'calibration-cell[study]'" in err


def test_the_doctor_names_what_is_missing_and_does_not_mind(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def installed(name: str) -> str:
        if name in extra.PACKAGES:
            raise PackageNotFoundError(name)
        return "1.0"

    monkeypatch.setattr(import_module("cell.verbs.doctor.installed"), "version", installed)
    reported = {finding.name: finding for finding in examine(None)}
    for name in extra.PACKAGES:
        assert not reported[name].ready
        assert not reported[name].blocks
        assert extra.MEND in reported[name].line()
