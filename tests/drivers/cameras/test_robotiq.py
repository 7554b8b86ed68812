"""What is particular to the Robotiq wrist camera: freshness, size, and what may not be claimed."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator

import pytest

from drivers.camera import FocusSetting
from drivers.errors import DeviceRefused, DeviceUnreachable, FrameMissing
from drivers.robotiq import RobotiqCamera
from sim.peers.callable_camera import CallableCamera
from sim.peers.robotiq import RobotiqPeer
from tests.drivers.cameras.scene import HEIGHT, WIDTH, Scene, number_in


@pytest.fixture
def scene() -> Scene:
    return Scene()


@pytest.fixture
def peer(scene: Scene) -> Iterator[RobotiqPeer]:
    with RobotiqPeer(CallableCamera(scene.picture, best_focus=512.0)) as server:
        yield server


@pytest.fixture
def camera(peer: RobotiqPeer) -> Iterator[RobotiqCamera]:
    made = RobotiqCamera(peer.address)
    made.connect()
    yield made
    made.close()


def test_autos_are_off_after_connecting(camera: RobotiqCamera, peer: RobotiqPeer) -> None:
    assert peer.settings.values["exposureAuto"] is False
    assert peer.settings.values["whiteBalanceAuto"] is False


def test_a_size_that_changes_during_a_run_is_refused(
    camera: RobotiqCamera, peer: RobotiqPeer
) -> None:
    camera.grab(5.0)
    peer.display_size = (320, 256)
    with pytest.raises(DeviceRefused, match="size changed"):
        camera.grab(5.0)


def test_a_size_that_is_asked_for_is_waited_for(peer: RobotiqPeer) -> None:
    camera = RobotiqCamera(peer.address, display_size=(320, 256))
    camera.connect()
    assert camera.grab(5.0).image.shape[:2] == (256, 320)
    camera.close()


def test_a_picture_that_repeats_is_never_taken_for_a_new_one(
    camera: RobotiqCamera, peer: RobotiqPeer
) -> None:
    camera.grab(5.0)
    peer.faults.frozen = True
    with pytest.raises(FrameMissing, match="repeats"):
        camera.grab(0.5)


def test_a_picture_cut_short_is_taken_again(
    camera: RobotiqCamera, peer: RobotiqPeer, scene: Scene
) -> None:
    peer.faults.cut_short = 3
    scene.number = 77
    assert number_in(camera.grab(5.0).image) == 77


def test_only_cut_pictures_are_a_lost_frame(camera: RobotiqCamera, peer: RobotiqPeer) -> None:
    peer.faults.cut_short = 10**6
    with pytest.raises(FrameMissing, match="no whole JPEG"):
        camera.grab(0.5)


def test_a_server_that_does_not_answer_holds_nobody_up(
    camera: RobotiqCamera, peer: RobotiqPeer
) -> None:
    peer.faults.mute = True
    begun_s = time.monotonic()
    with pytest.raises(DeviceUnreachable):
        camera.grab(0.5)
    assert time.monotonic() - begun_s < 0.8
    peer.faults.mute = False
    camera.connect()
    assert camera.grab(5.0).image.shape[:2] == (HEIGHT, WIDTH)


def test_nobody_at_the_address_is_reported_with_what_to_check() -> None:
    camera = RobotiqCamera("127.0.0.1:9")
    with pytest.raises(DeviceUnreachable, match="URCap"):
        camera.connect()
    camera.close()


def test_a_focus_that_rests_where_it_stood_for_another_view_is_looked_for_anew(
    scene: Scene,
) -> None:
    source = CallableCamera(scene.picture, best_focus=512.0)
    with RobotiqPeer(source, autofocus_period_s=60.0) as peer:
        camera = RobotiqCamera(peer.address)
        camera.connect()
        source._best_focus = 700.0
        assert camera.focus(FocusSetting("auto")) == 700.0
        camera.close()


def test_a_lock_that_is_not_taken_is_refused(camera: RobotiqCamera, peer: RobotiqPeer) -> None:
    peer.faults.ignore_focus_lock = True
    for setting in (FocusSetting("hold"), FocusSetting("position", 400.0)):
        with pytest.raises(DeviceRefused, match="focusAuto"):
            camera.focus(setting)


def test_a_lock_that_is_lost_later_stops_the_run(camera: RobotiqCamera, peer: RobotiqPeer) -> None:
    assert camera.focus(FocusSetting("position", 400.0)) == 400.0
    assert camera.grab(5.0).raw["focus_locked"] is True
    peer.change({"focusAuto": True})
    with pytest.raises(DeviceRefused, match="focus was locked at 400"):
        camera.grab(5.0)


def test_a_firmware_without_settings_claims_no_lock(
    scene: Scene, caplog: pytest.LogCaptureFixture
) -> None:
    with RobotiqPeer(CallableCamera(scene.picture), has_settings=False) as peer:
        camera = RobotiqCamera(peer.address)
        camera.connect()
        with caplog.at_level(logging.WARNING):
            assert camera.focus(FocusSetting("hold")) is None
        frame = camera.grab(5.0)
        camera.close()
    assert "not locked" in caplog.text
    assert frame.raw["focus_locked"] is False
    assert (frame.exposure_s, frame.gain_db, frame.focus_position) == (None, None, None)


def test_an_exposure_asked_for_without_settings_is_refused_when_connecting(scene: Scene) -> None:
    with RobotiqPeer(CallableCamera(scene.picture), has_settings=False) as peer:
        camera = RobotiqCamera(peer.address, exposure_s=0.01)
        with pytest.raises(DeviceRefused, match="teach pendant"):
            camera.connect()
        camera.close()


def test_a_gain_between_two_steps_is_reported_as_it_is(
    camera: RobotiqCamera,
) -> None:
    got = camera.configure(gain_db=10.0)
    assert got["gain_db"] == pytest.approx(9.542, abs=1e-3)  # the factor three
