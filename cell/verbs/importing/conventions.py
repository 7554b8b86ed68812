"""What a pose's numbers mean: stated by the user, or concluded from names, numbers and pictures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import RigidTransform

from calib.detection.orientation import Closure
from calib.views import FloatArray
from cell.errors import InputError
from cell.verbs.importing import RotationName, Unit
from cell.verbs.importing.lengths import Lengths, unit_of
from cell.verbs.importing.pairing import Pairing, apply
from cell.verbs.importing.raw import RawPose
from cell.verbs.importing.rotations import (
    METRES,
    QUATERNIONS,
    THREE_ANGLES,
    is_unit,
    read_matrices,
    read_pose,
)

PictureCheck = Callable[[FloatArray], Closure | None]
"""How far (P, 4, 4) poses, one a picture or NaN, are from what the pictures show."""

_GOOD_RAD, _GOOD_SHARE = 0.06, 0.3
"""What rough intrinsics and a poor arm may make: a wrong reading is off by half the way and more,
a right one by a few percent."""

_TELLS_APART = 3.0
"""A reading counts as decided when the next best is so many times worse."""

_LEAST = 0.005


@dataclass(frozen=True)
class StatedConvention:
    """What the user stated of the poses; None where nothing."""

    rotation: RotationName | None = None
    unit: Unit | None = None
    inverted: bool | None = None


NOTHING_STATED = StatedConvention()


@dataclass(frozen=True)
class Candidate:
    """Poses that may be the flange's, and which picture each would belong to."""

    poses: Sequence[RawPose]
    pairing: Pairing
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Convention:
    """How poses are written.

    Attributes
    ----------
    rotation:
        What the numbers after the position are.
    unit:
        Of the position.
    inverted:
        Whether they are flange_from_base.
    guessed:
        What was not stated but concluded, each as a sentence for the user.
    contradicted:
        What was stated and the pictures speak against, each as a sentence.
    """

    rotation: RotationName
    unit: Unit
    inverted: bool = False
    guessed: tuple[str, ...] = ()
    contradicted: tuple[str, ...] = ()

    def transform(self, pose: RawPose) -> RigidTransform:
        """base_from_flange; raises `InputError` where the numbers cannot be what is stated."""
        try:
            turn, p = read_pose(pose.values, self.rotation)
        except ValueError as fault:
            raise InputError(f"{pose.where}: is no pose as {self.rotation}: {fault}") from None
        found = RigidTransform.from_components(METRES[self.unit] * p, turn)
        return found.inv() if self.inverted else found


@dataclass(frozen=True)
class _Reading:
    candidate: Candidate
    rotation: RotationName
    inverted: bool
    closure: Closure | None = None

    @property
    def size(self) -> float:
        """How bad it is by the pictures."""
        c = self.closure
        return np.inf if c is None else float(np.hypot(c.angle_rad, c.place_share))

    @property
    def good(self) -> bool:
        """Whether the pictures bear it out."""
        c = self.closure
        return c is not None and c.angle_rad <= _GOOD_RAD and c.place_share <= _GOOD_SHARE

    @property
    def off(self) -> str:
        """How far off, as text."""
        assert self.closure is not None
        angle, share = np.degrees(self.closure.angle_rad), 1e2 * self.closure.place_share
        return f"{angle:.2f} degrees, places to {share:.1f} % of the way"


def conclude(
    candidates: Sequence[Candidate],
    stated: StatedConvention = NOTHING_STATED,
    check: PictureCheck | None = None,
    square_m: float | None = None,
) -> tuple[Candidate, Convention]:
    """The poses, their pictures and their convention: as stated, else what there is decides.

    Parameters
    ----------
    candidates:
        The likeliest first.
    check:
        What the pictures say of a reading; None where they say nothing.
    square_m:
        The board's square, for a message about lengths that disagree.

    Raises
    ------
    InputError
        Several readings are left, or the pictures bear none of them out; the message names them.
    """
    readings = [
        _Reading(candidate, rotation, inverted)
        for candidate in candidates
        for rotation in ([stated.rotation] if stated.rotation else possible(candidate.poses))
        for inverted in ([stated.inverted] if stated.inverted is not None else [False, True])
    ]
    measured = [] if check is None else [_measured(reading, check) for reading in readings]
    if any(reading.closure is not None for reading in measured):
        best, notes, against = _by_pictures(measured, stated)
    else:
        best, notes, against = _by_stated(readings), (), ()
        if check is not None:
            notes = ("the pictures could not be asked about the poses",)
    lengths = _lengths(best, stated, square_m)
    guessed = [*best.candidate.notes, f"poses and pictures are paired {best.candidate.pairing.how}"]
    if stated.rotation is None:
        guessed.append(f"rotations are {best.rotation} (say so with --rotation {best.rotation})")
    if stated.unit is None:
        guessed.append(
            f"positions are in {lengths.unit}, {lengths.why} (say so with --unit {lengths.unit})"
        )
    if stated.inverted is None:
        name, option = _DIRECTION[best.inverted]
        guessed.append(f"poses are {name} (say so with {option})")
    return best.candidate, Convention(
        best.rotation,
        lengths.unit,
        best.inverted,
        (*guessed, *notes),
        (*against, *lengths.contradicted),
    )


