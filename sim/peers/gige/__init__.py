"""A GigE Vision device in pure Python, on loopback only."""

from sim.peers.gige.device import GigEPeer
from sim.peers.gige.streamer import Faults

__all__ = ["Faults", "GigEPeer"]
