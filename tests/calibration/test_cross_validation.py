"""Cross-validation over frames is quiet where nothing is wrong, and names what is."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from calib.calibration import calibrate
from calib.calibration.cross_validation import FOLDS, CrossValidation, cross_validate, fold_of
from calib.calibration.mapping import as_mapping
from calib.calibration.quantities import quantities_of
from calib.calibration.verdict_messages import why
from calib.chain.rigid import from_vector
from calib.errors import CalibrationError
from calib.solver.joint import JointFit, fit_joint
from calib.solver.noise import Noise
from calib.solver.unknowns import amounts
from calib.views import FloatArray, Mount, Views
from cell.storage.files.calibration_file import CalibrationFile
from tests.calibration.fitted import fit, fitted, shuffled
from tests.paper.scene import mixed_scene

SPAN_M = (0.3, 1.5)
CLEAN = 12


@cache
def _clean(seed: int) -> CrossValidation:
    mounts: tuple[Mount, Mount] = ("eye_in_hand", "eye_to_hand")
    joint, views = fitted(seed, mounts[seed % 2])
    return cross_validate(joint, views, SPAN_M)


def _checked(views: Views) -> tuple[CrossValidation, JointFit]:
    joint = fit(views)
    return cross_validate(joint, views, SPAN_M), joint


def _pushed(views: Views, error: FloatArray) -> Views:
    """The views with the logged poses off by (N, 6)."""
    return replace(views, base_from_flange=views.base_from_flange @ from_vector(error))


def test_every_fold_has_all_distances_and_the_first_the_earliest() -> None:
    distance = np.repeat([0.3, 0.5, 0.8, 1.2], 10)[np.random.default_rng(1).permutation(40)]
    fold = fold_of(distance)
    for k in range(FOLDS):
        assert sorted(distance[fold == k]) == sorted(np.repeat([0.3, 0.5, 0.8, 1.2], 2))
    middle = [np.flatnonzero(fold == k).mean() for k in range(FOLDS)]
    assert np.all(np.diff(middle) > 0.0)
    assert np.array_equal(fold, fold_of(distance))


@pytest.mark.parametrize("frames", [10, 11, 13, 14])
def test_folds_are_as_equal_as_they_can_be(frames: int) -> None:
    size = np.bincount(fold_of(np.linspace(1.0, 0.3, frames)), minlength=FOLDS)
    assert size.min() >= frames // FOLDS
    assert size.max() <= frames // FOLDS + 1


def test_where_nothing_is_wrong_it_agrees() -> None:
    found = [_clean(seed) for seed in range(CLEAN)]
    assert sum(f.verdict != "agree" for f in found) <= 1
    assert all(f.factor == 1.0 for f in found if f.verdict == "agree")


def test_the_folds_move_by_what_is_stated_and_the_frames_held_out_miss_by_it() -> None:
    found = [_clean(seed) for seed in range(CLEAN)]
    factor = np.array([[m.factor for m in f.moves] for f in found])
    assert 0.85 < np.sqrt(np.mean(factor**2)) < 1.15
    chance = np.array([[[m.p_value, m.drift_p_value] for m in f.moves] for f in found])
    assert 0.35 < np.mean(chance < 0.5) < 0.65
    miss = sum(f.held_out.square_px2 for f in found) / sum(f.held_out.expected_px2 for f in found)
    assert 0.8 < miss < 1.2
    for f in found:
        assert f.held_out.picture.band[0] < f.held_out.picture.each < f.held_out.picture.band[1]
        assert f.held_out.robot.band[0] < f.held_out.robot.each < f.held_out.robot.band[1]


def test_noise_levels_that_are_too_small_are_called_so() -> None:
    joint, views = fitted(2)
    reported = joint.noise
    small = replace(
        joint, noise=Noise(reported.corner_px, reported.flange_m / 2, reported.flange_rad / 2)
    )
    found = cross_validate(small, views, SPAN_M)
    assert found.verdict == "sigma_too_small"
    assert 2.5 < found.held_out.robot.each < 4.5
    assert found.held_out.rms_px > found.held_out.expected_px * np.sqrt(found.held_out.miss.band[1])
    assert "In the robot's poses frames left out scatter" in why(found)


def test_a_camera_that_slowly_slips_is_a_drift() -> None:
    views = shuffled(4)
    slip = np.zeros((len(views), 6))
    slip[:, 0] = np.linspace(0.0, 2e-3, len(views))
    found, _ = _checked(_pushed(views, slip))
    assert found.verdict == "sigma_too_small"
    assert found.drifting
    assert "something drifts" in why(found)
    assert found.factor > 1.5


def test_one_frame_that_carries_the_estimate_is_named() -> None:
    views = shuffled(6)
    near = int(fit(views).dependence.state.distance_m.argmin())
    push = np.zeros((len(views), 6))
    push[near, 2] = 1e-3
    found, joint = _checked(_pushed(views, push))
    assert found.pulls[0].frame == views.frame[near]
    assert f"frame {views.frame[near]} " in why(found).lower()
    # what was worked out to first order is what a fit without it says
    left = np.arange(len(views)) != near
    again = fit_joint(
        joint.model, views.take(left), joint.unknowns, joint.noise,
        fixed_noise=True, rounds=1, weight=joint.weight[left],
    )  # fmt: skip
    pull = found.pulls[0]
    rows = quantities_of(joint, views, SPAN_M)[pull.quantity]
    zero, moved = (amounts(m, joint.unknowns, joint.model) for m in (joint.model, again.model))
    sigma = np.sqrt(np.einsum("qi,ij,qj->q", rows, joint.covariance, rows))
    assert pull.sigmas == pytest.approx(np.max(np.abs(rows @ (moved - zero)) / sigma), rel=0.1)


def test_corners_that_err_together_within_a_frame_are_no_independent_evidence() -> None:
    views = shuffled(8)
    rng = np.random.default_rng(8)
    u, v = np.moveaxis(views.corners_px / [views.width_px, views.height_px] - 0.5, 2, 0)
    bent = np.stack([u**2, v**2, u * v, u**3, v**3], axis=-1)
    corners = views.corners_px + bent @ rng.normal(0.0, 1.5, (len(views), 5, 2))
    found, _ = _checked(replace(views, corners_px=corners))
    assert found.verdict == "sigma_too_small"
    assert "principal_point_px" in {m.quantity for m in found.too_far}
    assert "take these sigmas so many times as large" in why(found)


def test_too_few_frames_are_refused_with_the_reason() -> None:
    joint, views = fitted(0)
    few = np.arange(9)
    with pytest.raises(CalibrationError, match=r"9 frames took part .* at least 10"):
        cross_validate(joint, views.take(few), SPAN_M)
    found = calibrate(mixed_scene(4, 5, noise_px=0.1, robot_mm=0.02).views)
    assert found.cross_validation is None
    assert "9 frames took part" in found.missing["cross_validation"]
    content = as_mapping(found, "bench")
    assert content["cross_validation"] is None
    CalibrationFile.model_validate(content)


def test_frames_that_alone_fix_a_number_cannot_be_left_out() -> None:
    joint, views = fitted(0)
    same = np.zeros((len(views), 6))
    flat = replace(views, base_from_flange=np.tile(views.base_from_flange[:1], (len(views), 1, 1)))
    with pytest.raises(CalibrationError, match="do not fix every number"):
        cross_validate(replace(joint, own_error=same), flat, SPAN_M)


def test_a_fit_that_does_not_come_to_rest_is_no_evidence(monkeypatch: pytest.MonkeyPatch) -> None:
    joint, views = fitted(0)

    def restless(*given: Any, **named: Any) -> JointFit:
        return replace(fit_joint(*given, **named), converged=False)

    monkeypatch.setattr("calib.calibration.cross_validation.fit_joint", restless)
    with pytest.raises(CalibrationError, match="does not come to rest"):
        cross_validate(joint, views, SPAN_M)


def test_the_file_holds_it_all() -> None:
    found = calibrate(mixed_scene(noise_px=0.1, robot_mm=0.03, robot_deg=0.003).views)
    content = CalibrationFile.model_validate(as_mapping(found, "bench"))
    reported, kept = content.cross_validation, found.cross_validation
    assert reported is not None
    assert kept is not None
    assert sorted(f for fold in reported.folds for f in fold) == list(content.frames_used)
    assert reported.verdict == kept.verdict
    low, high = reported.held_out.expected_band_px
    assert low < reported.held_out.expected_px < high
    assert {e.quantity for e in reported.estimates} >= {"alpha_px", "principal_point_px"}
