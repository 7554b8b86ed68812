"""The packages that studies need and nothing else does."""

from __future__ import annotations

from importlib import import_module

from drivers.errors import DeviceRefused

PACKAGES = ("distributed", "pyarrow")
MEND = "pip install 'calibration-cell[study]'"


def require_extra() -> None:
    """Raise `DeviceRefused` with the way to install what is missing."""
    for name in PACKAGES:
        try:
            import_module(name)
        except ImportError as missing:
            raise DeviceRefused(f"cell study needs {name} ({missing}): {MEND}") from None
