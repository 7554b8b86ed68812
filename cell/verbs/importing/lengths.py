"""The unit of the poses' positions: the pictures' length factor decides, names and sizes else."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from calib.views import FloatArray
from cell.errors import InputError
from cell.verbs.importing import Unit
from cell.verbs.importing.rotations import METRES

_FARTHEST_M = 4.0
"""No arm this program knows reaches farther; larger numbers are millimetres."""

_SAME = 1.5
"""Rough intrinsics may make a length so many times wrong; units are farther apart."""

_CLEARLY_OTHER = 1.15


@dataclass(frozen=True)
class Lengths:
    """The unit, why, and what of it was stated and the pictures speak against."""

    unit: Unit
    why: str
    contradicted: tuple[str, ...] = ()


def unit_of(
    places: FloatArray,
    named: Unit | None,
    stated: Unit | None,
    factor: float | None,
    square_m: float | None,
) -> Lengths:
    """The unit of (N, 3) positions.

    Parameters
    ----------
    named, stated:
        By the names in the file, and by the user.
    factor:
        Units of the positions in a metre of the board, by the pictures; None where unknown.

    Raises
    ------
    InputError
        The pictures are mirrored, or no unit fits them and the board's square.
    """
    if factor is not None and factor < 0:
        raise InputError(
            "the pictures are mirrored: poses and pictures agree only with every length negative."
            " Flip the pictures left to right (or switch the camera's mirroring off) and import"
            " them again"
        )
    if stated is not None:
        return Lengths(stated, "as stated", _against(stated, factor, square_m))
    farthest = float(np.abs(places).max())
    if factor is None:
        if named is not None:
            return Lengths(named, "as their names say")
        return Lengths(
            "mm" if farthest > _FARTHEST_M else "m", f"as the largest coordinate is {farthest:.4g}"
        )
    unit = min(METRES, key=lambda u: abs(math.log(factor * METRES[u])))
    if abs(math.log(factor * METRES[unit])) > math.log(_SAME) or not _reachable(farthest, unit):
        likely: Unit = named or ("mm" if farthest > _FARTHEST_M else "m")
        raise InputError(_no_unit(likely, factor, square_m))
    why = f"as the pictures show {factor:.4g} of them in a metre of the board"
    if named is not None and named != unit:
        why += f", whatever the names say ({named})"
    return Lengths(unit, why, _against(unit, factor, square_m))


def _reachable(farthest: float, unit: Unit) -> bool:
    return farthest * METRES[unit] < 5 * _FARTHEST_M


def _against(unit: Unit, factor: float | None, square_m: float | None) -> tuple[str, ...]:
    if factor is None or abs(math.log(factor * METRES[unit])) < math.log(_CLEARLY_OTHER):
        return ()
    ratio = factor * METRES[unit]
    return (f"positions in {unit} and the board's squares disagree about length by a factor of"
            f" {ratio:.3g}{_square(ratio, square_m)}",)  # fmt: skip


def _no_unit(unit: Unit, factor: float, square_m: float | None) -> str:
    ratio = factor * METRES[unit]
    return (
        f"the board's squares and the poses disagree about length by a factor of {ratio:.3g}"
        f" (poses taken in {unit}){_square(ratio, square_m)}. Mend --board (metres), or say --unit"
    )


def _square(ratio: float, square_m: float | None) -> str:
    return "" if square_m is None else f": squares of {square_m * ratio:.4g} m would fit"
