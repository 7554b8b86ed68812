"""A small real cell, its peers and its plan: what `cell run` drives here, without --dry-run.

The devices live in this process, so that faults are ordered and the arm's truth is read directly;
the cell runs in a process of its own and knows nothing but their addresses.
"""

from __future__ import annotations

import hashlib
import json
import re
import ssl
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cell.devices.simulated_cell import home_of, simulated_cell
from cell.storage.files.plan_file import Plan, read_plan
from cell.storage.files.yaml_model import read_mapping
from sim.arm import SimArm
from sim.build import build
from sim.camera import SimCamera
from sim.cell import SimulatedCell
from sim.clock import SimClock, WallClock
from sim.peers.abb import ABBController
from sim.peers.abb.http_server import CERTIFICATE
from sim.peers.gige import GigEPeer
from sim.peers.loopback import own_address
from sim.peers.robotiq import RobotiqPeer
from sim.peers.ur import URController

CONFIGS = Path(__file__).parents[2] / "configs"
UR, ABB = "ur", "abb"
VIEWS = 60
_ROBOT_API_PORT = 8080  # an ordinary user may not open port 80
_WIDTH_PX = 320
_SWAY_DEG = np.array([1.0, 1.0, -1.0, 1.5, 1.5, 10.0])


@dataclass
class Stand:
    """The devices of one real cell.

    Attributes
    ----------
    plan:
        Of `VIEWS` views around the cell's home, each a move of a second or two.
    maker:
        Of the arm: `UR` or `ABB`.
    truth, sim:
        What the peers simulate, and the arm behind the controller.
    arm, camera:
        The peers.
    """

    plan: Plan
    maker: str
    truth: SimulatedCell
    sim: SimArm
    arm: Any
    camera: Any

    def truly_moving(self) -> bool:
        """Whether any joint moves, whoever says what."""
        return bool(np.abs(self.sim.truth().joint_velocity_rad_s).max() > 0.0)


@contextmanager
def _ur_gige(folder: Path, api_port: int | None) -> Iterator[Stand]:
    """A UR3 and a GigE Vision camera."""
    arm_at, camera_at = own_address(), own_address()
    robot: dict[str, Any] = {"driver": "ur", "address": arm_at}
    robot |= {} if api_port is None else {"robot_api_port": api_port}
    camera = {"driver": "gige", "model": "gige_camera", "address": camera_at}
    plan = _plan(folder, "ur3-robotiq", robot, camera)
    with ExitStack() as stack:
        truth, sim, source = _built(plan)
        controller = stack.enter_context(
            URController(
                sim,
                arm_at,
                kinematics=truth.kinematics,
                robot_api_port=api_port,
                payload_kg=truth.payload_kg or 0.0,
            )
        )
        spec = truth.camera
        peer = GigEPeer(
            source,
            spec.width_px,
            spec.height_px,
            address=camera_at,
            focus_steps=spec.focus_steps,
        )
        yield Stand(plan, UR, truth, sim, controller, stack.enter_context(peer))


@contextmanager
def _abb_robotiq(folder: Path, omnicore: bool) -> Iterator[Stand]:
    """An IRB 140 and a Robotiq wrist camera."""
    arm_at, camera_at = own_address(), f"{own_address()}:4242"
    robot: dict[str, Any] = {"driver": "abb", "address": f"{arm_at}:8610", "factory_password": True}
    robot |= {"certificate_sha256": _certificate()} if omnicore else {}
    camera = {"driver": "robotiq", "model": "robotiq_wrist", "address": camera_at}
    plan = _plan(folder, "irb140-eosens", robot, camera)
    with ExitStack() as stack:
        truth, sim, source = _built(plan)
        controller = stack.enter_context(ABBController(sim, arm_at, omnicore=omnicore))
        host, _, camera_port = camera_at.partition(":")
        peer = RobotiqPeer(source, address=host, port=int(camera_port))
        yield Stand(plan, ABB, truth, sim, controller, stack.enter_context(peer))


STANDS: dict[str, Callable[[Path], AbstractContextManager[Stand]]] = {
    "ur+gige": partial(_ur_gige, api_port=None),
    "polyscope-x+gige": partial(_ur_gige, api_port=_ROBOT_API_PORT),
    "abb+robotiq": partial(_abb_robotiq, omnicore=False),
    "omnicore+robotiq": partial(_abb_robotiq, omnicore=True),
}


def _certificate() -> str:
    """Fingerprint of the certificate that a simulated OmniCore shows."""
    shown = re.search(r"-+BEGIN CERT.*?END CERT[^\n]*", CERTIFICATE.read_text(), re.DOTALL)
    assert shown is not None
    return hashlib.sha256(ssl.PEM_cert_to_DER_cert(shown[0])).hexdigest()


def _plan(folder: Path, name: str, robot: dict[str, Any], camera: dict[str, Any]) -> Plan:
    cell = json.loads(json.dumps(read_mapping(CONFIGS / f"{name}.cell.yaml")))
    cell["robot"] |= robot
    cell["camera"] |= camera
    _shrink(cell)
    (folder / "cell.yaml").write_text(json.dumps(cell))
    home = np.array(cell["layout"]["home_deg"], float)
    views = [{"joints_deg": (home + _sway(number)).round(4).tolist()} for number in range(VIEWS)]
    plan = {
        "schema": "cell.plan/1",
        "name": "faults",
        "cell": "cell.yaml",
        "speed_m_s": 0.25,
        "joint_speed_deg_s": 10.0,
        "exposure": {"focus": "auto", "timeout_s": 2.0},
        "views": views,
    }
    (folder / "plan.yaml").write_text(json.dumps(plan))
    return read_plan(folder / "plan.yaml")


def _sway(number: int) -> Any:
    """Offsets that no two neighbours share, so that each view is a move."""
    return _SWAY_DEG * np.sin(np.arange(1, 7) * (1.0 + 2.0 * number))


def _shrink(cell: dict[str, Any]) -> None:
    """Fewer pixels of the same field of view, which render at once; no lens that breathes."""
    scale = _WIDTH_PX / cell["camera"]["width"]
    cell["camera"] |= {"width": _WIDTH_PX, "height": round(cell["camera"]["height"] * scale)}
    cell["camera"].pop("pixel_size_um", None)
    optics = cell["simulation"]["optics"]
    for name in ("alpha_px", "beta_px", "u0_px", "v0_px"):
        optics[name] = (
            (optics[name] + 0.5) * scale - 0.5 if name[1] == "0" else optics[name] * scale
        )
    cell["layout"]["alpha_px"] *= scale
    cell["simulation"]["effects"] = []


def _built(plan: Plan) -> tuple[SimulatedCell, SimArm, SimCamera]:
    truth = simulated_cell(plan.cell, home_of(plan))
    _compile(truth)
    return truth, *build(truth, WallClock())


def _compile(truth: SimulatedCell) -> None:
    """Take a picture in a throw-away cell, so that the first real one is not late."""
    arm, camera = build(truth, SimClock())
    arm.connect()
    camera.connect()
    camera.grab(1.0)
