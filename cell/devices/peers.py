"""Simulated devices behind the wires of real ones, for a dry run through the real drivers.

The peers live in a process of their own, as a controller and a camera do: rendering a picture must
not keep this process from watching the arm, and what the interpreter lock holds up here must not
hold up the devices. They go when the context is left, and when this process dies in whatever way.
"""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Literal

from cell.errors import InputError
from cell.sequencer.stop import FROM_TERMINAL
from drivers.errors import DeviceUnreachable
from sim.arm import SimArm
from sim.build import build
from sim.camera import SimCamera
from sim.cell import SimulatedCell
from sim.clock import SimClock, WallClock
from sim.peers.loopback import own_address

ArmWire = Literal["ur", "abb"]
CameraWire = Literal["gige", "robotiq"]

_ABB_PORT = 8610
_START_S = 60.0  # a first start compiles the renderer
_END_S = 5.0


@dataclass(frozen=True)
class Wires:
    """Where the peers listen: each an address as the driver takes it."""

    arm: str
    camera: str


@contextmanager
def peers(cell: SimulatedCell, arm: ArmWire, camera: CameraWire) -> Iterator[Wires]:
    """The devices of a cell, each speaking its protocol on a loopback address of this run's own.

    Raises
    ------
    InputError
        The addresses or ports cannot be had on this machine.
    DeviceUnreachable
        The peers' process died, or did not start in a minute.
    """
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    process = context.Process(
        target=_serve, args=(there, cell, arm, camera, own_address()), name="peers", daemon=True
    )
    process.start()
    there.close()
    try:
        yield _received(here)
    finally:
        here.close()
        process.join(_END_S)
        if process.is_alive():
            process.kill()
            process.join()


def _received(link: Connection) -> Wires:
    try:
        reported = link.recv() if link.poll(_START_S) else f"did not start in {_START_S:g} s"
    except EOFError:
        reported = "ended while starting"
    if isinstance(reported, Wires):
        return reported
    if isinstance(reported, OSError):
        raise InputError(
            "the peers cannot listen on this machine's loopback addresses (127.0.0.0/8): "
            f"{reported}. End the other dry run with --peers, or leave --peers away."
        )
    raise DeviceUnreachable(f"the peers of the dry run: {reported}; run it without --peers")


def _serve(
    link: Connection, cell: SimulatedCell, arm: ArmWire, camera: CameraWire, address: str
) -> None:
    """In the peers' process: serve until the other end of `link` is gone."""
    # Ctrl-C and a closed terminal reach the whole group; the arm must live to be ordered to stop
    for number in FROM_TERMINAL:
        signal.signal(number, signal.SIG_IGN)
    _compile(cell)
    with ExitStack() as stack:
        simulated, source = build(cell, WallClock(), render_ahead=True)
        try:
            wires = Wires(
                _arm_peer(stack, arm, simulated, cell, address),
                _camera_peer(stack, camera, source, cell, address),
            )
        except OSError as taken:
            link.send(taken)
            return
        link.send(wires)
        try:
            link.recv()
        except EOFError:
            return


def _compile(cell: SimulatedCell) -> None:
    """Take a picture in a throw-away cell, so that the first real one is not late."""
    arm, camera = build(cell, SimClock())
    arm.connect()
    camera.connect()
    camera.grab(1.0)


def _arm_peer(
    stack: ExitStack, wire: ArmWire, arm: SimArm, cell: SimulatedCell, address: str
) -> str:
    if wire == "ur":
        from sim.peers.ur import URController

        controller = URController(
            arm, address, kinematics=cell.kinematics, payload_kg=cell.payload_kg or 0.0
        )
        return stack.enter_context(controller).address
    from sim.peers.abb import ABBController

    return stack.enter_context(ABBController(arm, address, _ABB_PORT)).url


def _camera_peer(
    stack: ExitStack, wire: CameraWire, source: SimCamera, cell: SimulatedCell, address: str
) -> str:
    if wire == "robotiq":
        from sim.peers.robotiq import RobotiqPeer

        return stack.enter_context(RobotiqPeer(source, address=address)).address
    from sim.peers.gige import GigEPeer

    spec = cell.camera
    steps = spec.focus_steps if spec.focus in ("auto", "motorised") else None
    peer = GigEPeer(source, spec.width_px, spec.height_px, address=address, focus_steps=steps)
    return stack.enter_context(peer).address
