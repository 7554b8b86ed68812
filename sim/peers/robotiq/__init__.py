"""A Robotiq wrist camera's HTTP server, on loopback only."""

from sim.peers.robotiq.server import RobotiqFaults, RobotiqPeer

__all__ = ["RobotiqFaults", "RobotiqPeer"]
