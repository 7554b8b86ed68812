from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import numpy as np
import pytest

from cell.errors import InputError
from cell.sequencer.journal import Journal, read_journal
from cell.sequencer.sequencer import Devices
from cell.sequencer.session import record_plan
from cell.sequencer.states import Finish
from cell.storage.files.plan_file import Plan, read_plan
from cell.storage.recording import read_recording
from drivers.camera import Frame
from tests.cell.fakes import FakeArm, FakeCamera, FastClock
from tests.cell.plans import CELL, PLAN

ROOT = Path(__file__).parents[2]


def make_plan(folder: Path, plan: str = PLAN) -> Plan:
    (folder / "bench.yaml").write_text(CELL)
    (folder / "plan.yaml").write_text(plan + "checks: {board: false}\n")
    return read_plan(folder / "plan.yaml")


def devices() -> Devices:
    clock = FastClock()
    return Devices(FakeArm(clock.now), FakeCamera(clock.now), clock)


def test_a_run_can_be_stopped_and_gone_on_with(tmp_path: Path) -> None:
    plan = make_plan(tmp_path)
    broken = devices()
    broken.camera.grabs = [None, None, RuntimeError("a bug")]  # type: ignore[attr-defined]
    with pytest.raises(RuntimeError):
        record_plan(plan, tmp_path / "run", broken)
    result = record_plan(plan, tmp_path / "run", devices(), resume=True)
    assert (result.finish, result.frames) == (Finish.COMPLETED, 4)
    record_plan(plan, tmp_path / "whole", devices())
    broken_frames = read_recording(tmp_path / "run").frames
    for went_on, whole in zip(
        broken_frames, read_recording(tmp_path / "whole").frames, strict=True
    ):
        assert went_on.frame == whole.frame
        np.testing.assert_allclose(went_on.joints_rad, whole.joints_rad, atol=1e-12)
        np.testing.assert_allclose(
            went_on.approach_joints_rad, whole.approach_joints_rad, atol=1e-12
        )
    assert "resume" in [event["event"] for event in read_journal(tmp_path / "run")]


def test_a_clock_that_was_set_back_puts_no_frame_before_the_last_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = make_plan(tmp_path)
    broken = devices()
    broken.camera.grabs = [None, None, RuntimeError("a bug")]  # type: ignore[attr-defined]
    with pytest.raises(RuntimeError):
        record_plan(plan, tmp_path / "run", broken)
    monkeypatch.setattr(time, "time", lambda: 1e9)  # of the year 2001
    record_plan(plan, tmp_path / "run", devices(), resume=True)
    times = [frame.t_s or 0.0 for frame in read_recording(tmp_path / "run").frames]
    assert times == sorted(times)
    assert times[0] >= 0.0


def test_a_journal_that_is_deleted_ends_the_run(tmp_path: Path) -> None:
    gone = devices()
    grab = gone.camera.grab

    def grab_and_delete(timeout_s: float) -> Frame:
        (tmp_path / "run" / "journal.jsonl").unlink(missing_ok=True)
        return grab(timeout_s)

    gone.camera.grab = grab_and_delete  # type: ignore[method-assign]
    result = record_plan(make_plan(tmp_path), tmp_path / "run", gone)
    assert result.finish is Finish.DEVICE_FAILED
    assert "journal.jsonl: was deleted" in result.reason


def test_corners_found_before_a_resume_do_not_stand_for_the_whole(tmp_path: Path) -> None:
    plan = make_plan(tmp_path)
    record_plan(plan, tmp_path / "run", devices())
    (tmp_path / "run" / "detections.csv").write_text("frame,row,col,u_px,v_px\n")
    record_plan(plan, tmp_path / "run", devices(), resume=True)
    assert not read_recording(tmp_path / "run").has_detections
    assert (tmp_path / "run" / "detections-before-resume.csv").exists()


