"""An old calibration against a camera that stayed, moved, was refocused, or sees a known length."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from calib.chain.rigid import from_vector
from calib.views import Mount, Views
from cell.errors import InputError
from cell.storage.files.verify_file import VerifyFile
from cell.verbs.export import CalibrationSource
from cell.verbs.verify.check import Checked, check
from cell.verbs.verify.length import KnownLength
from cell.verbs.verify.messages import text
from cell.verbs.verify.old_cell import old_cell
from cell.verbs.verify.page import render
from cell.verbs.verify.short_plan import choose_views
from tests.verify.new_views import calibration_text, new_views, old

MOUNTS: tuple[Mount, ...] = ("eye_in_hand", "eye_to_hand")
KNOCK = np.array([6e-4, -6e-4, 5e-4, 0.0, 0.0, 0.0])
LONG = ((0, 0), (0, 9))


def _checked(
    views: Views,
    mount: Mount = "eye_in_hand",
    known: KnownLength | None = None,
    tolerance_m: float | None = None,
) -> Checked:
    return check(
        old(mount),
        views,
        calibration="old/calibration.json",
        recording="new",
        known=known,
        tolerance_m=tolerance_m,
        left_out={},
    )


def _found(views: Views, mount: Mount = "eye_in_hand") -> VerifyFile:
    return _checked(views, mount).content


@pytest.mark.parametrize("mount", MOUNTS)
def test_a_camera_that_stayed_is_still_good_and_its_misfit_as_large_as_foretold(
    mount: Mount,
) -> None:
    found = [_found(new_views(seed, mount=mount), mount) for seed in (1, 2, 3)]
    assert [f.verdict for f in found] == ["good"] * 3
    assert not any(f.board and f.board.moved for f in found)
    frames = [frame for f in found for frame in f.frames]
    ratio = [frame.rms_px / frame.sigma_px for frame in frames]
    assert 0.6 < np.sqrt(np.mean(np.square(ratio))) < 1.4
    assert all(frame.limit_px > 1.1 * frame.sigma_px for frame in frames)
    assert np.mean([frame.rms_px > frame.limit_px for frame in frames]) < 0.05
    assert max(frame.workpiece_m for frame in frames) < 3e-4


@pytest.mark.parametrize("mount", MOUNTS)
def test_a_knock_of_a_millimetre_is_reported_with_its_size(mount: Mount) -> None:
    found = _found(new_views(4, mount=mount, camera=KNOCK), mount)
    assert found.verdict == "moved"
    assert found.mount is not None
    off = np.abs(np.array(found.mount.shift_m) - KNOCK[:3])
    assert (off < 4 * np.array(found.mount.sigma_shift_m)).all()
    assert max(found.mount.sigma_shift_m) < 2e-4
    assert found.board is not None
    assert not found.board.moved
    assert max(f.rms_px / f.limit_px for f in found.frames) > 1


def test_a_knock_inside_the_tolerance_that_was_given_is_still_good() -> None:
    knocked = new_views(4, camera=KNOCK)
    found = _checked(knocked, tolerance_m=2e-3).content
    assert found.verdict == "within_tolerance"
    assert re.match(
        r"Moved (0\.9\d*|1) mm, which makes at most .* your 2 mm: still good", found.sentence
    )
    assert text(found).startswith("verdict: still good, inside your tolerance\n")
    assert _checked(knocked, tolerance_m=8e-4).content.verdict == "moved"


def test_a_lens_refocused_by_two_thousandths_is_reported_with_its_size() -> None:
    found = _found(new_views(5, alpha_share=2e-3))
    assert found.verdict == "lens_changed"
    for at in found.alpha:
        # the shares of law and of limit differ where the focal length bends
        assert at.change_px == pytest.approx(2e-3 * 4755.8, abs=4 * at.sigma_px)
        assert at.sigma_px < 2.0


def test_both_at_once_are_distinguished() -> None:
    found = _found(new_views(6, camera=KNOCK, alpha_share=2e-3))
    assert found.verdict == "moved_and_lens_changed"
    assert found.mount is not None
    assert found.alpha


@pytest.mark.parametrize("mount", MOUNTS)
@pytest.mark.parametrize("far", [1.0, 100.0], ids=["a little", "far"])
def test_a_board_that_was_moved_is_no_fault_of_the_camera(mount: Mount, far: float) -> None:
    shift = far * np.array([2e-3, -1e-3, 1e-3, 2e-3, 0.0, 1e-3])
    found = _found(new_views(7, mount=mount, board=shift), mount)
    assert found.verdict == "good"
    assert found.board is not None
    assert found.board.moved
    assert found.board.shift_m == pytest.approx(np.linalg.norm(shift[:3]), rel=0.15)
    assert any("no fault" in note for note in found.notes)


def test_a_moved_board_does_not_hide_a_knock() -> None:
    board = np.array([0.05, -0.03, 0.02, 0.0, 0.1, 0.3])
    assert _found(new_views(8, camera=KNOCK, board=board)).verdict == "moved"


def test_a_known_length_bears_the_camera_out_or_speaks_against_it() -> None:
    views = new_views(9)
    true = 9 * views.board.square_m
    right = _checked(views, known=KnownLength(true, 2e-5, LONG)).content
    assert right.verdict == "good"
    assert right.length is not None
    assert abs(right.length.error_m) < 3 * right.length.sigma_m
    assert right.length.sigma_m < 6e-5
    wrong = _checked(views, known=KnownLength(true * 0.999, 2e-5, LONG)).content
    assert wrong.verdict == "length_wrong"
    assert wrong.length is not None
    assert wrong.length.error_m == pytest.approx(1e-3 * true, abs=3 * right.length.sigma_m)
    assert "Error of length measurement" in wrong.sentence


def test_the_sigma_of_a_known_length_is_what_its_errors_scatter_by() -> None:
    pulls = []
    for seed in range(20, 28):
        views = new_views(seed)
        length = _checked(views, known=KnownLength(9 * views.board.square_m, 0.0, LONG)).content
        assert length.length is not None
        pulls.append(length.length.error_m / length.length.sigma_m)
    assert 0.5 < np.sqrt(np.mean(np.square(pulls))) < 1.6


def test_one_wrong_pose_is_left_out_and_named() -> None:
    views = new_views(10)
    flange = views.base_from_flange.copy()
    flange[4] = flange[4] @ from_vector(np.array([0.01, 0.0, 0.0, 0.0, 0.02, 0.0]))
    found = _found(replace(views, base_from_flange=flange))
    assert found.verdict == "good"
    assert [f.frame for f in found.frames_left_out] == [4]
    assert 4 not in found.frames_used


def test_parallel_views_alone_are_inconclusive() -> None:
    found = _found(new_views(11, parallel=6, tilted=0))
    assert found.verdict == "cannot_tell"
    assert found.noticeable is not None
    assert found.noticeable.workpiece_m > 1e-3
    assert "take more views" in found.sentence


def test_a_tolerance_finer_than_the_check_cannot_be_vouched_for() -> None:
    assert _checked(new_views(1), tolerance_m=1e-6).content.verdict == "cannot_tell"


def test_an_arm_that_scatters_more_than_it_did_is_not_called_good() -> None:
    found = _found(new_views(12, flange=8.0))
    assert found.verdict == "cannot_tell"
    assert any("scatter" in note for note in found.notes)


def test_too_few_frames_are_inconclusive_and_reported() -> None:
    found = _found(new_views(13).take(np.arange(3)))
    assert found.verdict == "cannot_tell"
    assert found.p_value is None
    assert "3 frames" in found.sentence


def test_another_camera_is_refused() -> None:
    with pytest.raises(InputError, match="not the same camera"):
        _checked(replace(new_views(1), width_px=640))
    with pytest.raises(InputError, match="eye_in_hand"):
        _checked(replace(new_views(1), mount="eye_to_hand"))


def test_a_calibration_without_a_robot_is_refused() -> None:
    with pytest.raises(InputError, match="no joint fit"):
        old_cell(calibration_text().model_copy(update={"robot": None}))


def test_corners_that_are_not_on_the_board_are_refused() -> None:
    with pytest.raises(InputError, match="rows 0 to 6"):
        _checked(new_views(1), known=KnownLength(0.2, 0.0, ((0, 0), (7, 0))))


def test_the_file_s_own_words_and_the_page_hold_all_of_it() -> None:
    checked = _checked(new_views(4, camera=KNOCK), known=KnownLength(0.225, 2e-5, LONG))
    output, page = text(checked.content), render(checked, simulated=True)
    for words in ("Moved", "hand-eye differs", "SIMULATED", "<svg", "Error of length measurement"):
        assert words in page
    assert output.startswith("verdict: moved")
    assert "one sigma px" in output
    assert "limit px" in output


def test_the_views_chosen_know_more_than_as_many_taken_evenly() -> None:
    log = new_views(1, parallel=10, tilted=12)
    chosen = choose_views(old(), log, 6)
    assert len(set(chosen.tolist())) == 6

    def left_open(which: np.ndarray) -> float:
        notice = _found(log.take(which)).noticeable
        assert notice is not None
        return notice.workpiece_m

    assert left_open(chosen) < left_open(np.linspace(0, len(log) - 1, 6).astype(int))


def test_a_file_of_another_program_without_covariance_is_refused() -> None:
    content = calibration_text().model_dump(by_alias=True)
    content["solutions"]["joint_ml"]["covariance"] = None
    with pytest.raises(InputError, match="covariance"):
        old_cell(CalibrationSource.model_validate(content))
