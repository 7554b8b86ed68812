"""The same questions to every camera, and the same answers from each."""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterator

import numpy as np
import pytest

from drivers.camera import FocusSetting
from drivers.errors import DeviceRefused, DeviceUnreachable, FrameMissing
from tests.drivers.cameras.rigs import RIGS, Rig

TIMEOUT_S = 5.0
SLACK_S = 0.3  # what a loaded machine adds to a wait


@pytest.fixture(params=RIGS)
def rig(request: pytest.FixtureRequest) -> Iterator[Rig]:
    with RIGS[request.param]() as made:
        made.camera.connect()
        yield made


def test_a_frame_is_a_whole_picture_with_its_time(rig: Rig) -> None:
    before_s = time.monotonic()
    frame = rig.camera.grab(TIMEOUT_S)
    assert frame.image.shape[:2] == (rig.size[1], rig.size[0])
    assert frame.image.dtype == np.uint8
    assert before_s <= frame.host_t_s <= time.monotonic()


def test_each_frame_is_newer_than_the_one_before(rig: Rig) -> None:
    frames = [rig.camera.grab(TIMEOUT_S) for _ in range(5)]
    assert all(rig.newer(a, b) for a, b in itertools.pairwise(frames))


def test_a_frame_shows_the_scene_after_the_call(rig: Rig) -> None:
    if rig.change_scene is None or rig.shows_scene is None:
        # the peer draws what it likes: its frame count must show that what waited was dropped
        first = rig.camera.grab(TIMEOUT_S)
        time.sleep(0.5)
        second = rig.camera.grab(TIMEOUT_S)
        assert second.raw["frame_id"] - first.raw["frame_id"] > 1
        return
    for _ in range(5):
        rig.change_scene()
        assert rig.shows_scene(rig.camera.grab(TIMEOUT_S))


@pytest.mark.parametrize(("name", "values"), [("exposure", (0.004, 0.02)), ("gain", (6.0, 0.0))])
def test_what_is_set_is_read_back_and_stands_in_the_frame(
    rig: Rig, name: str, values: tuple[float, float]
) -> None:
    key = {"exposure": "exposure_s", "gain": "gain_db"}[name]
    if name not in rig.can:
        with pytest.raises(
            DeviceRefused, match=r"no exposure|no gain|does not report its settings"
        ):
            rig.camera.configure(**{key: values[0]})
        assert getattr(rig.camera.grab(TIMEOUT_S), key) is None
        return
    for value in values:
        got = rig.camera.configure(**{key: value})
        assert got[key] == pytest.approx(value, rel=0.01, abs=0.05)
        assert getattr(rig.camera.grab(TIMEOUT_S), key) == got[key]


def test_a_bad_exposure_is_refused_and_changes_nothing(rig: Rig) -> None:
    before = rig.camera.grab(TIMEOUT_S).exposure_s
    with pytest.raises(DeviceRefused):
        rig.camera.configure(exposure_s=1e4)
    assert rig.camera.grab(TIMEOUT_S).exposure_s == before


def test_focus_goes_where_it_is_ordered_and_is_in_every_frame(rig: Rig) -> None:
    if "focus" not in rig.can:
        assert rig.camera.focus(FocusSetting("hold")) is None
        with pytest.raises(DeviceRefused):
            rig.camera.focus(FocusSetting("position", rig.focus_range[0]))
        assert rig.camera.grab(TIMEOUT_S).focus_position is None
        return
    for position in rig.focus_range:
        assert rig.camera.focus(FocusSetting("position", position)) == position
        assert rig.camera.focus(FocusSetting("hold")) == position
        assert rig.camera.grab(TIMEOUT_S).focus_position == position


def test_focus_out_of_range_or_unknown_is_refused(rig: Rig) -> None:
    for setting in (
        FocusSetting("position", 1e6),
        FocusSetting("position"),
        FocusSetting("sideways"),
    ):
        with pytest.raises(DeviceRefused):
            rig.camera.focus(setting)


def test_automatic_focus_ends_at_a_position_that_stays(rig: Rig) -> None:
    if "autofocus" not in rig.can:
        with pytest.raises(DeviceRefused):
            rig.camera.focus(FocusSetting("auto"))
        return
    rig.camera.focus(FocusSetting("position", rig.focus_range[0]))
    found = rig.camera.focus(FocusSetting("auto"))
    assert found is not None
    assert found != rig.focus_range[0]
    assert [rig.camera.grab(TIMEOUT_S).focus_position for _ in range(2)] == [found, found]


def test_a_late_frame_is_lost_in_time_and_never_taken_for_the_next(rig: Rig) -> None:
    too_short_s = 0.4 if rig.delay else 0.02
    if rig.delay:
        rig.delay(1.0)
    begun_s = time.monotonic()
    with pytest.raises((FrameMissing, DeviceUnreachable)):
        rig.camera.grab(too_short_s)
    assert time.monotonic() - begun_s < too_short_s + SLACK_S
    if rig.delay:
        rig.delay(0.0)
    if rig.change_scene:
        rig.change_scene()
    try:
        frame = rig.camera.grab(TIMEOUT_S)
    except DeviceUnreachable:
        rig.camera.connect()
        frame = rig.camera.grab(TIMEOUT_S)
    assert rig.shows_scene is None or rig.shows_scene(frame)


def test_closing_twice_is_closing_and_a_closed_camera_can_be_opened_again(rig: Rig) -> None:
    rig.camera.close()
    rig.camera.close()
    with pytest.raises(DeviceUnreachable):
        rig.camera.grab(TIMEOUT_S)
    rig.camera.connect()
    rig.camera.connect()
    assert rig.camera.grab(TIMEOUT_S).image.size
