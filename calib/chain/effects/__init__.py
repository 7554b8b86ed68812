"""The catalogue: every effect that the chain can carry, one small file each.

A file in this folder that defines `EFFECT` is in the catalogue; nothing else has to be touched.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping, Sequence
from functools import cache

from calib.chain.effect import Effect, Present
from calib.chain.empirical import UNNAMED, empirical_from
from calib.chain.laws.arm_field import FIELD, field_from
from calib.chain.laws.law import law_from
from calib.chain.laws.surface_field import SURFACES
from calib.chain.laws.surface_field import field_from as surface_from


@cache
def catalogue() -> tuple[Effect, ...]:
    """Every effect of this folder, by name and law."""
    names = sorted(module.name for module in pkgutil.iter_modules(__path__))
    modules = [importlib.import_module(f"{__name__}.{name}") for name in names]
    return tuple(module.EFFECT for module in modules)


def find_effect(name: str, law: str | None = None) -> Effect:
    """Return the effect of that name, and of that law where it has several.

    Raises
    ------
    KeyError
        For a name or a law that the catalogue does not have, naming those it has.
    """
    named = [effect for effect in catalogue() if effect.name == name]
    if not named:
        known = ", ".join(sorted({effect.name for effect in catalogue()}))
        raise KeyError(f"no effect is called {name!r}; known are {known}")
    for effect in named:
        if effect.law == law or (law is None and len(named) == 1):
            return effect
    laws = ", ".join(str(effect.law) for effect in named)
    raise KeyError(f"{name} needs a law, one of {laws}; got {law!r}")


def make_effect(name: str, given: Mapping[str, float | str | Sequence[float]]) -> Present:
    """Return the named effect with its values, as files and the command line write them.

    A list stands for the numbered parameters of that stem: `offset_rad: [0, 0.001]` sets
    `offset_rad_1` and `offset_rad_2`.

    Raises
    ------
    KeyError
        For an unknown effect, law or parameter.
    """
    law = given.get("law")
    numbers = _flat(name, {key: value for key, value in given.items() if key != "law"})
    if name == UNNAMED:
        return _unnamed(str(law), numbers)
    effect = find_effect(name, None if law is None else str(law))
    return Present(effect, effect.values(numbers))


def _unnamed(law: str, numbers: Mapping[str, float]) -> Present:
    """Return the law, field or curve that a file states."""
    if law.startswith(FIELD):
        return field_from(law, numbers)
    if law in {surface.law for surface in SURFACES}:
        return surface_from(law, numbers)
    return law_from(law, numbers) if ":" in law else empirical_from(law, numbers)


def _flat(name: str, given: Mapping[str, float | str | Sequence[float]]) -> dict[str, float]:
    flat: dict[str, float] = {}
    for key, value in given.items():
        if isinstance(value, (int, float)):
            flat[key] = float(value)
        elif isinstance(value, str):
            raise KeyError(f"{name}: {key} is a number, got {value!r}")
        else:
            flat.update({f"{key}_{i}": float(v) for i, v in enumerate(value, start=1)})
    return flat
