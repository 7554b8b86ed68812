"""What goes wrong with a simulated Universal Robots controller on command."""

from __future__ import annotations

from dataclasses import dataclass

from sim.peers.controller_faults import ControllerFaults


@dataclass
class URFaults(ControllerFaults):
    """Those of every controller, and those of RTDE.

    Attributes
    ----------
    reserved_inputs, missing_outputs:
        RTDE names that a fieldbus holds, or that this version does not know.
    ignore_new_clients:
        New RTDE connections are accepted and never answered.
    """

    reserved_inputs: frozenset[str] = frozenset()
    missing_outputs: frozenset[str] = frozenset()
    ignore_new_clients: bool = False
