"""Universal Robots: URScript poses `p[x, y, z, rx, ry, rz]`, metres and rotation vectors."""

from __future__ import annotations

from collections.abc import Sequence

from cell.views.poses.placement import Placement


def text(found: Sequence[Placement]) -> str:
    """An assignment for each transform, with what it is for."""
    return "\n".join(
        f"# {placement.direction}\n"
        f"# {placement.about}; {placement.sigma}\n"
        f"# metres and rotation vector, in {_where(placement)}\n"
        f"{placement.child}_in_{placement.parent} = {pose(placement)}\n"
        for placement in found
    )


def pose(placement: Placement) -> str:
    """The pose alone."""
    values = (*placement.p_m, *placement.rotation.as_rotvec())
    return f"p[{', '.join(f'{value:.9f}' for value in values)}]"


def _where(placement: Placement) -> str:
    if placement.parent == "flange":
        return (
            "the tool flange (a TCP of zero): pose_trans(get_actual_tool_flange_pose(),"
            f" {placement.child}_in_flange) is the {placement.child} in the base"
        )
    return "the robot's base as the pendant's Base"