_DIRECTION = {
    False: ("base_from_flange", "--not-inverted"),
    True: ("flange_from_base", "--inverted"),
}


def possible(poses: Sequence[RawPose]) -> tuple[RotationName, ...]:
    """What names and numbers allow; at least one."""
    named, width = poses[0].rotations, len(poses[0].values)
    if width >= 12:
        return ("matrix_by_columns",) if _by_columns(poses) else ("matrix",)
    if width == 7:
        return named or tuple(QUATERNIONS)
    allowed = named or tuple(THREE_ANGLES)
    largest = max(float(np.abs(pose.values[3:]).max()) for pose in poses)
    if largest > 2 * np.pi + 0.01:
        degrees = tuple(name for name in allowed if name.endswith("_deg"))
        return degrees or allowed
    return allowed


def _by_columns(poses: Sequence[RawPose]) -> bool:
    """Whether the translation stands in the last row."""
    if len(poses[0].values) != 16:
        return False
    matrices = np.array([pose.values.reshape(4, 4) for pose in poses])
    return bool((matrices[:, :3, 3] == 0).all() and (matrices[:, 3, :3] != 0).any())


def _measured(reading: _Reading, check: PictureCheck) -> _Reading:
    try:
        values = [pose.values for pose in reading.candidate.poses]
        read = read_matrices(values, reading.rotation, inverted=reading.inverted)
    except ValueError:
        return reading
    closure = check(apply(reading.candidate.pairing, read))
    return _Reading(reading.candidate, reading.rotation, reading.inverted, closure)


def _by_stated(readings: Sequence[_Reading]) -> _Reading:
    """The reading that names and numbers alone decide."""
    first = readings[0]
    rotations = list(dict.fromkeys(reading.rotation for reading in readings))
    if len(rotations) > 1:
        raise InputError(ask(first.candidate.poses, rotations))
    ways = list(dict.fromkeys(reading.candidate.pairing.how for reading in readings))
    if len(ways) > 1 and not first.candidate.pairing.certain:
        raise InputError(
            f"{first.candidate.poses[0].where}: poses may belong to the pictures"
            f" {', or '.join(ways)}, and the pictures do not show which: name the picture of each"
            " pose in the pose file"
        )
    return first


def _by_pictures(
    measured: Sequence[_Reading], stated: StatedConvention
) -> tuple[_Reading, tuple[str, ...], tuple[str, ...]]:
    """The reading that the pictures bear out, what to report of it, and what speaks against it."""
    order = sorted(range(len(measured)), key=lambda k: (measured[k].size, k))
    smallest = max(measured[order[0]].size, _LEAST)
    close = [k for k in order if measured[k].size < _TELLS_APART * smallest]
    best = measured[min(close)]
    if not measured[order[0]].good:
        best = measured[order[0]]
        if stated.rotation is not None:
            return best, (), (f"the poses as stated agree with the pictures only to {best.off}",)
        raise InputError(_contradicted(best, [r.rotation for r in measured]))
    rivals = [measured[k] for k in close]
    if any(rival.rotation != best.rotation for rival in rivals):
        raise InputError(ask(best.candidate.poses, [best.rotation, *(r.rotation for r in rivals)]))
    notes = (f"the pictures bear this out: robot's and camera's turns agree to {best.off}",)
    if any(rival.inverted != best.inverted for rival in rivals):
        notes = ("the pictures do not show the direction of the poses",)
    return best, notes, ()


def _contradicted(best: _Reading, rotations: Sequence[RotationName]) -> str:
    where, pairing = best.candidate.poses[0].where, best.candidate.pairing
    tried = ", ".join(dict.fromkeys(rotations))
    return (
        f"{where}: no reading of the poses agrees with the pictures (tried {tried}). The best"
        f" ({best.rotation}, paired {pairing.how}) agrees only to {best.off}: check the poses and"
        " which picture each is of; or say --rotation to take them as they are"
    )


def _lengths(best: _Reading, stated: StatedConvention, square_m: float | None) -> Lengths:
    try:
        values = [pose.values for pose in best.candidate.poses]
        places = read_matrices(values, best.rotation, inverted=False)[:, :3, 3]
    except ValueError as fault:
        raise InputError(
            f"{best.candidate.poses[0].where}: is no pose as {best.rotation}: {fault}"
        ) from None
    factor = best.closure.length_factor if best.good and best.closure is not None else None
    return unit_of(places, best.candidate.poses[0].unit, stated.unit, factor, square_m)


def ask(poses: Sequence[RawPose], readings: Sequence[RotationName]) -> str:
    """The question that is left, with the answers that can be given."""
    where, left = poses[0].where, " or ".join(dict.fromkeys(f"--rotation {r}" for r in readings))
    if len(poses[0].values) == 7 and is_unit(poses[0].values[3:]):
        return (
            f"{where}: a quaternion may be written x y z w or w x y z, and nothing shows which."
            " Say --rotation quat_xyzw (ROS, scipy) or --rotation quat_wxyz (ABB, Eigen)."
        )
    return (
        f"{where}: three numbers of a rotation may be a rotation vector (UR) or angles about axes"
        " (rpy: fixed x y z, Fanuc, ROS; euler_zyx: KUKA; euler_xyz: Staubli, Mecademic; euler_zyz:"
        f" Kawasaki, Doosan), and nothing shows which. Say {left}."
    )
