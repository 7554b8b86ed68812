"""The controller's panel, and what goes wrong with the controller on command."""

from __future__ import annotations

from dataclasses import dataclass

from sim.peers.controller_faults import ControllerFaults


@dataclass
class PanelState:
    """``controller`` is RWS's ctrlstate, ``mode`` its opmode, ``speed_ratio`` in percent."""

    controller: str = "motoron"
    mode: str = "AUTO"
    speed_ratio: float = 100.0


@dataclass
class ABBFaults(ControllerFaults):
    """Those of every controller, and: only RAPID's stop is refused, not motors off."""

    rapid_stop_refused: bool = False
