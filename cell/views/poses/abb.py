"""ABB RAPID: `tooldata` for what is on the flange, `wobjdata` and `robtarget` for what stands."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cell.views.poses.placement import Placement

_LOAD = "[0.001,[0,0,0.001],[1,0,0,0],0,0,0]"
"""RAPID wants a mass above zero; the load of the real tool is set apart from its frame."""


def text(found: Sequence[Placement]) -> str:
    """Declarations for a module: millimetres, quaternion with its scalar first."""
    return "\n".join(_one(placement) for placement in found)


def _one(placement: Placement) -> str:
    load = "! its load is a placeholder: set mass and centre of mass of the real tool\n"
    return (
        f"! {placement.direction}\n"
        f"! {placement.about}; {placement.sigma}\n"
        f"! millimetres, quaternion w x y z, in {'tool0' if _moves(placement) else 'wobj0'}\n"
        f"{load if _moves(placement) else ''}{value(placement)}\n"
    )


def _moves(placement: Placement) -> bool:
    return placement.parent == "flange"


def value(placement: Placement) -> str:
    """The declarations alone."""
    name = placement.child.capitalize()
    frame = _frame(placement)
    if _moves(placement):
        return f"PERS tooldata t{name} := [TRUE,{frame},{_LOAD}];"
    return (
        f'PERS wobjdata wobj{name} := [FALSE,TRUE,"",{frame},[[0,0,0],[1,0,0,0]]];\n'
        f"CONST robtarget p{name} := [{frame[1:-1]},[0,0,0,0],"
        "[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];"
    )


def _frame(placement: Placement) -> str:
    place = ",".join(f"{1e3 * value:.6f}" for value in placement.p_m)
    turn = ",".join(f"{value:.9f}" for value in np.roll(placement.q_xyzw, 1))
    return f"[[{place}],[{turn}]]"
