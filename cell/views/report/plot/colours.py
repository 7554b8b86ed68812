"""Colour maps: numbers to colours that also differ in grey, after the maps of the same names."""

from __future__ import annotations

import numpy as np

from calib.views import FloatArray

# seven supports each; between them linearly in RGB
_MAPS = {
    # Nuñez et al. 2018, light to dark
    "cividis_r": ("#fee838", "#d9c55c", "#b3a772", "#8b8b79", "#666970", "#3f4c6b", "#00224e"),
    # Brewer's purple and orange, white in the middle
    "PuOr": ("#7f3b08", "#d87a20", "#fbc583", "#f7f7f7", "#c6c0de", "#7f71ab", "#2d004b"),
}


def colours(values: FloatArray, name: str, low: float, high: float) -> list[str]:
    """A colour for each value, the map going from `low` to `high`; NaN gives an empty word."""
    table = np.array([[int(c[i : i + 2], 16) for i in (1, 3, 5)] for c in _MAPS[name]], dtype=float)
    span = high - low if high > low else 1.0
    at = np.clip((np.nan_to_num(values) - low) / span, 0.0, 1.0) * (len(table) - 1)
    rgb = np.stack([np.interp(at, np.arange(len(table)), column) for column in table.T], axis=-1)
    text = [f"#{r:02x}{g:02x}{b:02x}" for r, g, b in np.rint(rgb).astype(int).tolist()]
    return [word if known else "" for word, known in zip(text, np.isfinite(values), strict=True)]
