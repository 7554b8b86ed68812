"""A smooth field without a formula: of shifts over the picture, or of heights over the board.

A Gaussian process on a rectangle, carried by its cosines: each has a normal prior whose width is
the spectral density of the process at the cosine's frequency (Solin, Saerkkae 2020). The amounts
are given and not fitted with the rest: see `calib.discovery.laws.surface_field`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from calib.chain.effect import Effect, Link, Parameter, Present
from calib.chain.empirical import UNNAMED
from calib.chain.state import ChainState
from calib.views import Board, FloatArray, Views

_MARGIN = 0.1
"""The rectangle reaches so far beyond what is seen, in its sides: cosines are level at its rim."""

_REACH = 3.0
"""Cosines whose frequency times the length scale is larger have next to no prior width."""

_MOST_WAVES = 150


@dataclass(frozen=True)
class Surface:
    """What a field can be over.

    Attributes
    ----------
    law:
        As it stands in files.
    site, link, covariate:
        Where it acts, and along what.
    components:
        (name, typical size) of what is displaced, in `unit`.
    unit:
        Of displacements and lengths.
    """

    law: str
    site: str
    link: Link
    covariate: str
    components: tuple[tuple[str, float], ...]
    unit: str
    physics: str
    equation: str
    remedy: str


IMAGE = Surface(
    law="field:image_shift/image",
    site="image_field",
    link="sensor",
    covariate="image place",
    components=(("u", 1.0), ("v", 1.0)),
    unit="px",
    physics=(
        "Corners are displaced in the picture by an amount that depends on where they are seen, in"
        " a way that no lens model describes."
    ),
    equation="seen = projected + field(seen), a smooth field of shifts over the picture",
    remedy=(
        "Look at the protective window and the front lens there for dents, droplets and scratches;"
        " until then the twin carries the shifts."
    ),
)
BOARD = Surface(
    law="field:board_height/board",
    site="board_height",
    link="board",
    covariate="board place",
    components=(("z", 3e-4),),
    unit="m",
    physics="The board has a bump or a dent that no bend, twist or long wave describes.",
    equation="z = field(x, y), a smooth field of heights over the board",
    remedy="Lay a straightedge across the board there; until then the twin carries its shape.",
)
SURFACES = (IMAGE, BOARD)


def surface_of(present: Present) -> Surface | None:
    """What the effect is a field over; None where it is no such field."""
    return next((s for s in SURFACES if s.law == present.effect.law), None)


@dataclass(frozen=True)
class Rectangle:
    """The sides of what is seen, and which waves go over it.

    Attributes
    ----------
    sides:
        Along x and y, in the surface's unit.
    waves:
        Half periods along x and y of each wave.
    """

    sides: tuple[float, float]
    waves: tuple[tuple[int, int], ...]

    @property
    def _widened(self) -> FloatArray:
        return (1.0 + 2.0 * _MARGIN) * np.array(self.sides)

    def functions(self, place: FloatArray) -> FloatArray:
        """(..., W) of the waves at (..., 2) places; beyond the rim they stay as they are there."""
        wide = self._widened
        at = np.clip((np.nan_to_num(place) + _MARGIN * np.array(self.sides)) / wide, 0.0, 1.0)
        i, j = np.array(self.waves).T
        along_x = np.cos(np.pi * at[..., :1] * np.arange(i.max() + 1))
        along_y = np.cos(np.pi * at[..., 1:] * np.arange(j.max() + 1))
        return np.asarray(along_x[..., i] * along_y[..., j])

    def prior_sigma(self, length_scale: float) -> FloatArray:
        """(W,) prior widths for a process of unit variance."""
        number = np.array(self.waves)
        frequency = np.pi * number / self._widened
        square = length_scale**2 * (frequency**2).sum(axis=1)
        density = 2.0 * np.pi * length_scale**2 * np.exp(-0.5 * square)
        doubled = np.where(number > 0, 2.0, 1.0).prod(axis=1)
        return np.asarray(np.sqrt(density * doubled / self._widened.prod()))


def rectangle(
    sides: tuple[float, float], length_scale: float, finest: Sequence[int] | None = None
) -> Rectangle:
    """The waves that a field of that length scale, or a longer one, is made of.

    `finest` are the most half periods along x and y that can be distinguished.
    """
    wide = (1.0 + 2.0 * _MARGIN) * np.array(sides)
    most = np.floor(_REACH * wide / (np.pi * length_scale)).astype(int)
    if finest is not None:
        most = np.minimum(most, finest)
    i, j = (grid.ravel() for grid in np.mgrid[: most[0] + 1, : most[1] + 1])
    frequency = np.hypot(i / wide[0], j / wide[1]) * np.pi
    order = np.argsort(frequency, kind="stable")
    kept = order[(frequency[order] > 0.0) & (frequency[order] * length_scale <= _REACH)]
    waves = tuple((int(i[k]), int(j[k])) for k in kept[:_MOST_WAVES])
    return Rectangle((float(sides[0]), float(sides[1])), waves)


def sides_of(surface: Surface, views: Views) -> tuple[float, float]:
    """Sides of the picture (px) or of the grid of corners (m)."""
    if surface is IMAGE:
        return float(views.width_px), float(views.height_px)
    return _grid_m(views.board)


def _grid_m(board: Board) -> tuple[float, float]:
    far = board.corners_m.max(axis=0)
    return float(far[0]), float(far[1])


@dataclass(frozen=True)
class Estimate:
    """A field's amounts with what is known of its uncertainty.

    Attributes
    ----------
    weights:
        (W, D) of the waves and components.
    length_scale, length_scale_sigma, rms, rms_sigma:
        In the surface's unit; the RMS is over where corners were seen.
    """

    weights: FloatArray
    length_scale: float
    length_scale_sigma: float
    rms: float
    rms_sigma: float


def present_field(surface: Surface, over: Rectangle, found: Estimate) -> Present:
    """The field as an effect whose amounts are given and not fitted."""
    effect = _effect(surface, over)
    given = {name: getattr(found, name) for name in _SETTINGS}
    given |= {"side_x": over.sides[0], "side_y": over.sides[1]}
    values = effect.values(given)
    values[: found.weights.size] = found.weights.ravel()
    return _held(effect, values)


def field_from(text: str, given: Mapping[str, float]) -> Present:
    """Return the field that a file states; raises KeyError for a number that it cannot have."""
    surface = {s.law: s for s in SURFACES}[text]
    waves = {tuple(int(k) for k in n.split("_")[1:3]): None for n in given if n[:5] == "wave_"}
    over = Rectangle((given["side_x"], given["side_y"]), tuple((i, j) for i, j in waves))
    effect = _effect(surface, over)
    return _held(effect, effect.values(given))


def _held(effect: Effect, values: FloatArray) -> Present:
    amounts = frozenset(k for k, p in enumerate(effect.parameters) if p.role == "amount")
    return Present(effect, values, held=amounts)


def parts(present: Present) -> tuple[Rectangle, FloatArray]:
    """The field's rectangle, and (W, D) amounts of its waves."""
    given = present.as_mapping()
    surface = surface_of(present)
    assert surface is not None
    names = [p.name for p in present.effect.parameters if p.role == "amount"]
    many = len(surface.components)
    waves = [tuple(int(k) for k in name.split("_")[1:3]) for name in names[::many]]
    over = Rectangle((given["side_x"], given["side_y"]), tuple((i, j) for i, j in waves))
    return over, present.values[: len(names)].reshape(-1, many)


