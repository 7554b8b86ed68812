"""`cell verify` from outside: recordings and plans, exit status, files, and what it refuses."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import jsonschema
import pytest

from cell.cli.app import main
from cell.storage.files.schemas import FOLDER

CONFIGS = Path(__file__).parents[2] / "configs"
PLAN = CONFIGS / "ur3-robotiq.plan.yaml"
FOCUS = "focus_breathing:law=inverse_square,k_px_m2=0.756"
KNOCKED = "mount_slip:at_frame=0,x_m=0.001"


def _cell(*words: str | Path) -> int:
    sys.argv = ["cell", *map(str, words)]
    with pytest.raises(SystemExit) as left:
        main()
    return int(left.value.code or 0)


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A calibrated recording, and two taken since: `same`, and `knocked`."""
    folder = tmp_path_factory.mktemp("bench")
    before = sys.argv
    assert _cell("simulate", PLAN, "-o", folder / "old", "--seed", "1") == 0
    assert _cell("calibrate", folder / "old") == 0
    assert _cell("simulate", PLAN, "-o", folder / "same", "--seed", "2") == 0
    knocked = ("--effect", FOCUS, "--effect", KNOCKED)
    assert _cell("simulate", PLAN, "-o", folder / "knocked", "--seed", "3", *knocked) == 0
    sys.argv = before
    return folder


Cli = pytest.CaptureFixture[str]


def test_a_recording_that_agrees_leaves_with_0(
    bench: Path, capsys: Cli, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", [])
    length = ("--length-m", "0.225", "--length-sigma-m", "0.00002", "--corners", "0,0:0,9")
    assert _cell("verify", bench / "same", bench / "old", *length, "--json") == 0
    output = json.loads(capsys.readouterr().out)
    assert output["verdict"] == "good"
    assert abs(output["length"]["error_m"]) < 4 * output["length"]["sigma_m"]
    written = json.loads((bench / "same/verify/verify.json").read_text())
    assert written == output
    assert written["program"].startswith("calibration-cell ")
    assert {"recorded", "created", "camera", "robot"} <= set(written)
    assert written["robot"]["model"] == "ur3"
    page = (bench / "same/verify/verify.html").read_text()
    assert f"This result: {written['created']}, by {written['program']}." in page
    schema = json.loads((FOLDER / "verify.schema.json").read_text())
    jsonschema.validate(written, schema)
    assert (bench / "same/verify/verify.html").stat().st_size > 50_000


def test_a_knocked_camera_leaves_with_1_and_says_by_how_much(
    bench: Path, capsys: Cli, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(sys, "argv", [])
    calibration = bench / "old/calibration/calibration.json"
    assert _cell("verify", bench / "knocked", calibration, "-o", tmp_path) == 1
    out = capsys.readouterr().out
    assert out.startswith("verdict: moved\n")
    assert "hand-eye differs by 0.9" in out
    assert f"report: {tmp_path / 'verify.html'}" in out


@pytest.mark.slow
def test_a_plan_s_most_informative_views_are_run_and_checked(
    bench: Path, capsys: Cli, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(sys, "argv", [])
    words = ("verify", PLAN, bench / "old", "--dry-run", "--views", "6", "-o", tmp_path / "now")
    assert _cell(*words, "--json") == 0
    output = json.loads(capsys.readouterr().out)
    assert output["verdict"] == "good"
    assert len(output["frames_used"]) == 6
    assert (tmp_path / "now/frames.jsonl").read_text().count("\n") == 6


@pytest.mark.parametrize(
    ("words", "reported"),
    [
        (("--length-m", "0.2"), "--length-m and --corners go together"),
        (("--length-m", "0.2", "--corners", "0-0"), "give ROW,COL:ROW,COL"),
        (("--length-m", "-1", "--corners", "0,0:0,1"), "must be above 0"),
        (("--tolerance-mm", "0"), "must be above 0"),
        (("--dry-run",), "--dry-run goes with a plan"),
    ],
)
def test_what_cannot_be_used_is_refused_in_words(
    bench: Path,
    capsys: Cli,
    monkeypatch: pytest.MonkeyPatch,
    words: tuple[str, ...],
    reported: str,
) -> None:
    monkeypatch.setattr(sys, "argv", [])
    assert _cell("verify", bench / "same", bench / "old", *words) == 2
    assert reported in capsys.readouterr().err


def test_a_recording_that_was_never_calibrated_is_no_calibration(
    bench: Path, capsys: Cli, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", [])
    assert _cell("verify", bench / "same", bench / "same") == 2
    assert "make one with: cell calibrate" in capsys.readouterr().err


def test_too_few_views_are_refused_before_anything_moves(
    bench: Path, capsys: Cli, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(sys, "argv", [])
    folder = tmp_path / "now"
    words = ("verify", PLAN, bench / "old", "--dry-run", "--views", "2", "-o", folder)
    assert _cell(*words) == 2
    assert "at least 4" in capsys.readouterr().err
    assert not folder.exists()
