"""A Universal Robots controller on loopback."""

from sim.peers.ur.controller import URController
from sim.peers.ur.modes import Robot, Runtime, Safety

__all__ = ["Robot", "Runtime", "Safety", "URController"]
