"""What a run does to its own log: each fault spoils a recording in one of the ways of the field."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.discovery.world import Array, inverse, links, rigid

Log = dict[str, Array]
"""`poses` (N, 4, 4), `joints` (N, 6), `pixels` (N, M, 2), `frame` (N,); changed in place."""


@dataclass(frozen=True)
class Fault:
    """One way to spoil a log.

    `names` are right in `effects`; `from_frame` is where it starts, None for the whole run.
    """

    key: str
    spoil: Callable[[Log, np.random.Generator], int | None]
    names: tuple[str, ...]


def _rows(log: Log, rows: Array, *columns: str) -> None:
    for column in columns:
        log[column] = log[column][rows.astype(int)]


def _stale_run(log: Log, rng: np.random.Generator) -> int:
    first = int(rng.integers(4, len(log["frame"]) - 12))
    rows = np.arange(len(log["frame"]))
    rows[first : first + 8] -= 1
    _rows(log, rows, "pixels")
    return first


def _twice(log: Log, rng: np.random.Generator) -> int:
    at = int(rng.integers(4, len(log["frame"]) - 4))
    rows = np.arange(len(log["frame"]))
    rows[at] -= 1
    _rows(log, rows, "pixels")
    return at


def _offset_from(log: Log, rng: np.random.Generator) -> int:
    first = len(log["frame"]) - int(rng.integers(5, 10))
    rows = np.arange(len(log["frame"]))
    rows[first:-1] += 1
    _rows(log, rows, "pixels")
    return first


def _swap(log: Log, rng: np.random.Generator) -> int:
    a, b = sorted(int(v) for v in rng.choice(len(log["frame"]), 2, replace=False))
    rows = np.arange(len(log["frame"]))
    rows[[a, b]] = rows[[b, a]]
    _rows(log, rows, "poses", "joints")
    return a


def _frozen(log: Log, rng: np.random.Generator) -> int:
    first = int(rng.integers(5, len(log["frame"]) - 10))
    rows = np.arange(len(log["frame"]))
    rows[first : first + 6] = first - 1
    _rows(log, rows, "poses", "joints")
    return first


def _tool(log: Log, rng: np.random.Generator) -> int:
    first = int(rng.integers(8, len(log["frame"]) - 8))
    step = rigid(np.array([*rng.normal(0, 0.05, 2), 0.12, *rng.normal(0, 0.2, 3)]))
    log["poses"][first:] = log["poses"][first:] @ step
    return first


def _user_frame(log: Log, rng: np.random.Generator) -> int:
    first = int(rng.integers(8, len(log["frame"]) - 8))
    step = rigid(np.array([*rng.normal(0, 0.2, 3), 0.0, 0.0, rng.normal(0, 0.5)]))
    log["poses"][first:] = step @ log["poses"][first:]
    return first


def _degrees(log: Log, rng: np.random.Generator) -> None:
    log["joints"] = np.degrees(log["joints"])


def _sign(log: Log, rng: np.random.Generator) -> None:
    log["joints"][:, int(rng.integers(0, 6))] *= -1


def _turned(log: Log, turn: Callable[[Rotation], Rotation]) -> None:
    rotation = Rotation.from_matrix(log["poses"][:, :3, :3])
    log["poses"][:, :3, :3] = turn(rotation).as_matrix()


def _euler(log: Log, rng: np.random.Generator) -> None:
    _turned(log, lambda r: Rotation.from_euler("xyz", r.as_euler("ZYX")))


def _scalar_first(log: Log, rng: np.random.Generator) -> None:
    _turned(log, lambda r: Rotation.from_quat(r.as_quat(scalar_first=True)))


def _inverted(log: Log, rng: np.random.Generator) -> None:
    log["poses"] = inverse(log["poses"])


def _millimetres(log: Log, rng: np.random.Generator) -> None:
    log["poses"][:, :3, 3] *= 1e3


def _one_in_millimetres(log: Log, rng: np.random.Generator) -> int:
    at = int(rng.integers(0, len(log["frame"])))
    log["poses"][at, :3, 3] *= 1e3
    return at


def _mirrored(log: Log, rng: np.random.Generator) -> None:
    log["pixels"][..., 0] = log["width"][0] - 1 - log["pixels"][..., 0]


def _renumbered(log: Log, rng: np.random.Generator) -> int:
    at = sorted(int(v) for v in rng.choice(len(log["frame"]), 2, replace=False))
    log["pixels"][at] = log["pixels"][at, ::-1]
    return at[0]


def _binned(log: Log, rng: np.random.Generator) -> int:
    first = int(rng.integers(8, len(log["frame"]) - 8))
    log["pixels"][first:] = (log["pixels"][first:] + 0.5) / 2 - 0.5
    return first


def _region(log: Log, rng: np.random.Generator) -> int:
    first = int(rng.integers(8, len(log["frame"]) - 8))
    log["pixels"][first:] -= log["width"][0] * np.array([0.06, 0.04])
    return first


def _other_arm(log: Log, rng: np.random.Generator) -> None:
    log["poses"] = links({"ur3e": "ur5e"}.get(str(log["arm"][0]), "ur3e"), log["joints"])[-1]


FAULTS = (
    Fault("stale pictures for a while", _stale_run, ("stale_pictures",)),
    Fault("one picture twice", _twice, ("stale_pictures",)),
    Fault("offset from a frame on", _offset_from, ("frame_pose_offset", "stale_pictures")),
    Fault("two frames exchanged", _swap, ("frame_pose_swap",)),
    Fault("pose froze", _frozen, ("stale_poses", "stale_pictures")),
    Fault("tool frame set midway", _tool, ("tool_frame_step", "mount_slip")),
    Fault("user frame set midway", _user_frame, ("base_frame_step", "board_slip")),
    Fault("joints in degrees", _degrees, ("angle_unit",)),
    Fault("a joint's sign", _sign, ("joint_sign",)),
    Fault("Euler order", _euler, ("rotation_convention",)),
    Fault("quaternion w x y z", _scalar_first, ("rotation_convention",)),
    Fault("poses inverted", _inverted, ("rotation_convention",)),
    Fault("millimetres", _millimetres, ("length_unit",)),
    Fault("one pose in millimetres", _one_in_millimetres, ("length_unit",)),
    Fault("pictures mirrored", _mirrored, ("mirrored_pictures",)),
    Fault("corners from the other end", _renumbered, ("corner_order",)),
    Fault("binning midway", _binned, ("optics_step",)),
    Fault("region midway", _region, ("optics_step",)),
    Fault("poses of another arm", _other_arm, ("robot_model",)),
)
