"""Where things are, as a calibration found them, with the names that the reader's tool gives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from cell.errors import InputError
from cell.storage.files.calibration_source import PlacementSource, TransformSource

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

FRAMES: dict[str, str] = {
    "base": "base",
    "flange": "tool0",
    "camera": "camera_optical_frame",
    "board": "board",
}
"""ROS names of our frames; `tool0` is the flange, and for a UR `base` the controller's own base,
half a turn from `base_link`."""

_TRANSFORMS = (
    ("flange", "camera"),
    ("base", "camera"),
    ("base", "board"),
    ("flange", "board"),
)


@dataclass(frozen=True)
class Placement:
    """One transform parent_from_child: where the child sits in the parent.

    Attributes
    ----------
    parent, child:
        Our names of the frames.
    names:
        The reader's names, by ours.
    about:
        One line on where it came from.
    """

    parent: str
    child: str
    transform: TransformSource
    names: Mapping[str, str]
    about: str

    @property
    def name(self) -> str:
        """Such as `flange_from_camera`."""
        return f"{self.parent}_from_{self.child}"

    @property
    def parent_name(self) -> str:
        """What the reader calls the parent."""
        return self.names[self.parent]

    @property
    def child_name(self) -> str:
        """What the reader calls the child."""
        return self.names[self.child]

    @property
    def direction(self) -> str:
        """The transform's direction, in words that leave no other reading."""
        return (
            f"{self.name}: pose of the {self.child} in the {self.parent}"
            f" (maps {self.child} coordinates to {self.parent} coordinates)"
        )

    @property
    def p_m(self) -> tuple[float, float, float]:
        """Origin of the child in the parent."""
        return self.transform.p_m

    @property
    def rotation(self) -> Rotation:
        """Of the child in the parent."""
        from scipy.spatial.transform import Rotation

        return Rotation.from_quat(self.transform.q_xyzw)

    @property
    def q_xyzw(self) -> tuple[float, ...]:
        """Unit quaternion, scalar last, the scalar not negative."""
        return tuple(self.rotation.as_quat(canonical=True).tolist())

    def angles(self, order: Literal["xyz", "ZYX"], *, degrees: bool) -> tuple[float, ...]:
        """Three angles about the axes of `order`; at the pole the third is zero."""
        found = self.rotation.as_euler(order, degrees=degrees, suppress_warnings=True)
        return tuple(found.tolist())

    @property
    def sigma(self) -> str:
        """One sigma in words."""
        p, r = self.transform.sigma_p_m, self.transform.sigma_r_rad
        if not any(p):
            return "one sigma not known"
        mm = ", ".join(f"{1e3 * value:.3f}" for value in p)
        deg = ", ".join(f"{np.degrees(value):.4f}" for value in r)
        return f"one sigma {mm} mm and {deg} degrees along and about the {self.child}'s x, y, z"


def placements(
    calibration: PlacementSource, names: Mapping[str, str] | None = None
) -> tuple[Placement, ...]:
    """The camera's place first, then the board's.

    Raises
    ------
    InputError
        The calibration does not determine them, or a name is not one of `FRAMES`.
    """
    unknown = sorted(set(names or {}) - set(FRAMES))
    if unknown:
        raise InputError(f"--frame {unknown[0]}=...: is no frame; frames are {', '.join(FRAMES)}")
    refuse_undetermined(calibration, "hand_eye")
    # two hyphens would end an XML comment
    recording = " ".join(calibration.recording.split()).replace("--", "- -")
    made = f", {calibration.created}" if calibration.created else ""
    found = tuple(
        Placement(
            parent,
            child,
            transform,
            FRAMES | dict(names or {}),
            f"calibration of recording {recording}{made}",
        )
        for parent, child in _TRANSFORMS
        if (transform := getattr(calibration, f"{parent}_from_{child}")) is not None
    )
    if not found:
        raise InputError(
            "the calibration does not say where the camera is on the robot: no flange pose was"
            " logged with the pictures"
        )
    return found


def refuse_undetermined(calibration: PlacementSource, part: str) -> None:
    """Raise `InputError` for a part that the data did not determine."""
    why = calibration.undetermined.get(part)
    if why is not None:
        raise InputError(
            f"is not handed over: {why}. What to do stands in the calibration's `warnings`"
        )
