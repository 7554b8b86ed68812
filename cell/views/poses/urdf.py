"""URDF and xacro: a fixed joint from the parent's link to the child's."""

from __future__ import annotations

from collections.abc import Sequence

from cell.views.poses.placement import Placement


def text(found: Sequence[Placement]) -> str:
    """A link and a fixed joint for each transform; rpy are about the fixed axes x, y, z."""
    return "\n".join(element(placement) for placement in found)


def element(placement: Placement) -> str:
    """One link with its joint, and where they came from."""
    return (
        f"<!-- {placement.direction}; {placement.about}; {placement.sigma} -->\n"
        f"{joint(placement)}\n"
    )


def joint(placement: Placement) -> str:
    """One link with its joint."""
    xyz = " ".join(f"{value:.9f}" for value in placement.p_m)
    rpy = " ".join(f"{value:.9f}" for value in placement.angles("xyz", degrees=False))
    parent, child = placement.parent_name, placement.child_name
    return (
        f'<link name="{child}"/>\n'
        f'<joint name="{parent}_to_{child}" type="fixed">\n'
        f'  <parent link="{parent}"/>\n'
        f'  <child link="{child}"/>\n'
        f'  <origin xyz="{xyz}" rpy="{rpy}"/>\n'
        "</joint>"
    )
