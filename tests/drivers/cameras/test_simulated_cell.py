"""The simulated camera seen through the real drivers, wire and all, and seen directly."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import cv2
import numpy as np
import pytest

from drivers.aravis import AravisCamera
from drivers.camera import Camera, FocusSetting
from drivers.robotiq import RobotiqCamera
from sim.camera import SimCamera
from sim.clock import WallClock
from sim.peers.gige import GigEPeer
from sim.peers.loopback import own_address
from sim.peers.robotiq import RobotiqPeer
from tests.drivers.cameras.rigs import StandingArm, half_size_cell, turned

CELL = half_size_cell()


@contextmanager
def through_gige(source: SimCamera) -> Iterator[Camera]:
    spec = CELL.camera
    with GigEPeer(
        source,
        spec.width_px,
        spec.height_px,
        address=own_address(),
        focus_steps=spec.focus_steps,
    ) as peer:
        yield AravisCamera(peer.address)


@contextmanager
def through_http(source: SimCamera) -> Iterator[Camera]:
    with RobotiqPeer(source) as peer:
        yield RobotiqCamera(peer.address)


@pytest.mark.parametrize("wire", [through_gige, through_http], ids=["gige", "http"])
def test_what_comes_over_the_wire_is_what_the_simulation_shows(
    wire: type,
) -> None:
    arm = StandingArm(CELL.home_rad)
    direct, behind = (SimCamera(CELL, arm, WallClock()) for _ in range(2))
    direct.connect()
    with wire(behind) as camera:
        camera.connect()
        for turn_rad in (0.0, 0.3):
            arm.joints_rad = CELL.home_rad + turned(turn_rad)
            for each in (direct, camera):
                each.focus(FocusSetting("auto"))
            ours, theirs = direct.grab(10.0), camera.grab(10.0)
            assert theirs.image.shape == ours.image.shape
            assert theirs.focus_position == ours.focus_position
            assert theirs.exposure_s == pytest.approx(ours.exposure_s, rel=1e-3)
            difference = theirs.image.astype(float) - ours.image.astype(float)
            # noise, and JPEG's where it is used, average out over blocks; a shift does not
            blocks = cv2.resize(difference, None, fx=1 / 8, fy=1 / 8, interpolation=cv2.INTER_AREA)
            assert np.abs(blocks).max() < 2.5
        camera.close()
