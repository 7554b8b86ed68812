"""Frames that were left out: chance, or a finding."""

from __future__ import annotations

import numpy as np
import pytest

from calib.calibration.result import Rejection
from calib.discovery.rejections import lost_frames

FRAMES = np.arange(100, 132)


def rejected(frames: list[int], reason: str = "its corners miss the board by 9 px"):
    return [Rejection(frame, reason) for frame in frames]


@pytest.mark.parametrize("frames", [[], [104], [104, 120], [104, 105]])
def test_a_few_are_chance(frames):
    assert lost_frames(rejected(frames), FRAMES) is None


@pytest.mark.parametrize(
    "frames", [[117, 118, 119], [101, 104, 109, 114, 120, 126], list(range(116, 132))]
)
def test_a_run_or_many_are_a_finding_reported_with_where_they_stand(frames):
    found = lost_frames(rejected(frames), FRAMES)
    assert found is not None
    assert f"{len(frames)} frames between {frames[0]} and {frames[-1]}" in found.where
    assert found.p_value < 1e-3


def test_frames_without_a_board_or_a_pose_are_no_contradiction():
    for reason in ("no corners", "only 5 corners seen", "no flange pose of its own"):
        assert lost_frames(rejected(list(range(100, 116)), reason), FRAMES) is None
