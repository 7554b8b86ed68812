"""ROS: static transforms as commands and as launch entries."""

from __future__ import annotations

from collections.abc import Sequence

from cell.views.poses.placement import Placement


def text(found: Sequence[Placement]) -> str:
    """For each transform the command of ROS 2 and ROS 1 and the entry of an XML launch file."""
    return "\n".join(_one(placement) for placement in found)


def command(placement: Placement) -> str:
    """The ROS 2 command that publishes the transform."""
    values = zip(("x", "y", "z", "qx", "qy", "qz", "qw"), _numbers(placement), strict=True)
    reported = " ".join(f"--{name} {value}" for name, value in values)
    return (
        f"ros2 run tf2_ros static_transform_publisher {reported}"
        f" --frame-id {placement.parent_name} --child-frame-id {placement.child_name}"
    )


def launch_file(found: Sequence[Placement]) -> str:
    """A launch file of ROS 1 as MoveIt's hand-eye panel saves it."""
    nodes = "\n".join(
        f"  <!-- {p.direction}; {p.about}; {p.sigma} -->\n"
        f'  <node pkg="tf2_ros" type="static_transform_publisher" name="{p.child}_broadcaster"'
        f' args="{" ".join(_numbers(p))} {p.parent_name} {p.child_name}" />'
        for p in found
    )
    return f"<launch>\n{nodes}\n</launch>\n"


def _one(placement: Placement) -> str:
    numbers = " ".join(_numbers(placement))
    frames = f"{placement.parent_name} {placement.child_name}"
    arguments = command(placement).partition("static_transform_publisher ")[2]
    return (
        f"# {placement.direction}\n"
        f"# {placement.about}; {placement.sigma}; metres, quaternion x y z w\n"
        f"# ROS 2\n{command(placement)}\n"
        f"# ROS 2, XML launch entry\n"
        f'# <node pkg="tf2_ros" exec="static_transform_publisher" args="{arguments}"/>\n'
        f"# ROS 1\n"
        f"# rosrun tf2_ros static_transform_publisher {numbers} {frames}\n"
    )


def _numbers(placement: Placement) -> list[str]:
    return [f"{value:.9f}" for value in (*placement.p_m, *placement.q_xyzw)]
