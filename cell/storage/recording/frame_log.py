"""Reading `frames.jsonl`: one bad frame is one rejected frame, with its number and the reason."""

from __future__ import annotations

import json
import logging
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from cell.errors import InputError
from cell.storage.files.yaml_model import plain
from cell.storage.incoming import check_values, read_bytes
from cell.storage.incoming.limits import FRAME_NUMBER, LINE_CHARACTERS, LOG_BYTES
from cell.storage.recording.frames import FrameRecord

VECTORS = ("joints_rad", "joint_velocity_rad_s", "approach_joints_rad")
_OTHER_UNIT = 100.0
"""So many times the others' distance from the base, and a pose is in another unit than they are."""
_SHOWN_AT_MOST = 5

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class FrameLog:
    """The frames of a recording.

    Attributes
    ----------
    frames:
        All of them in their order; of a rejected one, its number and its picture's name alone.
    rejected:
        Frame number to what is wrong with it: file, line, key and value.
    """

    frames: tuple[FrameRecord, ...]
    rejected: Mapping[int, str] = field(default_factory=dict)


def read_frames(path: Path) -> FrameLog:
    """Read a `frames.jsonl`.

    A last line that is cut off is what a crash leaves: it is dropped with a warning. A frame whose
    values cannot be used (not finite, no unit quaternion, a pose in millimetres among metres) is
    rejected with a warning, and the others are used.

    Raises
    ------
    InputError
        The file cannot be read, a line before the last is no frame at all, two lines carry the
        same frame number, or no frame can be used; the message names file and line.
    """
    frames: dict[int, FrameRecord] = {}
    lines: dict[int, int] = {}
    rejected: dict[int, str] = {}
    for number, data in _numbered(path):
        frame = _number_of(path, number, data)
        if frame in frames:
            raise InputError(f"{path}:{number}: frame {frame} stands in the file twice")
        lines[frame] = number
        try:
            check_values(data, f"{path}:{number}: frame {frame}")
            frames[frame] = _record(f"{path}:{number}: frame {frame}", data)
        except InputError as fault:
            frames[frame], rejected[frame] = _bare(frame, data), str(fault)
    for frame, why in _implausible(tuple(frames.values())).items():
        rejected[frame] = f"{path}:{lines[frame]}: frame {frame}: {why}"
        frames[frame] = FrameRecord(frame=frame, image=frames[frame].image)
    _warn_of_rejected(path, len(frames), rejected)
    return FrameLog(tuple(frames.values()), rejected)


def _warn_of_rejected(path: Path, frames: int, rejected: Mapping[int, str]) -> None:
    reasons = [line for why in rejected.values() for line in why.splitlines()]
    if rejected and len(rejected) == frames:
        more = len(reasons) - _SHOWN_AT_MOST
        shown = reasons[:_SHOWN_AT_MOST] + ([f"{path}: and {more} more"] if more > 0 else [])
        raise InputError("\n".join(shown))
    for line in reasons:
        log.warning("%s; the frame is left out", line)


def _numbered(path: Path) -> list[tuple[int, dict[str, Any]]]:
    """Line numbers, and the objects that stand there."""
    lines = read_bytes(path, LOG_BYTES).split(b"\n")
    numbered = [(number, line) for number, line in enumerate(lines, 1) if line.strip(b" \r\t\0")]
    last = numbered[-1][0] if numbered else 0
    parsed = (
        (number, _parse(path, number, line, last=number == last)) for number, line in numbered
    )
    return [(number, data) for number, data in parsed if data is not None]


def _parse(path: Path, number: int, line: bytes, *, last: bool) -> dict[str, Any] | None:
    try:
        if len(line) > LINE_CHARACTERS:
            raise ValueError(f"the line has {len(line)} characters")
        data = json.loads(line)
        if not isinstance(data, dict):
            raise ValueError(f"a line must be one object {{...}}, not {type(data).__name__}")
    except (ValueError, RecursionError) as broken:
        if last:
            log.warning("%s:%d: the last line is cut off (a crash?); it is left out", path, number)
            return None
        raise InputError(
            f"{path}:{number}: is not a frame: {broken}. Mend or delete this line."
        ) from None
    return data


def _number_of(path: Path, number: int, data: Mapping[str, Any]) -> int:
    where = f"{path}:{number}: frame without a number"
    if "frame" not in data:
        raise InputError(f"{where}: frame is missing")
    frame = data["frame"]
    if isinstance(frame, bool) or not isinstance(frame, int) or not 0 <= frame <= FRAME_NUMBER:
        shown = repr(frame)[:60]
        raise InputError(f"{where}: frame must be a whole number from 0 to 2^53 (got {shown})")
    return frame


def _record(where: str, data: dict[str, Any]) -> FrameRecord:
    try:
        return FrameRecord.model_validate(data)
    except ValidationError as invalid:
        faults = [_fault(error) for error in invalid.errors()]
        raise InputError("\n".join(f"{where}: {fault}" for fault in faults)) from None


def _fault(error: Any) -> str:
    name = ".".join(str(part) for part in error["loc"])
    if error["type"] == "missing":
        return f"{name} is missing"
    message = error["msg"].removeprefix("Value error, ")
    return f"{name}: {message} (got {repr(plain(error['input']))[:60]})"


def _bare(frame: int, data: Mapping[str, Any]) -> FrameRecord:
    image = data.get("image")
    return FrameRecord(frame=frame, image=image if isinstance(image, str) else None)


def _implausible(frames: Sequence[FrameRecord]) -> dict[int, str]:
    """Frames that cannot be of the same arm as most, with the reason."""
    return _other_joint_count(frames) | _other_unit(frames)


def _other_joint_count(frames: Sequence[FrameRecord]) -> dict[int, str]:
    counts = {f.frame: n for f in frames for n in _joint_counts(f)}
    usual = Counter(counts.values()).most_common(1)
    if not usual or 2 * usual[0][1] <= len(counts):
        return {}
    most = usual[0][0]
    odd = {f.frame: [n for n in _joint_counts(f) if n != most] for f in frames}
    return {
        frame: f"has {few[0]} joint values where the other frames have {most}"
        for frame, few in odd.items()
        if few
    }


def _joint_counts(frame: FrameRecord) -> list[int]:
    return [len(v) for name in VECTORS if (v := getattr(frame, name)) is not None]


def _other_unit(frames: Sequence[FrameRecord]) -> dict[int, str]:
    posed = [f for f in frames if f.base_from_flange is not None]
    away_m = {
        f.frame: float(np.linalg.norm(f.base_from_flange.p_m)) for f in posed if f.base_from_flange
    }
    usual_m = float(np.median(list(away_m.values()))) if away_m else 0.0
    return {
        frame: f"base_from_flange.p_m is {m:.4g} m away from the base where the others are"
        f" {usual_m:.3g} m away: is it in millimetres?"
        for frame, m in away_m.items()
        if usual_m and m > _OTHER_UNIT * usual_m
    }
