"""Compiled code has a place wherever the program is installed, and the wait for it is announced."""

import os
import stat
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from numba import njit
from numba.core.caching import IndexDataCacheFile

from cell import compiled


def test_the_first_use_says_what_it_waits_for_and_the_second_does_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv(compiled.VARIABLE, str(tmp_path))
    compiled.prepare(["calibrate", "runs/bench"])
    assert capsys.readouterr().err == "", "nothing is compiled yet"
    for _ in range(2):
        njit(lambda x: x + 1)(1.0)
    reported = capsys.readouterr().err
    assert reported.count("compiling for this processor") == 1
    for quiet in (["doctor"], ["calibrate", "--help"], []):
        compiled.prepare(quiet)
    (tmp_path / "solver").mkdir()
    (tmp_path / "solver" / "accumulate._accumulate-72.py311.nbi").touch()
    compiled.prepare(["calibrate", "runs/bench"])
    njit(lambda x: x + 2)(1.0)
    assert capsys.readouterr().err == ""


def test_a_read_only_installation_without_a_home_keeps_code_in_a_folder_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(compiled.VARIABLE, "to be forgotten afterwards")
    monkeypatch.delenv(compiled.VARIABLE)
    monkeypatch.setattr(compiled, "writable", lambda place: False)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    compiled.prepare(["doctor"])
    (folder,) = tmp_path.iterdir()
    assert os.environ[compiled.VARIABLE] == str(folder)
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    # what others can write is not run
    monkeypatch.delenv(compiled.VARIABLE)
    folder.chmod(0o777)
    compiled.prepare(["doctor"])
    assert compiled.VARIABLE not in os.environ


def test_what_was_compiled_from_other_files_is_forgotten(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(compiled.VARIABLE, str(tmp_path))
    compiled.forget_stale()
    ours = tmp_path / "solver_0a1b" / "accumulate._accumulate-72.py311.nbi"
    other = tmp_path / "elsewhere" / "somebody.kernel-1.py311.nbi"
    for kept in (ours, other):
        kept.parent.mkdir()
        kept.touch()
    compiled.forget_stale()
    assert ours.exists()
    (mark,) = tmp_path.glob("*.kernels")
    # compiled by whoever used Python before the command: no mark, and newer than all the code
    mark.unlink()
    compiled.forget_stale()
    assert ours.exists()
    mark.unlink()
    os.utime(ours, (0, 0))
    compiled.forget_stale()
    assert not ours.exists()
    ours.touch()
    mark.write_text("of an older version", encoding="ascii")
    compiled.forget_stale()
    assert not ours.exists()
    assert other.exists()


def test_machine_code_is_forgotten_with_its_index(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(compiled.VARIABLE, str(tmp_path))
    index = tmp_path / "solver" / "accumulate._accumulate-72.py311.nbi"
    machine_code = index.with_name("accumulate._accumulate-72.py311.1.nbc")
    others = index.with_name("accumulate._accumulated-9.py311.1.nbc")
    index.parent.mkdir()
    for kept in (index, machine_code, others):
        kept.touch()
    (tmp_path / "calibration-cell.kernels").write_text("of an older version", encoding="ascii")
    compiled.forget_stale()
    assert not index.exists()
    assert not machine_code.exists()
    assert others.exists()


def test_first_users_at_once_do_not_take_each_others_machine_code(tmp_path: Path) -> None:
    """Each signature's file is its own, whoever wrote at the same time."""
    compiled.write_in_turn()
    writers, signatures = 6, 12
    start = threading.Barrier(writers)

    def write(writer: int) -> None:
        start.wait()
        for k in range(signatures):
            key = f"{writer}-{k}"
            IndexDataCacheFile(str(tmp_path), "kernel-1.py311", "stamp").save(key, key)

    with ThreadPoolExecutor(writers) as pool:
        list(pool.map(write, range(writers)))
    kept = IndexDataCacheFile(str(tmp_path), "kernel-1.py311", "stamp")
    keys = [f"{writer}-{k}" for writer in range(writers) for k in range(signatures)]
    assert [kept.load(key) for key in keys] == keys
