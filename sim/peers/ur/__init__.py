"""A Universal Robots controller on loopback."""

from sim.peers.ur.controller import Event, Robot, Runtime, Safety, URController

__all__ = ["Event", "Robot", "Runtime", "Safety", "URController"]
