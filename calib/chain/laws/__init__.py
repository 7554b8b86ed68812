"""Forms of laws without a name, one small file each.

A file in this folder that defines `FORM` is tried by the search; nothing else has to be touched.
"""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache

from calib.chain.laws.form import Form


@cache
def forms() -> tuple[Form, ...]:
    """Every form of this folder."""
    names = sorted(module.name for module in pkgutil.iter_modules(__path__))
    modules = [importlib.import_module(f"{__name__}.{name}") for name in names]
    return tuple(module.FORM for module in modules if hasattr(module, "FORM"))


def form_of(key: str) -> Form:
    """Return the form of that key; raises KeyError."""
    return {form.key: form for form in forms()}[key]
