"""One rig per camera driver: the driver, its peer, and what this pair can and cannot do."""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path

import genicam

from drivers.aravis import AravisCamera
from drivers.camera import Camera, Frame
from drivers.focus import FocusNames
from drivers.genicam import GenTLCamera
from drivers.genicam_camera import GenICamOptions
from drivers.robotiq import RobotiqCamera
from sim.peers.callable_camera import CallableCamera
from sim.peers.gige import GigEPeer
from sim.peers.robotiq import RobotiqPeer
from tests.drivers.cameras.scene import HEIGHT, WIDTH, Scene, number_in

VIKY = str(Path(genicam.__file__).parent / "viky.cti")
_hosts = itertools.count(1)


def loopback_address() -> str:
    """An address of this process's own, so that tests may run side by side."""
    pid = os.getpid()
    return f"127.{1 + (pid >> 8) % 250}.{pid % 256}.{next(_hosts)}"


@dataclass
class Rig:
    """A camera under test.

    Attributes
    ----------
    can:
        Of exposure, gain, focus, autofocus: what this driver and peer have. What is not named here
        the camera must refuse in words.
    size:
        (width, height) of its pictures.
    change_scene:
        Changes what the camera looks at; None where the peer's pictures cannot be chosen.
    newer:
        Whether the second frame was exposed after the first, judged from the frames.
    delay:
        Makes frames come so many seconds late; None where the peer cannot.
    focus_range:
        Two focus positions to go to.
    """

    camera: Camera
    can: frozenset[str]
    size: tuple[int, int]
    newer: Callable[[Frame, Frame], bool]
    change_scene: Callable[[], int] | None = None
    delay: Callable[[float], None] | None = None
    focus_range: tuple[float, float] = (3000.0, 4000.0)


def _scene_rig(camera: Camera, can: str, scene: Scene, delay: Callable[[float], None]) -> Rig:
    def change() -> int:
        scene.number += 1
        return scene.number

    def newer(before: Frame, after: Frame) -> bool:
        return after.host_t_s > before.host_t_s

    return Rig(camera, frozenset(can.split()), (WIDTH, HEIGHT), newer, change, delay)


@contextmanager
def aravis() -> Iterator[Rig]:
    scene, address = Scene(), loopback_address()
    with GigEPeer(CallableCamera(scene.picture), WIDTH, HEIGHT, address=address) as peer:
        camera = AravisCamera(address, GenICamOptions(exposure_s=0.005, gain_db=0.0))

        def delay(seconds: float) -> None:
            peer.faults.frame_latency_s = seconds

        yield _scene_rig(camera, "exposure gain focus autofocus", scene, delay)
        camera.close()


@contextmanager
def gentl() -> Iterator[Rig]:
    # the producer's device has no exposure, gain or trigger; its ball stands in for a lens, under
    # a name of its own
    options = GenICamOptions(
        software_trigger=False, focus_names=FocusNames(position="BouncingBallSize")
    )
    camera = GenTLCamera(VIKY, {"serial_number": "1"}, options)

    def newer(before: Frame, after: Frame) -> bool:
        return bool(after.raw["frame_id"] > before.raw["frame_id"])

    yield Rig(camera, frozenset({"focus"}), (400, 400), newer, focus_range=(20.0, 30.0))
    camera.close()


def _robotiq(*, has_settings: bool, can: str) -> Iterator[Rig]:
    scene = Scene()
    source = CallableCamera(scene.picture, best_focus=512.0)
    with RobotiqPeer(source, has_settings=has_settings) as peer:
        camera = RobotiqCamera(peer.address)

        def delay(seconds: float) -> None:
            peer.faults.answer_delay_s = seconds

        rig = _scene_rig(camera, can, scene, delay)
        rig.focus_range = (350.0, 700.0)
        yield rig
        camera.close()


@contextmanager
def robotiq() -> Iterator[Rig]:
    yield from _robotiq(has_settings=True, can="exposure gain focus autofocus")


@contextmanager
def robotiq_without_settings() -> Iterator[Rig]:
    yield from _robotiq(has_settings=False, can="")


RIGS: dict[str, Callable[[], AbstractContextManager[Rig]]] = {
    "aravis": aravis,
    "gentl": gentl,
    "robotiq": robotiq,
    "robotiq-without-settings": robotiq_without_settings,
}

__all__ = ["RIGS", "VIKY", "Rig", "loopback_address", "number_in"]
