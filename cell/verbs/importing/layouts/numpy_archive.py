"""NumPy's `.npz` and `.npy`: arrays of matrices, or of rotations and translations."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cell.verbs.importing.layouts.nested import series_in
from cell.verbs.importing.raw import Series


def read(path: Path) -> list[Series]:
    """Poses among the archive's arrays, by their names; raises `ValueError`, `OSError`."""
    loaded = np.load(path, allow_pickle=False)
    if isinstance(loaded, np.ndarray):
        return series_in(path, loaded.tolist(), "NumPy array")
    with loaded:
        arrays = {name: loaded[name] for name in loaded.files}
    numbers = {n: a.tolist() for n, a in arrays.items() if a.dtype.kind in "fiu"}
    return series_in(path, numbers, "NumPy archive")
