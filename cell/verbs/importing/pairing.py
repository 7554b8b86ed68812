"""Which pose belongs to which picture: by name, by the number that varies, by time, in order."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform

from calib.views import FloatArray
from cell.errors import InputError
from cell.verbs.importing.raw import RawPose
from cell.verbs.importing.times import seconds

TIME_BOUND_S = 0.05
"""A pose so far from its picture in time is not its pose unless the user says so."""

_FEWEST = 3


@dataclass(frozen=True)
class Pairing:
    """One way to put pictures and poses together.

    Attributes
    ----------
    how:
        As text, to be reported.
    poses:
        Index into the file's poses for each picture, or -1 for a picture without one.
    between:
        For each picture the index of a second pose and the share of it, for a pose between two.
    certain:
        Nothing had to be guessed: both carry the same names or numbers.
    """

    how: str
    poses: tuple[int, ...]
    between: tuple[tuple[int, float], ...] = ()
    certain: bool = False

    @property
    def count(self) -> int:
        """Pictures with a pose."""
        return sum(index >= 0 for index in self.poses)


def pairings(
    pictures: Sequence[str], poses: Sequence[RawPose], bound_s: float | None = None
) -> list[Pairing]:
    """Every way that names, numbers and counts allow, the likeliest first; at least one.

    Parameters
    ----------
    pictures:
        Their file names.
    bound_s:
        How far apart in time picture and pose may be; `TIME_BOUND_S` where not stated.

    Raises
    ------
    InputError
        Nothing says which belong together.
    """
    by_name = _by_name(pictures, poses)
    if by_name is not None:
        return [by_name]
    found = _by_number(pictures, poses)
    timed = _by_time(pictures, poses, TIME_BOUND_S if bound_s is None else bound_s)
    if timed is not None:
        found.append(timed)
    if len(pictures) == len(poses):
        found.append(Pairing("one by one in their order", tuple(range(len(poses)))))
    found = _different(found)
    if not found:
        raise InputError(_nothing(pictures, poses))
    return found


def _different(found: Sequence[Pairing]) -> list[Pairing]:
    kept: dict[tuple[tuple[int, ...], tuple[tuple[int, float], ...]], Pairing] = {}
    for pairing in found:
        kept.setdefault((pairing.poses, pairing.between), pairing)
    return list(kept.values())


def _by_name(pictures: Sequence[str], poses: Sequence[RawPose]) -> Pairing | None:
    """By the picture's name in the pose file, with or without its suffix."""
    names = [None if pose.name is None else pose.name.lower() for pose in poses]
    if None in names or len(set(names)) < len(names):
        return None
    by_name = {name: k for k, name in enumerate(names)}
    by_stem = {Path(str(name)).stem: k for k, name in enumerate(names)}
    if len(by_stem) < len(names):
        by_stem = {}
    indices = tuple(
        by_name.get(picture.lower(), by_stem.get(Path(picture).stem.lower(), -1))
        for picture in pictures
    )
    matched = sum(index >= 0 for index in indices)
    if 2 * matched < min(len(pictures), len(poses)) or matched < min(_FEWEST, len(poses)):
        return None
    return Pairing("by the pictures' names in the pose file", indices, certain=True)


def varying_numbers(names: Sequence[str]) -> list[tuple[int, ...]]:
    """The numbers in names of one make that distinguish them: one tuple a place, likeliest first.

    `frame_000_cam0.png` varies in its first number, `0000_1279x724.png` too.
    """
    found = [[int(number) for number in re.findall(r"\d+", Path(name).stem)] for name in names]
    width = min((len(numbers) for numbers in found), default=0)
    columns = [tuple(numbers[k] for numbers in found) for k in range(width)]
    columns += [tuple(numbers[-1] for numbers in found)] if width else []
    apart = [column for column in columns if len(set(column)) == len(column)]
    return list(dict.fromkeys(apart))


def _pose_numbers(poses: Sequence[RawPose]) -> list[tuple[int, ...]]:
    numbers = [pose.number for pose in poses]
    found: list[tuple[int, ...]] = []
    if None not in numbers and len(set(numbers)) == len(numbers):
        found.append(tuple(int(n) for n in numbers if n is not None))
    names = [pose.name for pose in poses]
    if None not in names:
        found += varying_numbers([str(name) for name in names])
    return list(dict.fromkeys(found))


def _by_number(pictures: Sequence[str], poses: Sequence[RawPose]) -> list[Pairing]:
    """By equal numbers; and by numbers that are off by one count, the exact ones first."""
    found: list[Pairing] = []
    for of_pictures in varying_numbers(pictures):
        for of_poses in _pose_numbers(poses):
            first = min(of_poses) - min(of_pictures)
            for shift in dict.fromkeys((0, first, 1, -1)):
                pairing = _shifted(of_pictures, of_poses, shift)
                if pairing is not None:
                    found.append(pairing)
    found.sort(key=lambda p: (-p.count, not p.certain))
    return found


