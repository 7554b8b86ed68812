"""The tree of frames that a bag's transforms make, and the way from one frame to another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from calib.chain.rigid import inverse
from calib.views import FloatArray
from cell.errors import InputError
from cell.verbs.importing.bags.tracks import Track, away_s, sorted_once

_BASES = ("base", "base_link")
_FLANGES = ("tool0", "flange")
_SHOWN = 40


@dataclass
class Transforms:
    """What was published, edge by edge: parent_from_child by (parent, child)."""

    still: dict[tuple[str, str], FloatArray] = field(default_factory=dict)
    moving: dict[tuple[str, str], list[tuple[float, FloatArray]]] = field(default_factory=dict)

    def add(self, stamped: Any, time_s: float, *, still: bool) -> None:
        """Take one TransformStamped; raises `InputError` where it is no transform."""
        edge = (_name(stamped.header.frame_id), _name(stamped.child_frame_id))
        numbers = _numbers(edge, stamped.transform.translation, stamped.transform.rotation)
        if still:
            self.still[edge] = numbers
        else:
            self.moving.setdefault(edge, []).append((time_s, numbers))

    def add_pose(self, stamped: Any, topic: str, time_s: float) -> None:
        """Take one PoseStamped of a topic, whose name is the frame that has this pose."""
        edge = (_name(stamped.header.frame_id) or _BASES[0], topic)
        numbers = _numbers(edge, stamped.pose.position, stamped.pose.orientation)
        self.moving.setdefault(edge, []).append((time_s, numbers))

    def parents(self, child: str) -> list[str]:
        """Frames in which a frame's pose was published."""
        return sorted(parent for parent, below in (*self.still, *self.moving) if below == child)

    @property
    def frames(self) -> list[str]:
        """Names of all frames."""
        return sorted({name for edge in (*self.still, *self.moving) for name in edge})

    def track(self, edge: tuple[str, str]) -> Track:
        """parent_from_child over time."""
        if edge in self.still:
            return Track(np.empty(0), _matrices(self.still[edge][None]))
        samples = self.moving[edge]
        times, numbers = sorted_once(
            np.array([time for time, _ in samples]), np.array([n for _, n in samples])
        )
        return Track(times, _matrices(numbers))


def _numbers(edge: tuple[str, str], place: Any, turn: Any) -> FloatArray:
    """(7,) position in metres and quaternion, scalar last."""
    numbers = np.array([place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w])
    length = float(np.linalg.norm(numbers[3:]))
    if not np.isfinite(numbers).all() or not 0.9 < length < 1.1:
        raise InputError(f"the transform from {edge[0]} to {edge[1]} is no pose: {numbers}")
    return numbers


def _name(frame: str) -> str:
    return str(frame).strip("/")


def _matrices(numbers: FloatArray) -> FloatArray:
    out = np.tile(np.eye(4), (len(numbers), 1, 1))
    out[:, :3, :3] = Rotation.from_quat(numbers[:, 3:]).as_matrix()
    out[:, :3, 3] = numbers[:, :3]
    return out


@dataclass(frozen=True)
class Way:
    """base_from_flange by way of the frames between them.

    Attributes
    ----------
    base, flange:
        Their names.
    up, down:
        Tracks from the base up to the frame above both, and from there down to the flange.
    """

    base: str
    flange: str
    up: tuple[Track, ...]
    down: tuple[Track, ...]

    def at(self, times_s: FloatArray) -> FloatArray:
        """(N, 4, 4) base_from_flange."""
        out = np.tile(np.eye(4), (len(times_s), 1, 1))
        for track in self.up:
            out = out @ inverse(track.at(times_s))
        for track in self.down:
            out = out @ track.at(times_s)
        return np.asarray(out)

    def away_s(self, times_s: FloatArray) -> FloatArray:
        """(N,) how far the farthest sample that takes part is in time."""
        of = [away_s(track.times_s, times_s) for track in (*self.up, *self.down)]
        return np.max(of, axis=0) if of else np.zeros(len(times_s))

    @property
    def samples_s(self) -> FloatArray:
        """Times at which anything on the way was measured."""
        tracks = (*self.up, *self.down)
        return np.unique(np.concatenate([np.empty(0), *(track.times_s for track in tracks)]))


def way_between(found: Transforms, base: str | None, flange: str | None) -> Way | None:
    """The way between the frames named, else between those usually called so; None without.

    Raises
    ------
    InputError
        A frame that is named is not there, or no transforms lead from one to the other.
    """
    names = found.frames
    for option, stated in (("--base", base), ("--flange", flange)):
        if stated is not None and names and stated not in names:
            shown = ", ".join(names[:_SHOWN])
            raise InputError(f"{option} {stated}: is no frame of the bag's transforms: {shown}")
    starts = [base] if base else [name for name in _BASES if name in names]
    ends = [flange] if flange else [name for name in _FLANGES if name in names]
    for start in starts:
        for end in ends:
            way = _way(found, start, end)
            if way is not None and len(way.samples_s):
                return way
    if base and flange and names:
        raise InputError(f"no transforms of the bag lead from {base} to {flange}")
    return None


def way_of_topic(found: Transforms, topic: str, base: str | None) -> Way:
    """The way that a topic of poses is, from the frame that they are in unless one is named.

    Raises
    ------
    InputError
        The topic's poses are in several frames, or nothing leads to them from the one named.
    """
    parents = found.parents(topic)
    if len(parents) != 1:
        raise InputError(
            f"{topic}: its poses are in several frames ({', '.join(parents)}); record or filter"
            " them so that they are in the robot's base"
        )
    way = way_between(found, base or parents[0], topic)
    assert way is not None  # one edge, or refused there
    return way


def _way(found: Transforms, base: str, flange: str) -> Way | None:
    parents = {child: parent for parent, child in (*found.still, *found.moving)}
    up_from_base, up_from_flange = _upwards(parents, base), _upwards(parents, flange)
    meeting = next((name for name in up_from_base if name in up_from_flange), None)
    if meeting is None or base == flange:
        return None

    def tracks(chain: Sequence[str]) -> list[Track]:
        below = chain[: chain.index(meeting)]
        return [found.track((parents[name], name)) for name in below]

    return Way(base, flange, tuple(tracks(up_from_base)), tuple(tracks(up_from_flange)[::-1]))


def _upwards(parents: dict[str, str], name: str) -> list[str]:
    chain = [name]
    while chain[-1] in parents and parents[chain[-1]] not in chain:
        chain.append(parents[chain[-1]])
    return chain
