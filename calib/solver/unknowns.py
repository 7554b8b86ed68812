"""Which numbers of a cell are free, and how the frames follow them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.chain import rigid
from calib.chain.effect import Parameter, Present
from calib.chain.kinematics import ArmKinematics
from calib.chain.model import EXACT, CellModel, Errors, StagedEvaluation
from calib.chain.optics import COLUMN
from calib.chain.state import ChainState
from calib.views import FloatArray, Views

_STEP_SHARE = 1e-4
_SIDES = (COLUMN["alpha_px"], COLUMN["beta_px"])
_FLANGE_STEP = 1e-5
"""Metres and radians."""
_OPTICS_TYPICAL = {"alpha_px": 10.0, "beta_px": 10.0, "u0_px": 10.0, "v0_px": 10.0, "skew_px": 5.0}
PLAIN_OPTICS = ("alpha_px", "beta_px", "u0_px", "v0_px", "k1", "k2")
"""What the plain model frees: one focal length a side, principal point, two radial terms."""


def plain_optics(optics: FloatArray) -> tuple[str, ...]:
    """What the plain model of (K,) optics frees: a wide lens has four radial terms."""
    return (*PLAIN_OPTICS, "k3", "k4") if optics[COLUMN["equidistant"]] else PLAIN_OPTICS


PRIOR_WIDTH = 10.0
"""An effect's amount has a normal prior this many times its usual size wide.