def test_a_changed_plan_is_not_gone_on_with(tmp_path: Path) -> None:
    record_plan(make_plan(tmp_path), tmp_path / "run", devices())
    changed = make_plan(tmp_path, PLAN.replace("0.2", "0.1"))
    with pytest.raises(InputError, match="another plan or cell"):
        record_plan(changed, tmp_path / "run", devices(), resume=True)


def test_simulated_and_real_frames_are_not_mixed(tmp_path: Path) -> None:
    plan = make_plan(tmp_path)
    record_plan(plan, tmp_path / "run", devices(), simulated=True)
    with pytest.raises(InputError, match="begun as a simulated run"):
        record_plan(plan, tmp_path / "run", devices(), resume=True)


def test_there_must_be_something_to_go_on_with(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="of a run to resume"):
        record_plan(make_plan(tmp_path), tmp_path / "run", devices(), resume=True)


def test_a_recording_is_not_begun_twice(tmp_path: Path) -> None:
    plan = make_plan(tmp_path)
    record_plan(plan, tmp_path / "run", devices())
    with pytest.raises(InputError, match="never overwritten"):
        record_plan(plan, tmp_path / "run", devices())


@pytest.mark.parametrize("name", ["frames.jsonl", "journal.jsonl"])
@pytest.mark.parametrize("there", [False, True])
@pytest.mark.parametrize("resume", [False, True])
def test_nothing_is_appended_to_a_file_elsewhere(
    tmp_path: Path, name: str, there: bool, resume: bool
) -> None:
    plan, folder, victim = make_plan(tmp_path), tmp_path / "run", tmp_path / "victim"
    if resume:
        record_plan(plan, folder, devices())
        (folder / name).rename(victim)
        if not there:
            victim.unlink()
    else:
        folder.mkdir()
        if there:
            victim.write_text("of somebody else")
    (folder / name).symlink_to(victim)
    before = victim.read_bytes() if there else None
    with pytest.raises(InputError, match=r"leads out of|of a run to resume"):
        record_plan(plan, folder, devices(), resume=resume)
    assert (victim.read_bytes() if victim.exists() else None) == before


def test_two_runs_do_not_write_one_recording(tmp_path: Path) -> None:
    plan = make_plan(tmp_path)
    record_plan(plan, tmp_path / "run", devices())
    other = Journal(tmp_path / "run")
    with pytest.raises(InputError, match="another run is writing"):
        record_plan(plan, tmp_path / "run", devices(), resume=True)
    other.close()


SCRIPT = """
    import sys, time
    from pathlib import Path
    from cell.storage.files.plan_file import read_plan
    from cell.sequencer.sequencer import Devices
    from cell.sequencer.session import record_plan
    from tests.cell.fakes import FakeArm, FakeCamera

    plan = read_plan(Path(sys.argv[1]))
    record_plan(plan, Path(sys.argv[2]), Devices(FakeArm(), FakeCamera()), resume=len(sys.argv) > 3)
"""


def run_script(*words: Path | str) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-c", textwrap.dedent(SCRIPT), *map(str, words)]
    return subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL)


@pytest.mark.parametrize("frames_before_the_kill", [1, 3])
def test_a_killed_run_loses_at_most_the_frame_in_hand(
    tmp_path: Path, frames_before_the_kill: int
) -> None:
    make_plan(tmp_path)
    folder = tmp_path / "run"
    lines = folder / "frames.jsonl"
    process = run_script(tmp_path / "plan.yaml", folder)
    while not lines.exists() or lines.read_bytes().count(b"\n") < frames_before_the_kill:
        assert process.poll() is None
        time.sleep(0.002)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    assert len(read_recording(folder).frames) >= frames_before_the_kill
    assert run_script(tmp_path / "plan.yaml", folder, "--resume").wait() == 0
    recording = read_recording(folder)
    assert [frame.frame for frame in recording.frames] == [0, 1, 2, 3]
    for frame, view in zip(recording.frames, make_plan(tmp_path).file.views, strict=True):
        np.testing.assert_allclose(frame.joints_rad, view.joints(), atol=1e-9)
        assert recording.image(frame).shape == (480, 640)