def _shifted(of_pictures: Sequence[int], of_poses: Sequence[int], shift: int) -> Pairing | None:
    index = {number: k for k, number in enumerate(of_poses)}
    indices = tuple(index.get(number + shift, -1) for number in of_pictures)
    matched = sum(k >= 0 for k in indices)
    if 2 * matched < min(len(of_pictures), len(of_poses)) or matched < min(_FEWEST, len(of_poses)):
        return None
    if not shift:
        whole = matched == min(len(of_pictures), len(of_poses))
        return Pairing("by their numbers", indices, certain=whole)
    example = next(k for k, pose in enumerate(indices) if pose >= 0)
    number = of_pictures[example]
    return Pairing(
        f"by their numbers, which are off by {abs(shift)}: picture {number} has pose"
        f" {number + shift}",
        indices,
    )


def _by_time(pictures: Sequence[str], poses: Sequence[RawPose], bound_s: float) -> Pairing | None:
    """By the time in the pictures' names: between the two poses around it, or at the nearest."""
    if any(pose.time_s is None for pose in poses):
        times_of_poses = _times_in_numbers(poses)
    else:
        times_of_poses = np.array([pose.time_s for pose in poses], dtype=float)
    if times_of_poses is None or len(poses) < 2:
        return None
    order = np.argsort(times_of_poses, kind="stable")
    times = times_of_poses[order]
    for column in varying_numbers(pictures):
        at = np.array([seconds(number) for number in column])
        pairing = _nearest(at, times, order, bound_s)
        if pairing is not None:
            return pairing
    return None


def _times_in_numbers(poses: Sequence[RawPose]) -> FloatArray | None:
    """Times that stand where a number stands, too large for a count."""
    numbers = [pose.number for pose in poses]
    if any(number is None or number < 1e8 for number in numbers):
        return None
    return np.array([seconds(float(n)) for n in numbers if n is not None])


def _nearest(
    at: FloatArray, times: FloatArray, order: NDArray[np.intp], bound_s: float
) -> Pairing | None:
    after = np.clip(np.searchsorted(times, at), 1, len(times) - 1)
    before = after - 1
    gap_s = times[after] - times[before]
    share = np.clip((at - times[before]) / np.maximum(gap_s, 1e-12), 0.0, 1.0)
    off_s = np.minimum(np.abs(at - times[before]), np.abs(at - times[after]))
    good = off_s <= bound_s
    if not good.any():
        return None
    far = gap_s > 2 * bound_s
    share[far] = np.round(share[far])
    indices = tuple(int(order[k]) if ok else -1 for k, ok in zip(before, good, strict=True))
    between = tuple((int(order[k]), float(s)) for k, s in zip(after, share, strict=True))
    return Pairing(
        f"by time, between the poses before and after the picture; the nearest is at most"
        f" {1e3 * off_s[good].max():.3g} ms away (bound {1e3 * bound_s:.3g} ms, --time-bound)",
        indices,
        between,
    )


def between_poses(first: FloatArray, second: FloatArray, share: float) -> FloatArray:
    """(4, 4) the pose on the straight way between two, `share` of it gone."""
    one, other = RigidTransform.from_matrix(first), RigidTransform.from_matrix(second)
    place = (1 - share) * first[:3, 3] + share * second[:3, 3]
    turn = (one.rotation.inv() * other.rotation).as_rotvec()
    rotation = one.rotation * type(one.rotation).from_rotvec(share * turn)
    return np.asarray(RigidTransform.from_components(place, rotation).as_matrix())


def apply(pairing: Pairing, matrices: FloatArray) -> FloatArray:
    """(P, 4, 4) each picture's pose, NaN without one, from (N, 4, 4) of the file's poses."""
    out = np.full((len(pairing.poses), 4, 4), np.nan)
    for picture, index in enumerate(pairing.poses):
        if index < 0:
            continue
        out[picture] = matrices[index]
        if pairing.between:
            second, share = pairing.between[picture]
            out[picture] = between_poses(matrices[index], matrices[second], share)
    return out


def _nothing(pictures: Sequence[str], poses: Sequence[RawPose]) -> str:
    message = f"{len(pictures)} pictures and {len(poses)} poses, and nothing shows which belong"
    example = f"(such as {pictures[0]} and {poses[0].name or poses[0].number or poses[0].where})"
    timed = any(pose.time_s is not None or (pose.number or 0) > 1e8 for pose in poses)
    if timed:
        return (
            f"{message} together {example}: no pose is near enough in time to any picture. Say"
            " --time-bound SECONDS if their clocks allow more, or name the pictures in the pose"
            " file"
        )
    return (
        f"{message} together {example}. Remove the ones without a partner, or number both, or name"
        " the picture of each pose in the pose file"
    )
