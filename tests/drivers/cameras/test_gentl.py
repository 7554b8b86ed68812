"""What is particular to GenTL producers and harvesters."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
import pytest
from genicam import gentl
from harvesters.core import Harvester

from drivers.errors import DeviceRefused
from drivers.genicam import GenTLCamera
from drivers.genicam_camera import GenICamOptions
from drivers.genicam_gentl import GenTLSession
from drivers.genicam_pixels import decode
from drivers.genicam_settings import FeatureNames
from tests.drivers.cameras.rigs import VIKY

STREAMING = GenICamOptions(software_trigger=False)


def refusal(camera: GenTLCamera) -> str:
    with pytest.raises(DeviceRefused) as refused:
        camera.connect()
    camera.close()
    return str(refused.value)


def test_a_missing_producer_is_named() -> None:
    assert "/nowhere/grabber.cti" in refusal(GenTLCamera("/nowhere/grabber.cti"))


def test_a_file_that_is_no_producer_is_refused_without_a_traceback(tmp_path: Path) -> None:
    fake = tmp_path / "fake.cti"
    fake.write_text("not a library")
    assert "GenTL producer" in refusal(GenTLCamera(str(fake)))


def test_without_harvesters_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "harvesters", None)
    assert "calibration-cell[genicam]" in refusal(GenTLCamera(VIKY))


def test_the_producer_is_found_on_the_search_path(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GENICAM_GENTL64_PATH", os.path.dirname(VIKY))
    camera = GenTLCamera(select={"serial_number": "0"}, options=STREAMING)
    camera.connect()
    assert camera.grab(5.0).image.size
    camera.close()


def test_no_producer_on_the_search_path_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("GENICAM_GENTL64_PATH", raising=False)
    assert "GENICAM_GENTL64_PATH has none" in refusal(GenTLCamera())


def test_several_cameras_and_no_choice_lists_them() -> None:
    output = refusal(GenTLCamera(VIKY))
    assert all(f"serial_number {number}" in output for number in range(3))


def test_a_camera_without_a_trigger_says_what_to_write() -> None:
    assert "software_trigger: false" in refusal(GenTLCamera(VIKY, {"serial_number": "1"}))


def test_a_second_program_is_refused() -> None:
    first = GenTLCamera(VIKY, {"serial_number": "1"}, STREAMING)
    first.connect()
    second = GenTLCamera(VIKY, {"serial_number": "1"}, STREAMING)
    assert "another program" in refusal(second) or "other program" in refusal(second)
    assert first.grab(5.0).image.size
    first.close()


def test_a_frame_is_a_copy_that_later_frames_leave_alone() -> None:
    camera = GenTLCamera(VIKY, {"serial_number": "2"}, STREAMING)
    camera.connect()
    frames = [camera.grab(5.0) for _ in range(6)]
    kept = [frame.image.copy() for frame in frames]
    camera.grab(5.0)
    assert all(np.array_equal(a.image, b) for a, b in zip(frames, kept, strict=True))
    assert len({image.tobytes() for image in kept}) > 1
    camera.close()


def test_colour_comes_as_bgr() -> None:
    options = GenICamOptions(software_trigger=False, pixel_format="RGBa8")
    camera = GenTLCamera(VIKY, {"serial_number": "0"}, options)  # the red one
    camera.connect()
    image = camera.grab(5.0).image
    camera.close()
    assert image.shape == (400, 400, 3)
    blue, green, red = (float(image[..., channel].mean()) for channel in range(3))
    assert red > blue == green


def test_a_vendors_own_name_for_a_setting_is_used() -> None:
    names = FeatureNames(gain=("BouncingBallSize",))
    options = GenICamOptions(software_trigger=False, names=names, gain_db=25.0)
    camera = GenTLCamera(VIKY, {"serial_number": "1"}, options)
    camera.connect()
    assert camera.grab(5.0).gain_db == 25.0
    assert camera.configure(gain_db=30.0)["gain_db"] == 30.0
    camera.close()


@pytest.mark.parametrize(
    ("pixel_format", "first_row"),
    [("BayerRG8", "RG"), ("BayerGR8", "GR"), ("BayerGB8", "GB"), ("BayerBG8", "BG")],
)
def test_bayer_patterns_give_the_colour_that_their_name_says(
    pixel_format: str, first_row: str
) -> None:
    second_row = {"RG": "GB", "GR": "BG", "GB": "RG", "BG": "GR"}[first_row]
    level = {"R": 200, "G": 100, "B": 20}
    cell = [[level[c] for c in row] for row in (first_row, second_row)]
    mosaic = np.tile(np.array(cell, np.uint8), (8, 8))
    image = decode(mosaic.tobytes(), 16, 16, pixel_format)
    assert image[8, 8].tolist() == [20, 100, 200]


def test_a_buffer_of_the_wrong_length_is_no_image() -> None:
    with pytest.raises(ValueError, match="reshape"):
        decode(bytes(99), 10, 10, "Mono8")


def test_a_container_is_refused_although_harvesters_shows_it_as_an_image() -> None:
    options = GenICamOptions(software_trigger=False, features={"GenDCStreamingMode": "On"})
    camera = GenTLCamera(VIKY, {"serial_number": "0"}, options)
    camera.connect()
    with pytest.raises(DeviceRefused, match="GenTL type 11, not plain images"):
        camera.grab(5.0)
    camera.close()


def test_what_harvesters_shows_of_a_container_begins_with_its_header() -> None:
    # the hazard itself, so that the test above means something
    harvester = Harvester()
    harvester.add_file(VIKY)
    harvester.update()
    acquirer = harvester.create({"serial_number": "0"})
    acquirer.remote_device.node_map.GenDCStreamingMode.value = "On"
    acquirer.start()
    buffer = acquirer.fetch(timeout=5.0)
    [component] = buffer.payload.components
    assert component.data_format == "RGBa8"
    assert component.data[:4].tobytes() == b"GNDC"
    buffer.queue()
    acquirer.stop()
    acquirer.destroy()
    harvester.reset()


@pytest.mark.parametrize("kind", ["CHUNK_DATA", "MULTI_PART", "GENDC", "JPEG", "UNKNOWN"])
def test_every_payload_but_a_plain_image_is_refused(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    number = getattr(gentl.PAYLOADTYPE_INFO_IDS, f"PAYLOAD_TYPE_{kind}")
    true_optional = GenTLSession._optional

    def optional(self: GenTLSession, owner: object, field: str) -> int | None:
        return int(number) if field == "payload_type" else true_optional(self, owner, field)

    monkeypatch.setattr(GenTLSession, "_optional", optional)
    camera = GenTLCamera(VIKY, {"serial_number": "0"}, STREAMING)
    camera.connect()
    with pytest.raises(DeviceRefused, match="not plain images"):
        camera.grab(5.0)
    camera.close()