_SETTINGS = ("length_scale", "length_scale_sigma", "rms", "rms_sigma")


def _effect(surface: Surface, over: Rectangle) -> Effect:
    count = len(over.waves)

    def act(values: FloatArray, state: ChainState) -> None:
        amounts = values[: count * len(surface.components)].reshape(count, -1)
        _ACTS[surface.site](partial(_at, over, amounts), state)

    unit = surface.unit
    return Effect(
        name=UNNAMED,
        law=surface.law,
        link=surface.link,
        physics=surface.physics,
        equation=surface.equation,
        source="Gaussian process in cosines (Solin, Saerkkae 2020, Statistics and Computing 30)",
        parameters=(
            *(
                Parameter(f"wave_{i}_{j}_{name}", unit, typical, -1e3 * typical, 1e3 * typical)
                for i, j in over.waves
                for name, typical in surface.components
            ),
            *(Parameter(name, unit, 0.0, 0.0, 1e6, role="setting") for name in _SETTINGS),
            *(
                Parameter(name, unit, 1.0, 0.0, 1e6, role="setting")
                for name in ("side_x", "side_y")
            ),
        ),
        act=act,
        remedy=surface.remedy,
        seen_without_robot=True,
        separable=False,
    )


def _at(over: Rectangle, amounts: FloatArray, place: FloatArray) -> FloatArray:
    return np.asarray(over.functions(place) @ amounts)


Field = Callable[[FloatArray], FloatArray]


def _shift(field: Field, state: ChainState) -> None:
    state.picture_fields = (*state.picture_fields, field)


def _raise(field: Field, state: ChainState) -> None:
    state.points_m[:, 2] += field(state.views.board.corners_m[:, :2])[:, 0]


_ACTS: Mapping[str, Callable[[Field, ChainState], None]] = {IMAGE.site: _shift, BOARD.site: _raise}
