"""NumPy's `.npz` and `.npy`: arrays of matrices, or of rotations and translations."""

from __future__ import annotations

from pathlib import Path

from cell.storage.incoming.arrays import read_arrays
from cell.verbs.importing.layouts.nested import series_in
from cell.verbs.importing.raw import Series


def read(path: Path) -> list[Series]:
    """Poses among the archive's arrays, by their names; raises `InputError`."""
    arrays = read_arrays(path)
    if list(arrays) == [""]:
        return series_in(path, arrays[""].tolist(), "NumPy array")
    numbers = {n: a.tolist() for n, a in arrays.items() if a.dtype.kind in "fiu"}
    return series_in(path, numbers, "NumPy archive")
