"""An ABB IRC5 controller on loopback."""

from sim.peers.abb.controller import ABBController

__all__ = ["ABBController"]
