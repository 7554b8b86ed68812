"""Aravis' own camera behind our driver, and Aravis' own clients on our camera.

Neither knows of the other's code: what both sides of ours had misread alike would show here. They
come with Debian's `aravis-tools` and `aravis-tools-cli`.
"""

from __future__ import annotations

import re
import shutil
import socket
import subprocess
import threading
import time
from collections.abc import Iterator

import pytest

from drivers.aravis import AravisCamera
from drivers.aravis_session import import_aravis
from drivers.errors import DeviceRefused
from drivers.genicam_camera import GenICamOptions
from sim.peers.callable_camera import CallableCamera
from sim.peers.gige import GigEPeer
from sim.peers.loopback import own_address
from tests.drivers.cameras.scene import HEIGHT, WIDTH, Scene, number_in

FAKE, TOOL, CLIENT = "arv-fake-gv-camera-0.8", "arv-tool-0.8", "arv-camera-test-0.8"
HOME = "127.0.0.1"  # the only loopback address that an interface has
pytestmark = pytest.mark.skipif(
    shutil.which(FAKE) is None, reason="tools/install-debian-packages.sh test brings aravis-tools"
)


@pytest.fixture
def fake() -> Iterator[str]:
    """Aravis' simulated camera, 2048 x 2048, a moving ramp."""
    process = None
    for _ in range(40):  # another test process may have it at the moment
        process = subprocess.Popen([FAKE, "-i", HOME], stderr=subprocess.DEVNULL)
        time.sleep(0.5)
        if process.poll() is None and answers():
            break
        process.kill()
        process.wait()
    assert process is not None
    assert process.poll() is None, "somebody else has port 3956 of 127.0.0.1"
    yield HOME
    process.kill()
    process.wait()


def answers() -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.settimeout(1.0)
        link.sendto(bytes.fromhex("4201000200000001"), (HOME, 3956))
        try:
            return len(link.recv(1024)) > 8
        except OSError:
            return False


def test_our_driver_grabs_from_aravis_own_camera(fake: str) -> None:
    camera = AravisCamera(fake, GenICamOptions(exposure_s=0.005))
    try:
        camera.connect()
        assert {"exposure", "software_trigger"} <= camera.capabilities
        frames = [camera.grab(5.0) for _ in range(4)]
        assert all(frame.image.shape == (2048, 2048) for frame in frames)
        assert all(frame.exposure_s == 0.005 for frame in frames)
        # the ramp moves with every frame, so that none was taken twice
        assert len({frame.image.tobytes()[:4096] for frame in frames}) == 4
        assert camera.configure(exposure_s=0.01)["exposure_s"] == 0.01
    finally:
        camera.close()


def test_a_value_out_of_range_is_refused_although_aravis_lets_it_pass(fake: str) -> None:
    aravis, _ = import_aravis()
    device = aravis.Camera.new(fake).get_device()
    device.set_float_feature_value("ExposureTimeAbs", 1e9)  # no error: bounds are not enforced
    del device
    camera = AravisCamera(fake, GenICamOptions(exposure_s=0.005))
    try:
        camera.connect()
        with pytest.raises(DeviceRefused, match=r"range|greater|maximum"):
            camera.configure(exposure_s=1000.0)
    finally:
        camera.close()


# ---- Aravis' clients on our camera -----------------------------------------------------------


@pytest.fixture
def scene() -> Scene:
    return Scene()


@pytest.fixture
def peer(scene: Scene) -> Iterator[GigEPeer]:
    source = CallableCamera(scene.picture)
    with GigEPeer(source, WIDTH, HEIGHT, address=own_address()) as made:
        yield made