Wide enough to leave every real size alone; without it two effects that are each other's mirror
image (all lengths of the arm, the board's scale) run off together to wherever noise is cheapest.
"""


@dataclass(frozen=True)
class Unknown:
    """One free number: where it stands, its usual size, its unit, and how wide its prior is.

    `roughness` are its coefficients in combinations of its effect's amounts that have a prior, too.
    """

    name: str
    unit: str
    typical: float
    place: tuple[str, int, int]
    prior_sigma: float = np.inf
    roughness: tuple[float, ...] = ()


def _prior_sigma(parameter: Parameter) -> float:
    return parameter.prior_sigma or PRIOR_WIDTH * parameter.typical


def _free_of(present: Present, at: int) -> list[Unknown]:
    effect = present.effect
    return [
        Unknown(
            f"{effect.label}.{p.name}",
            p.unit,
            p.typical,
            ("effect", at, k),
            _prior_sigma(p) if p.role == "amount" else np.inf,
            tuple(row[k] for row in effect.roughness),
        )
        for k, p in enumerate(effect.parameters)
        if p.role != "setting" and p.identifiable and k not in present.held
    ]


def unknowns_of(
    model: CellModel, optics: tuple[str, ...] | None = None, *, poses: bool = True
) -> tuple[Unknown, ...]:
    """Every free number of a cell: optics columns, the two transforms, its effects.

    The columns are `plain_optics` where none are given.
    """
    optics = plain_optics(model.optics) if optics is None else optics
    free = [Unknown(c, "", _OPTICS_TYPICAL.get(c, 0.01), ("optics", COLUMN[c], 0)) for c in optics]
    if poses:
        for frame in ("flange_from_mounted", "base_from_fixed"):
            for k in range(6):
                unit = "m" if k < 3 else "rad"
                axis = "xyz"[k % 3] if k < 3 else "r" + "xyz"[k % 3]
                free.append(Unknown(f"{frame}.{axis}", unit, 1e-2, (frame, k, 0)))
    for at, present in enumerate(model.effects):
        free += _free_of(present, at)
    return tuple(free)


def amount_unknowns(model: CellModel, base: tuple[Unknown, ...]) -> tuple[Unknown, ...]:
    """The amounts of a model's effects that are not among `base`."""
    known = {u.place for u in base}
    return tuple(
        u
        for u in unknowns_of(model, (), poses=False)
        if u.place not in known
        and model.effects[u.place[1]].effect.parameters[u.place[2]].role == "amount"
    )


def moved(
    model: CellModel, unknowns: tuple[Unknown, ...], step: FloatArray, *, bounded: bool = True
) -> CellModel:
    """The cell after adding (p,) `step` to its free numbers; transforms move on their own side.

    `bounded` keeps effects' numbers between their lowest and highest.
    """
    optics = model.optics.copy()
    effects = list(model.effects)
    increments = {"flange_from_mounted": np.zeros(6), "base_from_fixed": np.zeros(6)}
    for unknown, amount in zip(unknowns, step, strict=True):
        kind, at, k = unknown.place
        if kind == "optics":
            optics[at] += amount
        elif kind == "effect":
            effects[at] = _nudged(effects[at], k, float(amount), bounded)
        else:
            increments[kind][at] += amount
    changed = {
        frame: getattr(model, frame) @ rigid.from_vector(increment)
        for frame, increment in increments.items()
        if increment.any()
    }
    return replace(model, optics=optics, effects=tuple(effects), **changed)


def amounts(
    model: CellModel, unknowns: tuple[Unknown, ...], about: CellModel | None = None
) -> FloatArray:
    """(p,) how far the numbers that have a prior are from its centre; zero for the others.

    Effects' priors are centred on zero. Those of optics and transforms are centred on the cell
    `about`; without one they have none.
    """
    return np.array([_amount(model, unknown, about) for unknown in unknowns])


def _amount(model: CellModel, unknown: Unknown, about: CellModel | None) -> float:
    kind, at, k = unknown.place
    if kind == "effect":
        return float(model.effects[at].values[k])
    if about is None:
        return 0.0
    if kind == "optics":
        return float(model.optics[at] - about.optics[at])
    return float(rigid.to_vector(rigid.inverse(getattr(about, kind)) @ getattr(model, kind))[at])


def prior_information(unknowns: tuple[Unknown, ...]) -> FloatArray:
    """(p, p) inverse covariance of the priors; zero where there is none."""
    information = np.diag([u.prior_sigma**-2.0 for u in unknowns])
    for effect in {u.place[1] for u in unknowns if u.roughness}:
        mine = [k for k, u in enumerate(unknowns) if u.roughness and u.place[1] == effect]
        rows = np.array([unknowns[k].roughness for k in mine])
        information[np.ix_(mine, mine)] += rows @ rows.T
    return information


def _nudged(present: Present, k: int, amount: float, bounded: bool) -> Present:
    parameter = present.effect.parameters[k]
    values = present.values.copy()
    values[k] += amount
    if bounded:
        values[k] = min(max(values[k], parameter.low), parameter.high)
    return replace(present, values=values)


@dataclass(frozen=True)
class Dependence:
    """How each frame's own quantities follow the p free numbers, to first order.

    Attributes
    ----------
    state:
        The state at the present values.
    active:
        Indices of the A optics columns that follow anything.
    modes:
        (B, M, 3) movements of the board's corners.
    local:
        (N, A + 6 + B, p).
    own:
        (N, A + 6, F) how the active optics and the pose in the camera follow the frame's own
        numbers: a small error of the flange in its own frame (a lens that focuses on the board
        follows it as well), and the focal length's where it has one.
    """

    state: ChainState
    active: tuple[int, ...]
    modes: FloatArray
    local: FloatArray
    own: FloatArray

    @property
    def pose_by_flange(self) -> FloatArray:
        """(N, 6, 6) how the pose follows the flange."""
        return self.own[:, len(self.active) :, :6]


def dependence(
    model: CellModel,
    views: Views,
    unknowns: tuple[Unknown, ...],
    *,
    kinematics: ArmKinematics | None,
    errors: Errors = EXACT,
) -> Dependence:
    """Differentiate the chain by every free number (central differences, one evaluation a side)."""
    staged = StagedEvaluation(model, views, kinematics=kinematics, errors=errors)
    columns = [_column(staged, model, unknown) for unknown in unknowns]
    by_own = [_flange_column(staged, k) for k in range(6)]
    if errors.focal is not None:
        sides = staged.state.optics[:, _SIDES] / (1.0 + errors.focal[:, None])
        by_own.append(_Column(np.array(_SIDES, dtype=np.int64), sides, None, None))
    n, p = len(views), len(unknowns)
    followed = np.zeros(len(model.optics), dtype=bool)
    for column in (*columns, *by_own):
        followed[column.followed] = True
    active = np.flatnonzero(followed)
    moving = [k for k, c in enumerate(columns) if c.points is not None and c.points.any()]
    a = len(active)
    local = np.zeros((n, a + 6 + len(moving), p))
    own = np.zeros((n, a + 6, len(by_own)))
    for into, found in ((local, columns), (own, by_own)):
        for k, column in enumerate(found):
            into[:, np.searchsorted(active, column.followed), k] = column.optics
            if column.pose is not None:
                into[:, a : a + 6, k] = column.pose
    for b, k in enumerate(moving):
        local[:, a + 6 + b, k] = 1.0
    state = staged.state
    modes = np.array([columns[k].points for k in moving]).reshape(-1, *state.points_m.shape)
    return Dependence(state, tuple(int(c) for c in active), modes, local, own)


@dataclass(frozen=True)
class _Column:
    """Derivatives by one number; None where nothing follows it.

    (N, F) of the F optics columns `followed`, (N, 6) of the pose, (M, 3) of the corners.
    """

    followed: NDArray[np.int64]
    optics: FloatArray
    pose: FloatArray | None
    points: FloatArray | None


def _column(staged: StagedEvaluation, model: CellModel, unknown: Unknown) -> _Column:
    first = staged.entry(unknown.place)
    step = np.array([unknown.typical * _STEP_SHARE])
    # bounds would halve the difference of a number that stands at one
    plus = staged.from_stage(moved(model, (unknown,), step, bounded=False), first)
    minus = staged.from_stage(moved(model, (unknown,), -step, bounded=False), first)
    return _difference(staged, plus, minus, 0.5 / step[0], placed=first >= staged.placed)


def _flange_column(staged: StagedEvaluation, k: int) -> _Column:
    step = _FLANGE_STEP * np.eye(6)[k]
    plus, minus = staged.nudged(step), staged.nudged(-step)
    return _difference(staged, plus, minus, 0.5 / _FLANGE_STEP, placed=False)


def _difference(
    staged: StagedEvaluation, plus: ChainState, minus: ChainState, scale: float, *, placed: bool
) -> _Column:
    """`placed` where the number enters after the pose, which then stays."""
    optics = (plus.optics - minus.optics) * scale
    followed = np.flatnonzero(optics.any(axis=0))
    optics = optics[:, followed]
    if placed:
        return _Column(followed, optics, None, None)
    rate = (plus.camera_from_board - minus.camera_from_board) * scale
    back = rigid.inverse(staged.state.camera_from_board)
    return _Column(
        followed,
        optics,
        rigid.twist(rigid.product(rate, back)),
        (plus.points_m - minus.points_m) * scale,
    )
