"""What goes wrong between a GigE Vision camera and its driver, and what the driver makes of it."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import closing

import numpy as np
import pytest

from drivers.aravis import AravisCamera
from drivers.camera import FocusSetting
from drivers.errors import DeviceError, DeviceRefused, DeviceUnreachable, FrameMissing
from drivers.genicam_camera import GenICamOptions
from sim.peers.callable_camera import CallableCamera
from sim.peers.gige import GigEPeer
from sim.peers.loopback import own_address
from tests.drivers.cameras.scene import HEIGHT, WIDTH, Scene, number_in

FULL_HD = (1920, 1200)


@pytest.fixture
def scene() -> Scene:
    return Scene()


@pytest.fixture
def peer(scene: Scene) -> Iterator[GigEPeer]:
    source = CallableCamera(scene.picture)
    with GigEPeer(source, WIDTH, HEIGHT, address=own_address()) as device:
        yield device


@pytest.fixture
def camera(peer: GigEPeer) -> Iterator[AravisCamera]:
    made = AravisCamera(peer.address, GenICamOptions(exposure_s=0.005, gain_db=0.0))
    made.connect()
    yield made
    made.close()


def frames_right(camera: AravisCamera, scene: Scene, count: int) -> list[bool]:
    right = []
    for _ in range(count):
        scene.number += 1
        right.append(number_in(camera.grab(5.0).image) == scene.number)
    return right


def test_lost_packets_are_sent_again_and_no_frame_is_lost(
    camera: AravisCamera, peer: GigEPeer, scene: Scene
) -> None:
    peer.faults.packet_loss = 0.02
    assert frames_right(camera, scene, 40) == [True] * 40
    assert peer.streamer.resent_packets > 0


def test_pixels_come_through_loss_bit_for_bit() -> None:
    width, height = FULL_HD
    picture = np.random.default_rng(1).integers(0, 256, (height, width), dtype=np.uint8)
    source = CallableCamera(lambda _: picture)
    with GigEPeer(source, width, height, address=own_address()) as device:
        device.faults.packet_loss = 0.01
        camera = AravisCamera(device.address, GenICamOptions(exposure_s=0.001))
        camera.connect()
        images = [camera.grab(5.0).image for _ in range(5)]
        camera.close()
    assert all(np.array_equal(image, picture) for image in images)


def test_forty_large_pictures_come_without_a_loss() -> None:
    """On one of three attempts: a machine that is busy elsewhere may drop a picture."""
    for _ in range(3):
        numbers, missed = _forty_large_pictures()
        if numbers == list(range(1, 41)) and not missed:
            return
    raise AssertionError((numbers, missed))


def _forty_large_pictures() -> tuple[list[int], int]:
    """The numbers drawn into forty pictures, and how many the driver reports as missed."""
    size, counter = 2048, iter(range(1, 100))
    picture = np.zeros((size, size), np.uint8)

    def counted(_: CallableCamera) -> np.ndarray:
        picture[::256] = next(counter)
        return picture

    with GigEPeer(CallableCamera(counted), size, size, address=own_address()) as device:
        camera = AravisCamera(device.address, GenICamOptions(exposure_s=0.001))
        camera.connect()
        frames = [camera.grab(5.0) for _ in range(40)]
        camera.close()
    numbers = [int(frame.image[256, 9]) for frame in frames]
    return numbers, sum(len(frame.raw["missed"]) for frame in frames)


def test_sixteen_bit_samples_keep_their_values() -> None:
    picture = np.arange(WIDTH * HEIGHT, dtype=np.uint16).reshape(HEIGHT, WIDTH)
    source = CallableCamera(lambda _: picture)
    with GigEPeer(source, WIDTH, HEIGHT, address=own_address()) as device:
        camera = AravisCamera(device.address, GenICamOptions(pixel_format="Mono16"))
        camera.connect()
        image = camera.grab(5.0).image
        camera.close()
    assert image.dtype == np.uint16
    assert np.array_equal(image, picture)


def test_an_incomplete_frame_is_taken_again_never_used() -> None:
    rng, shown = np.random.default_rng(3), []

    def picture(_: CallableCamera) -> np.ndarray:
        shown.append(rng.integers(0, 256, (HEIGHT, WIDTH), dtype=np.uint8))
        return shown[-1]

    retaken = 0
    with GigEPeer(CallableCamera(picture), WIDTH, HEIGHT, address=own_address()) as peer:
        camera = AravisCamera(peer.address, GenICamOptions(exposure_s=0.001))
        camera.connect()
        peer.faults.resend, peer.faults.packet_loss = False, 0.01
        for _ in range(6):
            frame = camera.grab(20.0)
            assert np.array_equal(frame.image, shown[-1])
            retaken += len(frame.raw["missed"])
        camera.close()
    assert retaken > 0


def test_a_swallowed_trigger_is_a_lost_frame_and_the_next_one_comes(
    camera: AravisCamera, peer: GigEPeer, scene: Scene
) -> None:
    peer.faults.skip_frames = 1
    with pytest.raises(FrameMissing, match="no frame came"):
        camera.grab(0.6)
    assert frames_right(camera, scene, 3) == [True] * 3


def test_with_enough_time_a_swallowed_trigger_is_given_again(peer: GigEPeer, scene: Scene) -> None:
    camera = AravisCamera(peer.address, GenICamOptions(exposure_s=0.005, patience_s=0.5))
    camera.connect()
    peer.faults.skip_frames = 1
    scene.number = 9
    frame = camera.grab(5.0)
    assert number_in(frame.image) == 9
    assert "no frame came" in frame.raw["missed"][0]
    camera.close()


def test_packets_too_long_for_the_network_are_named(peer: GigEPeer) -> None:
    peer.faults.largest_packet_bytes = 1500
    camera = AravisCamera(peer.address)
    camera.connect()
    with pytest.raises(FrameMissing, match="MTU"):
        camera.grab(0.6)
    camera.close()
    fitting = AravisCamera(peer.address, packet_bytes=1500)
    fitting.connect()
    assert fitting.grab(5.0).image.shape == (HEIGHT, WIDTH)
    fitting.close()


def test_packets_leave_no_faster_than_the_packet_delay_says(peer: GigEPeer) -> None:
    delay_s, packets = 2e-3, WIDTH * HEIGHT // 8000
    options = GenICamOptions(exposure_s=0.001, features={"GevSCPD": round(delay_s * 1e9)})
    camera = AravisCamera(peer.address, options, packet_bytes=8000)
    camera.connect()
    begun_s = time.monotonic()
    camera.grab(5.0)
    assert time.monotonic() - begun_s > packets * delay_s
    camera.close()


def test_an_exposure_longer_than_the_time_out_is_refused_before_the_trigger(
    camera: AravisCamera, peer: GigEPeer
) -> None:
    camera.configure(exposure_s=0.5)
    sent = peer.streamer.frames_sent
    with pytest.raises(DeviceRefused, match="does not fit"):
        camera.grab(0.5)
    assert peer.streamer.frames_sent == sent


def test_a_killed_camera_is_noticed_and_reopened_with_its_settings(
    camera: AravisCamera, peer: GigEPeer, scene: Scene
) -> None:
    camera.configure(exposure_s=0.008, gain_db=6.0)
    camera.focus(FocusSetting("position", 1234.0))
    camera.grab(5.0)
    peer.kill()
    killed_s = time.monotonic()
    with pytest.raises(DeviceUnreachable, match="connect again"):
        camera.grab(1.0)
    assert time.monotonic() - killed_s < 1.3  # the caller never waits longer than it stated
    while True:
        with pytest.raises(DeviceUnreachable) as lost:
            camera.grab(1.0)
        if "was lost" in str(lost.value):
            break
    assert time.monotonic() - killed_s < 6.0
    peer.start()
    camera.connect()
    frame = camera.grab(5.0)
    assert (frame.exposure_s, frame.gain_db, frame.focus_position) == (0.008, 6.0, 1234.0)
    assert frames_right(camera, scene, 3) == [True] * 3


def test_a_camera_switched_off_and_on_is_not_taken_for_a_foreign_one(
    camera: AravisCamera, peer: GigEPeer, scene: Scene
) -> None:
    camera.grab(5.0)
    peer.kill()
    peer.start()
    with pytest.raises(DeviceUnreachable, match="switched off and on"):
        camera.grab(5.0)
    camera.connect()
    assert frames_right(camera, scene, 2) == [True, True]


def test_a_camera_lost_while_idle_is_noticed(camera: AravisCamera, peer: GigEPeer) -> None:
    camera.grab(5.0)
    peer.kill()
    time.sleep(6.0)
    begun_s = time.monotonic()
    with pytest.raises(DeviceUnreachable):
        camera.grab(1.0)
    assert time.monotonic() - begun_s < 1.3
    peer.start()


def test_a_dead_camera_frees_the_caller_when_closed(peer: GigEPeer) -> None:
    camera = AravisCamera(peer.address, GenICamOptions(setting_timeout_s=0.8))
    camera.connect()
    peer.kill()
    with pytest.raises(DeviceUnreachable):
        camera.grab(0.4)
    begun_s = time.monotonic()
    camera.close()
    assert time.monotonic() - begun_s < camera.options.setting_timeout_s + 0.3
    peer.start()


def test_no_camera_at_the_address_is_reported(scene: Scene) -> None:
    camera = AravisCamera(own_address())
    with pytest.raises(DeviceUnreachable, match="check its power, cable and address"):
        camera.connect()
    camera.close()


def test_a_camera_held_by_another_program_is_refused_in_words(
    camera: AravisCamera, peer: GigEPeer, scene: Scene
) -> None:
    second = AravisCamera(peer.address, control_wait_s=0.3)
    with pytest.raises(DeviceRefused, match="another program controls the camera"):
        second.connect()
    second.close()
    assert frames_right(camera, scene, 2) == [True] * 2


def test_a_camera_that_a_crashed_program_held_is_waited_for(peer: GigEPeer) -> None:
    peer.control.claim(2, ("127.0.0.1", 9))
    camera = AravisCamera(peer.address)
    camera.connect()
    assert camera.grab(5.0).image.size
    camera.close()


def test_a_camera_left_acquiring_by_a_crashed_program_is_set_up_anew(
    camera: AravisCamera, peer: GigEPeer, scene: Scene
) -> None:
    assert peer.streamer.acquiring
    peer.control.release()
    with closing(AravisCamera(peer.address, GenICamOptions(exposure_s=0.004))) as second:
        second.connect()
        assert frames_right(second, scene, 2) == [True] * 2


def test_every_automatism_is_off_after_connecting(camera: AravisCamera, peer: GigEPeer) -> None:
    autos = ("ExposureAuto", "GainAuto", "FocusAuto")
    assert [peer.registers.get(name) for name in autos] == [0, 0, 0]
    peer.kill()
    peer.start()
    assert all(peer.registers.get(name) for name in autos)


def test_features_of_the_cell_file_are_set_and_bad_ones_refused(peer: GigEPeer) -> None:
    camera = AravisCamera(peer.address, GenICamOptions(features={"AcquisitionFrameRate": 12.5}))
    camera.connect()
    assert peer.registers.get("AcquisitionFrameRate") == 12.5
    camera.close()
    for features in ({"Nope": 1}, {"AcquisitionFrameRate": 1e6}, {"TriggerSource": "Line9"}):
        bad = AravisCamera(peer.address, GenICamOptions(features=features))
        with pytest.raises(DeviceRefused, match=next(iter(features))):
            bad.connect()
        bad.close()
    assert peer.control.holder is None


def test_an_unknown_pixel_format_is_refused_before_anything_is_opened() -> None:
    with pytest.raises(DeviceRefused, match="choose one of"):
        AravisCamera("127.0.0.1", GenICamOptions(pixel_format="Mono12Packed"))


def test_the_driver_says_that_it_was_never_tried_on_a_real_camera(
    peer: GigEPeer, caplog: pytest.LogCaptureFixture
) -> None:
    camera = AravisCamera(peer.address)
    for _ in range(2):
        camera.connect()
    camera.close()
    output = [r for r in caplog.records if "never on the real machine" in r.message]
    assert len(output) == 1


def test_without_pygobject_the_packages_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "gi", None)
    camera = AravisCamera("127.0.0.1")
    with pytest.raises(DeviceRefused, match=r"apt-get install python3-gi gir1\.2-aravis-0\.8"):
        camera.connect()
    camera.close()


def test_errors_are_device_errors(camera: AravisCamera, peer: GigEPeer) -> None:
    peer.faults.mute = True
    with pytest.raises(DeviceError):
        camera.configure(gain_db=3.0)
    peer.faults.mute = False
    camera.connect()
    assert camera.configure(gain_db=3.0)["gain_db"] == 3.0
