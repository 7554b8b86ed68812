"""The devices of a simulated cell, put together."""

from __future__ import annotations

from sim.arm import SimArm
from sim.camera import SimCamera
from sim.cell import ARM_STREAM, SimulatedCell
from sim.clock import Clock


def build(cell: SimulatedCell, clock: Clock) -> tuple[SimArm, SimCamera]:
    """Arm and camera that live by one clock; neither is connected yet."""
    arm = SimArm(
        cell.kinematics,
        clock,
        cell.home_rad,
        repeatability=cell.repeatability,
        rng=cell.random(ARM_STREAM),
    )
    return arm, SimCamera(cell, arm, clock)
