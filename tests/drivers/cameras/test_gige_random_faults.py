"""Ten faults at random instants of a run of frames: none wrong, nobody held up, all mended."""

from __future__ import annotations

import random
import threading
import time
from collections.abc import Callable

import pytest

from drivers.aravis import AravisCamera
from drivers.errors import DeviceUnreachable, FrameMissing
from drivers.genicam_camera import GenICamOptions
from sim.peers.callable_camera import CallableCamera
from sim.peers.gige import GigEPeer
from sim.peers.loopback import own_address
from tests.drivers.cameras.scene import HEIGHT, WIDTH, Scene, number_in

FAULTS = 10
TIMEOUT_S = 0.8
SLACK_S = 0.5  # what a loaded machine adds to a wait


def faults_of(peer: GigEPeer, chance: random.Random) -> list[Callable[[], None]]:
    def switch_off_and_on() -> None:
        peer.kill()
        time.sleep(chance.uniform(0.0, 1.0))
        peer.start()

    def fall_silent() -> None:
        peer.faults.mute = True
        time.sleep(chance.uniform(0.1, 1.0))
        peer.faults.mute = False

    def lose_packets() -> None:
        peer.faults.packet_loss = 0.05
        time.sleep(0.5)
        peer.faults.packet_loss = 0.0

    def be_late() -> None:
        peer.faults.frame_latency_s = chance.uniform(0.5, 1.0)
        time.sleep(0.5)
        peer.faults.frame_latency_s = 0.0

    def swallow_a_trigger() -> None:
        peer.faults.skip_frames = 1

    return [switch_off_and_on, fall_silent, lose_packets, be_late, swallow_a_trigger]


@pytest.mark.slow
def test_faults_at_random_instants_cost_time_and_never_a_wrong_frame() -> None:
    chance, scene = random.Random(7), Scene()
    source = CallableCamera(scene.picture)
    over = threading.Event()
    with GigEPeer(source, WIDTH, HEIGHT, address=own_address()) as peer:
        kinds = faults_of(peer, chance)

        def inject() -> None:
            for index in range(FAULTS):
                time.sleep(chance.uniform(0.1, 0.6))
                kinds[index % len(kinds)]()
            over.set()

        camera = AravisCamera(peer.address, GenICamOptions(exposure_s=0.003))
        camera.connect()
        threading.Thread(target=inject, daemon=True).start()
        right = wrong = faults_seen = 0
        longest_s = 0.0
        while not over.is_set() or right == 0:
            scene.number += 1
            begun_s = time.monotonic()
            try:
                shown = number_in(camera.grab(TIMEOUT_S).image)
                right, wrong = right + (shown == scene.number), wrong + (shown != scene.number)
                lost = False
            except (FrameMissing, DeviceUnreachable) as error:
                faults_seen, lost = faults_seen + 1, isinstance(error, DeviceUnreachable)
            longest_s = max(longest_s, time.monotonic() - begun_s)
            if lost:
                mend(camera)
        peer.faults.skip_frames = 0  # the last fault may still wait for its trigger
        mend(camera)
        scene.number += 1
        assert number_in(camera.grab(5.0).image) == scene.number
        camera.close()
    assert wrong == 0
    assert right > 50
    assert faults_seen > 0
    assert longest_s < TIMEOUT_S + SLACK_S


def mend(camera: AravisCamera) -> None:
    for _ in range(5):
        try:
            camera.connect()
        except DeviceUnreachable:
            continue
        return
    pytest.fail("the camera could not be opened again")