def output(*command: str) -> str:
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_arv_tool_reads_names_and_features_and_writes_some(peer: GigEPeer) -> None:
    listed = output(TOOL, "-a", peer.address, "features")
    for name in ("DeviceVendorName", "ExposureTime", "TriggerSoftware", "FocusStepper"):
        assert f"'{name}'" in listed
    names = ("DeviceVendorName", "DeviceModelName", "DeviceSerialNumber", "DeviceVersion")
    reported = output(
        TOOL, "-a", peer.address, "control", *names, "ExposureTime=2500", "ExposureTime"
    )
    assert "DeviceVendorName = CalibrationCell" in reported
    assert "DeviceModelName = SimulatedCamera" in reported
    assert "DeviceSerialNumber = SIM-0001" in reported
    assert "ExposureTime = 2500" in reported
    assert peer.registers.get("ExposureTime") == 2500.0


@pytest.mark.parametrize("trigger", [(), ("-o", "5")], ids=["free running", "triggered"])
def test_arv_camera_test_streams_without_a_loss(peer: GigEPeer, trigger: tuple[str, ...]) -> None:
    """On one of three attempts: a machine that is busy elsewhere may drop a picture."""
    words = (CLIENT, "-n", peer.address, "--duration=3", "-e", "5000", "-g", "3", *trigger)
    bad = ("n_failures", "n_missing_frames", "n_size_mismatch_errors", "n_error_packets")
    for _ in range(3):
        reported = output(*words)
        assert "vendor name            = CalibrationCell" in reported
        counts = {name: int(count) for name, count in re.findall(r"(n_\w+) += (\d+)", reported)}
        if counts["n_completed_buffers"] >= 5 and not any(counts[name] for name in bad):
            return
    raise AssertionError(reported)


# ---- what Aravis 0.8.26 does that one would not guess -----------------------------------------


def test_setting_a_frame_rate_leaves_our_trigger_on(peer: GigEPeer, scene: Scene) -> None:
    aravis, _ = import_aravis()
    plain = aravis.Camera.new(peer.address)
    plain.set_trigger("Software")
    plain.set_frame_rate(5.0)
    assert plain.get_device().get_string_feature_value("TriggerMode") == "Off"  # unasked
    plain.get_device().leave_control()
    del plain
    options = GenICamOptions(exposure_s=0.005, features={"AcquisitionFrameRate": 5.0})
    camera = AravisCamera(peer.address, options)
    try:
        camera.connect()
        assert peer.registers.get("TriggerMode") == 1
        for number in (3, 4):
            scene.number = number
            assert number_in(camera.grab(5.0).image) == number
    finally:
        camera.close()


def test_a_frame_that_is_lost_whole_is_not_replaced_by_the_next(
    peer: GigEPeer, scene: Scene
) -> None:
    camera = AravisCamera(peer.address, GenICamOptions(exposure_s=0.005))
    try:
        camera.connect()
        for number in (10, 11, 12):
            scene.number = number
            peer.faults.packet_loss, peer.faults.resend = 1.0, False
            with pytest.raises(Exception, match=r"frame|picture|came"):
                camera.grab(0.8)
            peer.faults.packet_loss, peer.faults.resend = 0.0, True
            scene.number = number + 50
            frame = camera.grab(5.0)
            # its id says nothing of the one that is missing; the picture is of this trigger
            assert frame.raw["frame_id"] == 1
            assert number_in(frame.image) == number + 50
    finally:
        camera.close()


def test_losses_are_reported_although_a_stream_counts_only_packets(
    peer: GigEPeer, scene: Scene
) -> None:
    aravis, _ = import_aravis()
    plain = aravis.Camera.new(peer.address)
    statistics = plain.create_stream(None, None).get_statistics()
    plain.get_device().leave_control()
    del plain
    assert len(statistics) == 2  # of packets; the three of the documentation count buffers
    camera = AravisCamera(peer.address, GenICamOptions(exposure_s=0.005))
    try:
        camera.connect()
        peer.faults.packet_loss, peer.faults.resend = 0.5, False
        mended = threading.Timer(1.0, setattr, (peer.faults, "packet_loss", 0.0))
        mended.start()
        frame = camera.grab(8.0)
        assert frame.raw["missed"]
        assert number_in(frame.image) == scene.number
    finally:
        camera.close()
