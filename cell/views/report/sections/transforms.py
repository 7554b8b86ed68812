"""Where the camera and the board are, ready to be copied into a robot or ROS."""

from __future__ import annotations

from cell.errors import InputError
from cell.storage.files.calibration_source import PlacementSource
from cell.views.poses import abb, tf, ur, urdf
from cell.views.poses.placement import Placement, placements
from cell.views.report import html
from cell.views.report.data import ReportData


def transforms_section(data: ReportData) -> str:
    """Each transform with its direction, for ROS, URDF, UR and ABB; nothing where undetermined."""
    if data.calibration is None:
        return ""
    try:
        found = placements(PlacementSource.model_validate(data.calibration))
    except InputError:
        return ""  # the warnings above say why there is none
    blocks = "".join(_block(placement) for placement in found)
    message = (
        "Click a box to select it whole. Further formats, and your own names of the frames: "
        "cell export --format tf, urdf, ur, abb, moveit, easy_handeye2 or text."
    )
    return html.fold(
        "Take away: the camera's place for ROS, URDF, UR and ABB",
        blocks + html.paragraph(message, "small"),
    )


def _block(placement: Placement) -> str:
    shown = (
        ("ROS 2", tf.command(placement)),
        ("URDF", urdf.joint(placement)),
        ("UR", ur.pose(placement)),
        ("ABB RAPID", abb.value(placement)),
    )
    rows = "".join(
        f'<dt>{html.text(name)}</dt><dd><pre class="copy">{html.text(code)}</pre></dd>'
        for name, code in shown
    )
    return f"{html.paragraph(f'{placement.direction}; {placement.sigma}')}<dl>{rows}</dl>"
