"""The devices of a simulated cell, put together."""

from __future__ import annotations

from sim.arm import SimArm
from sim.camera import SimCamera
from sim.cell import ARM_STREAM, SimulatedCell
from sim.clock import Clock


def build(
    cell: SimulatedCell, clock: Clock, *, render_ahead: bool = False
) -> tuple[SimArm, SimCamera]:
    """Arm and camera that live by one clock; neither is connected yet. See `SimCamera`."""
    arm = SimArm(
        cell.kinematics,
        clock,
        cell.home_rad,
        repeatability=cell.repeatability,
        noise=cell.placed_noise(ARM_STREAM),
    )
    return arm, SimCamera(cell, arm, clock, render_ahead=render_ahead)
