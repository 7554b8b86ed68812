"""What a run does to its own log: each fault spoils a recording in one of the ways of the field."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.discovery.world import Array, inverse, links, rigid

Log = dict[str, Array]
"""Changed in place: `poses` (N, 4, 4), `joints` (N, 6), `pixels`, `true` (N, M, 2), `frame` (N,).

`width` is the picture's, `middle` the principal point, `arm` the model, `grid` rows and columns.
"""


@dataclass(frozen=True)
class Fault:
    """One way to spoil a log.

    `spoil` gives where it starts, None for the whole run. `names` are right in `effects`, none of
    them where frames must be left out and nothing else found. With `stays` the cell is another
    one from that frame on, for frames to be predicted, too; else rows of the recording are spoilt.
    With `knocks` the base stands elsewhere from then on (usual sizes, m and rad).
    """

    key: str
    spoil: Callable[[Log, np.random.Generator], int | None]
    names: tuple[str, ...]
    stays: bool = False
    knocks: tuple[float, float] | None = None


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


def _late_for_a_while(log: Log, rng: np.random.Generator) -> int:
    first = int(rng.integers(4, len(log["frame"]) - 12))
    rows = np.arange(len(log["frame"]))
    rows[first : first + 7] -= 1
    _rows(log, rows, "poses", "joints")
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


def _midway(log: Log, rng: np.random.Generator) -> int:
    return int(rng.integers(10, len(log["frame"]) - 10))


def _tool(log: Log, rng: np.random.Generator) -> int:
    first = _midway(log, rng)
    step = rigid(np.array([*rng.normal(0, 0.05, 2), 0.12, *rng.normal(0, 0.2, 3)]))
    log["poses"][first:] = log["poses"][first:] @ step
    return first


def _small_tool(log: Log, rng: np.random.Generator) -> int:
    first = _midway(log, rng)
    step = rigid(np.array([*rng.normal(0, 1e-3, 2), 5e-3, 0.0, 0.0, 0.0]))
    log["poses"][first:] = log["poses"][first:] @ step
    return first


def _user_frame(log: Log, rng: np.random.Generator) -> int:
    first = _midway(log, rng)
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


def _transposed(log: Log, rng: np.random.Generator) -> None:
    log["pixels"] = log["pixels"][..., ::-1].copy()


def _by_columns(log: Log, rng: np.random.Generator) -> None:
    rows, cols = (int(k) for k in log["grid"])
    place = np.arange(rows * cols).reshape(rows, cols).T.ravel()
    log["pixels"] = log["pixels"][:, place]


def _renumbered(log: Log, rng: np.random.Generator) -> int:
    at = sorted(int(v) for v in rng.choice(len(log["frame"]), 2, replace=False))
    log["pixels"][at] = log["pixels"][at, ::-1]
    return at[0]


def _pictured(log: Log, first: int, scale: float, shift: Array) -> int:
    """Pictures from there on scaled about the principal point, and shifted."""
    for column in ("pixels", "true"):
        log[column][first:] = log["middle"] + scale * (log[column][first:] - log["middle"]) + shift
    return first


def _binned(log: Log, rng: np.random.Generator) -> int:
    shift = -0.5 * log["middle"] - 0.25
    return _pictured(log, _midway(log, rng), 0.5, shift)


def _region(log: Log, rng: np.random.Generator) -> int:
    return _pictured(log, _midway(log, rng), 1.0, -log["width"][0] * np.array([0.06, 0.04]))


def _ring(log: Log, rng: np.random.Generator) -> int:
    scale = 1.0 + rng.choice([-1, 1]) * rng.uniform(0.002, 0.008)
    return _pictured(log, _midway(log, rng), scale, rng.normal(0, 1e-3, 2) * log["width"][0])


def _rebooted(log: Log, rng: np.random.Generator) -> int:
    """The lens's drive finds its zero elsewhere, and the stabiliser its middle."""
    scale = 1.0 + rng.choice([-1, 1]) * rng.uniform(0.001, 0.003)
    return _pictured(log, _midway(log, rng), scale, rng.normal(0, 4e-3, 2) * log["width"][0])


def _smeared(log: Log, rng: np.random.Generator) -> int:
    """Someone walks through the light: a run of pictures whose corners are read wrongly."""
    first = int(rng.integers(4, len(log["frame"]) - 10))
    wrong = rng.normal(0, 0.006 * log["width"][0], log["pixels"][first : first + 5].shape)
    log["pixels"][first : first + 5] += wrong
    return first


def _elsewhere(log: Log, rng: np.random.Generator) -> int:
    """The arm was led by hand for a while, and its poses are of no picture."""
    first = int(rng.integers(4, len(log["frame"]) - 10))
    for row in range(first, first + 5):
        away = np.concatenate([rng.normal(0, 0.03, 3), rng.normal(0, 0.05, 3)])
        log["poses"][row] = log["poses"][row] @ rigid(away)
        log["joints"][row] += rng.normal(0, 0.05, 6)
    return first


def _other_arm(log: Log, rng: np.random.Generator) -> None:
    log["poses"] = links({"ur3e": "ur5e"}.get(str(log["arm"][0]), "ur3e"), log["joints"])[-1]


FAULTS = (
    Fault("stale pictures for a while", _stale_run, ("stale_pictures",)),
    Fault("one picture twice", _twice, ("stale_pictures",)),
    Fault("offset from a frame on", _offset_from, ("frame_pose_offset", "stale_pictures")),
    Fault("poses late for a while", _late_for_a_while, ("frame_pose_offset", "stale_poses",
          "stale_pictures")),
    Fault("two frames exchanged", _swap, ("frame_pose_swap",)),
    Fault("pose froze", _frozen, ("stale_poses", "stale_pictures")),
    Fault("tool frame set midway", _tool, ("tool_frame_step", "mount_slip"), True),
    Fault("TCP changed by 5 mm", _small_tool, ("tool_frame_step", "mount_slip"), True),
    Fault("user frame set midway", _user_frame, ("base_frame_step", "board_slip"), True),
    Fault("base knocked", _midway, ("base_frame_step", "board_slip"), True, (1.5e-3, 1e-3)),
    Fault("joints in degrees", _degrees, ("angle_unit",)),
    Fault("a joint's sign", _sign, ("joint_sign",)),
    Fault("Euler order", _euler, ("rotation_convention",)),
    Fault("quaternion w x y z", _scalar_first, ("rotation_convention",)),
    Fault("poses inverted", _inverted, ("rotation_convention",)),
    Fault("millimetres", _millimetres, ("length_unit",)),
    Fault("one pose in millimetres", _one_in_millimetres, ("length_unit",)),
    Fault("pictures mirrored", _mirrored, ("mirrored_pictures",)),
    Fault("pictures' rows and columns exchanged", _transposed, ("mirrored_pictures",)),
    Fault("corners listed by columns", _by_columns, ("corner_order",)),
    Fault("corners from the other end", _renumbered, ("corner_order",)),
    Fault("binning midway", _binned, ("optics_step",), True),
    Fault("region midway", _region, ("optics_step",), True),
    Fault("focus ring bumped midway", _ring, ("optics_step",), True),
    Fault("camera rebooted", _rebooted, ("optics_step",), True),
    Fault("poses of another arm", _other_arm, ("robot_model",)),
    Fault("corners read wrongly for a while", _smeared, ()),
    Fault("arm led by hand for a while", _elsewhere, ()),
)  # fmt: skip
