"""What a wrong pairing of pictures and poses is called, and how it is mended."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from itertools import groupby

import numpy as np

from calib.discovery.log_consistency.mixup import Mixup
from calib.discovery.log_consistency.trusted import rows_from, shifted
from calib.views import Views

Sources = Mapping[int, int]
"""Frame to the frame whose pose its picture is of."""

_EVERY = 0.8
"""An offset of so many of the frames is one of the whole log."""

_SHORTEST_RUN = 3
_CHECK = "Check when pose and picture are read; pair them by trigger, not by count."


def mispaired(views: Views, sources: Sources, miss: tuple[float, float]) -> tuple[Mixup, ...]:
    """Name what `sources` shows.

    Parameters
    ----------
    views:
        The frames whose pose is known, in the order of the recording.
    sources:
        Of those that are not paired rightly.
    miss:
        What frames rightly paired miss the loop by, radians and metres.
    """
    if not sources:
        return ()
    shift, count = Counter(to - frame for frame, to in sources.items()).most_common(1)[0]
    if count > _EVERY * len(views):
        return (_offset_of_all(shift, miss),)
    swapped = _in_cycles(sources)
    rest = {frame: to for frame, to in sources.items() if frame not in swapped}
    found = [_swap(swapped, miss)] if swapped else []
    found += [_shifted_run(views, rest, miss)] if rest else []
    return tuple(found)


def _offset_of_all(shift: int, miss: tuple[float, float]) -> Mixup:
    def mend(some: Views, neighbours: Views) -> Views:
        return shifted(some, neighbours, shift)

    return Mixup(
        name="frame_pose_offset",
        physics=f"Every picture is paired with the pose logged {shift:+d} frames from its own.",
        remedy=_CHECK,
        mend=mend,
        parameters={"frames": (float(shift), "frame")},
        evidence=(miss, miss),
    )


def _in_cycles(sources: Sources) -> Sources:
    """The frames that carry each other's poses: every pose among them is some frame's of them."""
    left = dict(sources)
    while True:
        kept = {f: to for f, to in left.items() if to in left and f in left.values()}
        if len(kept) == len(left):
            return left if len(set(left.values())) == len(left) else {}
        left = kept


def _swap(sources: Sources, miss: tuple[float, float]) -> Mixup:
    pairs = ", ".join(f"{a} carries the pose of {b}" for a, b in sorted(_carried(sources)))
    return Mixup(
        name="frame_pose_swap",
        physics=f"Some frames carry each other's poses: {pairs}.",
        remedy="Check how pictures and poses are matched; these frames were put right in the twin.",
        mend=_mending(sources),
        parameters={"frames": (float(len(sources)), "frame")},
        evidence=(miss, miss),
    )


def _carried(sources: Sources) -> list[tuple[int, int]]:
    """Frame and the frame whose pose its row carries."""
    return [(to, frame) for frame, to in sources.items()]


def _shifted_run(views: Views, sources: Sources, miss: tuple[float, float]) -> Mixup:
    """Pictures that are late, or ahead, or the same twice."""
    frames = sorted(sources)
    twice = _twice(views, sources)
    stale = twice or any(to < frame for frame, to in sources.items())
    parameters = {
        "from_frame": (float(frames[0]), "frame"),
        "to_frame": (float(frames[-1]), "frame"),
        "frames": (float(len(frames)), "frame"),
    }
    text = _described(sources, {int(frame): k for k, frame in enumerate(views.frame)})
    if twice:
        text += "; " + ", ".join(f"pose {pose} was taken twice" for pose in twice)
    return Mixup(
        name="stale_pictures" if stale else "frame_pose_offset",
        physics=f"Some pictures are of another frame's pose: {text}.",
        remedy=_CHECK,
        mend=_mending(sources),
        parameters=parameters,
        evidence=(miss, miss),
    )


def _twice(views: Views, sources: Sources) -> list[int]:
    """Poses of which there are several pictures."""
    count = Counter(sources.get(int(frame), int(frame)) for frame in views.frame)
    return sorted(pose for pose, times in count.items() if times > 1)


def _described(sources: Sources, place: Mapping[int, int]) -> str:
    """Runs of the same shift, counted in recorded frames, in one clause; the others one by one."""

    def shift(frame: int) -> int | None:
        to = sources[frame]
        return place[to] - place[frame] if to in place else None

    clauses = []
    for by, group in groupby(sorted(sources), key=shift):
        run = list(group)
        if by is not None and len(run) >= _SHORTEST_RUN:
            how = f"{abs(by)} recorded frame{'s' * (abs(by) > 1)} {'before' if by < 0 else 'after'}"
            clauses.append(f"from frame {run[0]} to {run[-1]} each is of the pose {how} its own")
        else:
            clauses += [f"picture {f} is of pose {sources[f]}" for f in run]
    return ", ".join(clauses)


def _mending(sources: Sources) -> Callable[[Views, Views], Views]:
    def mend(some: Views, neighbours: Views) -> Views:
        where = {int(frame): k for k, frame in enumerate(neighbours.frame)}
        rows = [where.get(sources.get(int(f), int(f)), np.nan) for f in some.frame]
        return rows_from(some, neighbours, np.array(rows, dtype=np.float64))

    return mend
