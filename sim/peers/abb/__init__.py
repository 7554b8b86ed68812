"""An ABB IRC5 or OmniCore controller on loopback."""

from sim.peers.abb.controller import ABBController

__all__ = ["ABBController"]
