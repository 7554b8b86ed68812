"""One rig per camera driver: the driver, its peer, and what this pair can and cannot do."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import genicam
import numpy as np

from calib.chain.optics import optics_row
from calib.views import FloatArray
from drivers.aravis import AravisCamera
from drivers.camera import Camera, Frame
from drivers.focus import FocusNames
from drivers.genicam import GenTLCamera
from drivers.genicam_camera import GenICamOptions
from drivers.robotiq import RobotiqCamera
from sim.arm import ArmTruth
from sim.camera import SimCamera
from sim.cell import SimulatedCell
from sim.clock import WallClock
from sim.peers.callable_camera import CallableCamera
from sim.peers.gige import GigEPeer
from sim.peers.loopback import own_address
from sim.peers.robotiq import RobotiqPeer
from sim.presets import ur3_robotiq
from tests.drivers.cameras.scene import HEIGHT, WIDTH, Scene, number_in

VIKY = str(Path(genicam.__file__).parent / "viky.cti")


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
    shows_scene:
        Whether a frame shows what the camera looks at now.
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
    change_scene: Callable[[], None] | None = None
    shows_scene: Callable[[Frame], bool] | None = None
    delay: Callable[[float], None] | None = None
    focus_range: tuple[float, float] = (3000.0, 4000.0)


def _scene_rig(camera: Camera, can: str, scene: Scene, delay: Callable[[float], None]) -> Rig:
    def change() -> None:
        scene.number += 1

    def shows(frame: Frame) -> bool:
        return number_in(frame.image) == scene.number

    return Rig(camera, frozenset(can.split()), (WIDTH, HEIGHT), _later, change, shows, delay)


def _later(before: Frame, after: Frame) -> bool:
    return after.host_t_s > before.host_t_s


@contextmanager
def aravis() -> Iterator[Rig]:
    scene, address = Scene(), own_address()
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


class StandingArm:
    """An arm that stands where it is put."""

    def __init__(self, joints_rad: FloatArray) -> None:
        self.joints_rad = joints_rad

    def truth(self) -> ArmTruth:
        return ArmTruth(self.joints_rad, np.zeros(6), self.joints_rad, np.zeros(6))


def turned(angle_rad: float) -> FloatArray:
    return np.array([0.0, 0.0, 0.0, 0.0, 0.0, angle_rad])


def half_size_cell() -> SimulatedCell:
    """A preset with half the pixels each way, which renders four times as fast."""
    cell = ur3_robotiq()
    optics = optics_row(alpha_px=685.4, beta_px=686.9, u0_px=322.9, v0_px=179.6, height_px=362)
    return replace(
        cell,
        model=replace(cell.model, optics=optics),
        camera=replace(cell.camera, width_px=640, height_px=362),
    )


@contextmanager
def simulated() -> Iterator[Rig]:
    cell = half_size_cell()
    arm = StandingArm(cell.home_rad)
    camera = SimCamera(cell, arm, WallClock())
    places = itertools.cycle([cell.home_rad + turned(0.5), cell.home_rad])
    seen: dict[float, np.ndarray] = {}

    def change() -> None:
        arm.joints_rad = next(places)

    def shows(frame: Frame) -> bool:
        # each of the two places looks like itself and unlike the other
        here = float(arm.joints_rad[5])
        reference = seen.setdefault(here, frame.image.astype(float))
        alike = np.abs(frame.image - reference).mean() < 5
        return bool(alike) and all(
            np.abs(frame.image - other).mean() > 10 for at, other in seen.items() if at != here
        )

    def delay(seconds: float) -> None:
        camera.faults.lose_frames = int(seconds > 0)

    can = frozenset({"exposure", "gain", "focus", "autofocus"})
    yield Rig(
        camera,
        can,
        (cell.camera.width_px, cell.camera.height_px),
        _later,
        change,
        shows,
        delay,
        (300.0, 700.0),
    )
    camera.close()


RIGS: dict[str, Callable[[], AbstractContextManager[Rig]]] = {
    "simulated": simulated,
    "aravis": aravis,
    "gentl": gentl,
    "robotiq": robotiq,
    "robotiq-without-settings": robotiq_without_settings,
}
