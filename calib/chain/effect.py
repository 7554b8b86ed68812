"""What an effect is: one departure from the plain chain, described in one small file of its own."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from calib.views import FloatArray, Views

if TYPE_CHECKING:
    from calib.chain.state import ChainState

Link = Literal["clock", "arm", "mount", "board", "lens", "sensor", "detector"]
Role = Literal["amount", "shape", "setting"]

LINKS: tuple[Link, ...] = ("clock", "arm", "mount", "board", "lens", "sensor", "detector")


@dataclass(frozen=True)
class Parameter:
    """One number of an effect.

    Attributes
    ----------
    name, unit:
        As they stand in files; the name carries the unit.
    typical:
        A usual size where the effect is present, in `unit`.
    low, high:
        What a sane cell can have.
    role:
        `amount`: zero where the effect is absent, fitted. `shape`: fitted once the amount is not
        zero (a time constant). `setting`: given, never fitted (a node's place).
    identifiable:
        False where hand-eye or board pose absorb it, so that it can be simulated but not fitted.
    prior_sigma:
        Width of the normal prior of an amount whose sizes spread far beyond the typical one; None
        where ten times the typical size is wide enough.
    """

    name: str
    unit: str
    typical: float
    low: float
    high: float
    role: Role = "amount"
    identifiable: bool = True
    prior_sigma: float | None = None


def _one_candidate(views: Views) -> Sequence[Mapping[str, float]]:
    return ({},)


def _varies(column: FloatArray) -> bool:
    known = column[np.isfinite(column)]
    return bool(len(known) and known.min() < known.max())


@dataclass(frozen=True)
class Effect:
    """A departure from the plain chain.

    Attributes
    ----------
    name, law:
        Name in the contract, and which of several laws this is, if there are several.
    link:
        Where in the chain it acts.
    physics:
        One plain sentence for a technician.
    equation, source:
        What it does, and where that is written.
    parameters:
        Its numbers.
    act:
        Changes the state, given the parameters' values in their order.
    needs:
        Columns of `Views` that must have been logged.
    varies:
        Columns, or further keys, of the log of which at least one must not be the same in every
        frame.
    looks_ahead:
        Asks where camera and board stand before the arm has moved.
    moving_only:
        Nothing shows it unless something moved while the frames were captured.
    seen_without_robot:
        The pictures alone show it: a free camera pose for each frame cannot absorb it.
    confounded_with:
        Names of effects that look alike.
    acts_along:
        (site, covariate) pairs of `calib.chain.empirical` whose curve this effect is: a remainder
        there is its law's shape, as long as it is small.
    remedy:
        What the technician can do about it.
    candidates:
        Values of shapes and settings worth trying on these views.
    separable:
        Whether some of the amounts alone make sense; not so for the nodes of a curve.
    roughness:
        Rows of coefficients over the parameters: combinations of amounts that have a normal prior
        of width one besides their own, such as what a curve may bend by from node to node. A node
        that no frame supports then follows its neighbours.
    """

    name: str
    link: Link
    physics: str
    equation: str
    source: str
    parameters: tuple[Parameter, ...]
    act: Callable[[FloatArray, ChainState], None]
    remedy: str
    law: str | None = None
    needs: tuple[str, ...] = ()
    varies: tuple[str, ...] = ()
    looks_ahead: bool = False
    moving_only: bool = False
    seen_without_robot: bool = False
    confounded_with: tuple[str, ...] = ()
    acts_along: tuple[tuple[str, str], ...] = ()
    candidates: Callable[[Views], Sequence[Mapping[str, float]]] = _one_candidate
    separable: bool = True
    roughness: tuple[tuple[float, ...], ...] = ()

    @property
    def label(self) -> str:
        """Name and law, unique in the catalogue."""
        return self.name if self.law is None else f"{self.name}:{self.law}"

    def values(self, given: Mapping[str, float]) -> FloatArray:
        """(P,) parameters in order; amounts not given are zero, shapes and settings typical.

        Raises
        ------
        KeyError
            For a name that is no parameter of this effect.
        """
        names = {p.name for p in self.parameters}
        for name in given:
            if name not in names:
                raise KeyError(
                    f"{self.label} has no parameter {name!r}; it has {', '.join(sorted(names))}"
                )
        return np.array(
            [given.get(p.name, 0.0 if p.role == "amount" else p.typical) for p in self.parameters]
        )

    def missing(self, views: Views) -> str | None:
        """Say which needed column was never logged, or None when the effect can be seen."""
        if self.moving_only and not views.moving:
            return "nothing moved while the frames were captured"
        for column in self.needs:
            value = getattr(views, column)
            if value is None or (isinstance(value, np.ndarray) and not np.isfinite(value).any()):
                return f"{column} was not logged"
        if self.varies and not any(_varies(views.logged(key)) for key in self.varies):
            return f"{' and '.join(self.varies)} did not vary, or were not logged"
        return None


@dataclass(frozen=True)
class Present:
    """An effect with its values: part of a cell model.

    `held` are the places of amounts that are not fitted: a fault of one joint needs no others.
    """

    effect: Effect
    values: FloatArray
    held: frozenset[int] = frozenset()

    @property
    def absent(self) -> bool:
        """True when every amount is zero: it changes nothing."""
        return not any(
            value and parameter.role == "amount"
            for value, parameter in zip(self.values, self.effect.parameters, strict=True)
        )

    @property
    def free(self) -> tuple[int, ...]:
        """Places of the amounts that can be fitted and are."""
        return tuple(
            k
            for k, p in enumerate(self.effect.parameters)
            if p.role == "amount" and p.identifiable and k not in self.held
        )

    def same_but_amounts(self, other: Present) -> bool:
        """Whether only the fitted numbers differ."""
        if self.effect.label != other.effect.label or len(self.values) != len(other.values):
            return False
        settings = [k for k, p in enumerate(self.effect.parameters) if p.role == "setting"]
        return bool((self.values[settings] == other.values[settings]).all())

    def as_mapping(self) -> dict[str, float]:
        """Parameter name to value."""
        return {p.name: float(v) for p, v in zip(self.effect.parameters, self.values, strict=True)}
