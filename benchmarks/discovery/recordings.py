"""Concealed recordings: 20 to 35 frames as real cells log them, seeds fixed."""

from __future__ import annotations

import zlib
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.discovery.faults import FAULTS, Fault
from benchmarks.discovery.physics import Physics
from benchmarks.discovery.world import (
    BOARDS,
    CAMERAS,
    Array,
    Cell,
    State,
    links,
    make_cell,
    plan,
    rigid,
)

HELD_OUT = 10
NOISES = ("white", "grows with defocus", "correlated", "heavy tails")


@dataclass(frozen=True)
class Concealed:
    """A recording, and what is true of it.

    Attributes
    ----------
    cell, physics, fault:
        What made it; physics are (what, size) pairs.
    log:
        Columns over all frames, those to predict included, as they were logged.
    pixels:
        (N, M, 2) corners with their noise; `true_pixels` without, at the poses of the log.
    ahead:
        (N,) frames to predict.
    from_frame:
        Where the fault starts, among the recorded frames.
    noise:
        Which kind.
    """

    cell: Cell
    physics: tuple[tuple[Physics, float], ...]
    fault: Fault | None
    log: dict[str, Array]
    pixels: Array
    true_pixels: Array
    ahead: Array
    from_frame: int | None
    noise: str
    sigma_px: float


def conceal(
    name: str,
    physics: tuple[tuple[Physics, float], ...] = (),
    fault: str | None = None,
    *,
    background: bool | None = None,
) -> Concealed:
    """Make the recording of that name; the name is its seed."""
    rng = np.random.default_rng(zlib.crc32(name.encode()))
    cell = make_cell(rng, background=bool(rng.random() < 0.3) if background is None else background)
    n = int(rng.integers(20, 36)) + HELD_OUT
    joints = plan(cell, n, rng)
    log = _log(cell, joints, rng)
    clean = state(cell, joints, log, physics)
    shown = state(cell, joints, log, physics)
    shown.tool = np.concatenate([rng.normal(0, 2e-5, (n, 3)), rng.normal(0, 5e-5, (n, 3))], axis=1)
    chosen = None if fault is None else next(f for f in FAULTS if f.key == fault)
    knocked = None
    if chosen is not None and chosen.knocks is not None:
        knocked = chosen.spoil(log, rng)
        knock = np.concatenate([rng.normal(0, size, 3) for size in chosen.knocks])
        for which in (clean, shown):
            which.base[knocked:] += knock
    noise = str(rng.choice(NOISES))
    sigma = float(rng.uniform(0.06, 0.2))
    pixels = shown.pixels() + _corner_noise(noise, sigma, shown, rng)
    ahead = np.zeros(n, dtype=bool)
    ahead[rng.choice(n, HELD_OUT, replace=False)] = True
    first, true = None, clean.pixels()
    if knocked is not None:
        first = int(np.flatnonzero(~ahead & (log["frame"] >= knocked)).min())
    elif chosen is not None:
        pixels, true, first = _spoilt(chosen, cell, log, (pixels, true), ahead, rng)
    return Concealed(cell, physics, chosen, log, pixels, true, ahead, first, noise, sigma)


def state(
    cell: Cell, joints: Array, log: dict[str, Array], physics: tuple[tuple[Physics, float], ...]
) -> State:
    """The cell with its physics in it."""
    found = cell.state(joints, log)
    for what, size in physics:
        what.act(found, size)
    return found


def _log(cell: Cell, joints: Array, rng: np.random.Generator) -> dict[str, Array]:
    """What the controller writes: joints to 0.01 degrees, poses to 0.1 mm and 0.01 degrees."""
    n = len(joints)
    rounded = np.radians(np.round(np.degrees(joints), 2))
    poses = links(cell.arm, joints)[-1]
    turn = Rotation.from_matrix(poses[:, :3, :3]).as_rotvec()
    logged = rigid(
        np.concatenate(
            [np.round(poses[:, :3, 3], 4), np.radians(np.round(np.degrees(turn), 2))], axis=1
        )
    )
    distance = cell.state(joints, {}).distance()
    t_s = np.cumsum(rng.uniform(8.0, 25.0, n))
    return {
        "frame": np.arange(n, dtype=float),
        "frames": np.full(n, float(n)),
        "joints": rounded,
        "poses": logged,
        "t_s": t_s,
        "temperature_c": 22.0 + 10.0 * (1.0 - np.exp(-t_s / 400.0)) + rng.normal(0, 0.1, n),
        "exposure_s": rng.choice([0.004, 0.008, 0.012, 0.02], n),
        "gain_db": rng.choice([0.0, 3.0, 6.0], n),
        "dwell_s": rng.uniform(0.5, 15.0, n),
        "clamp_N": rng.choice([20.0, 60.0], n) + rng.normal(0, 1.0, n),
        "focus_step": np.diff(distance, prepend=distance[0] - 0.1),
    }


def _corner_noise(kind: str, sigma: float, shown: State, rng: np.random.Generator) -> Array:
    n, m = shown.points.shape[:2]
    white = rng.normal(0, sigma, (n, m, 2))
    if kind == "grows with defocus":
        away = np.abs(1.0 / shown.distance() - 2.0)
        return np.asarray(white * (0.6 + 0.7 * away)[:, None, None])
    if kind == "correlated":
        flat = shown.points[0, :, :2] / np.abs(shown.points[0, :, :2]).max()
        waves = np.concatenate([np.cos(3 * flat), np.sin(4 * flat)], axis=1)
        shared = waves @ rng.normal(0, 0.35 * sigma, (n, waves.shape[1], 2))
        return np.asarray(0.8 * white + shared)
    if kind == "heavy tails":
        return np.asarray(sigma * rng.standard_t(4, (n, m, 2)) / np.sqrt(2.0))
    return np.asarray(white)


def _spoilt(
    fault: Fault,
    cell: Cell,
    log: dict[str, Array],
    shown: tuple[Array, Array],
    ahead: Array,
    rng: np.random.Generator,
) -> tuple[Array, Array, int | None]:
    """Spoil what the fault spoils: a whole log, or the recorded frames alone."""
    rows, cols, _ = BOARDS[cell.board]
    given = {
        "width": np.array([CAMERAS[cell.camera]["width"]]),
        "middle": cell.centre,
        "arm": np.array([cell.arm]),
        "grid": np.array([rows, cols]),
    }
    columns = {"frame": log["frame"], "poses": log["poses"], "joints": log["joints"]}
    columns |= {"pixels": shown[0], "true": shown[1]}
    seed = int(rng.integers(2**31))
    spoilt = {name: column.copy() for name, column in columns.items()} | given
    first = fault.spoil(spoilt, np.random.default_rng(seed))
    here = np.flatnonzero(~ahead)
    if first is None or fault.stays:
        log["poses"], log["joints"] = spoilt["poses"], spoilt["joints"]
        starts = None if first is None else int(here[here >= first].min())
        return spoilt["pixels"], spoilt["true"], starts
    part = {name: column[here] for name, column in columns.items()} | given
    first = fault.spoil(part, np.random.default_rng(seed))
    log["poses"][here], log["joints"][here] = part["poses"], part["joints"]
    pixels = shown[0].copy()
    pixels[here] = part["pixels"]
    return pixels, shown[1], None if first is None else int(here[first])
