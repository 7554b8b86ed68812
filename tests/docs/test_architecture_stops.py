"""The architecture page's stops are passed in their order, by a real dry run."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from functools import wraps
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from cell.cli.app import app, main
from tests.cell.plans import CELL, PLAN, SIMULATION
from tools import architecture_page

_VIEWS = [
    f"- {{joints_deg: [{a}, {-90 + b}, 90, {-90 - b + c}, {-90 + d}, {e}]}}"
    for a, b, c, d, e in (
        (0, 0, 0, 0, 0),
        (2, 0, 6, 5, 20),
        (-1, 2, -8, 8, 60),
        (2, 2, 10, 0, -60),
        (0, -4, 0, 10, 90),
        (0, 3, -9, -4, -20),
        (1, -2, 4, 9, 45),
    )
]


def _watched(monkeypatch: pytest.MonkeyPatch, names: Sequence[str], passed: list[str]) -> None:
    """Have every function note its first call, under whatever name a module has it."""
    for name in names:
        module, _, path = name.partition(":")
        owner: Any = import_module(module)
        *inside, last = path.split(".")
        for part in inside:
            owner = getattr(owner, part)
        true = getattr(owner, last)
        noting = _noting(true, name, passed)
        owners = [owner] if inside else [*sys.modules.values(), *app.registered_commands]
        for one in owners:
            for key in [key for key, value in list(vars(one).items()) if value is true]:
                monkeypatch.setattr(one, key, noting)


def _noting(true: Callable[..., Any], name: str, passed: list[str]) -> Callable[..., Any]:
    @wraps(true)
    def noting(*args: Any, **options: Any) -> Any:
        if name not in passed:
            passed.append(name)
        return true(*args, **options)

    return noting


def test_a_dry_run_passes_the_stops_in_their_order(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "bench.yaml").write_text(CELL + SIMULATION)
    (tmp_path / "plan.yaml").write_text(PLAN.split("views:")[0] + "\n".join(["views:", *_VIEWS]))
    passed: list[str] = []
    stops = {name for name, _ in (*architecture_page.CORNER, *architecture_page.PLAN)}
    _watched(monkeypatch, sorted(stops), passed)
    words = ["cell", "run", str(tmp_path / "plan.yaml"), "--dry-run", "-o", str(tmp_path / "r")]
    monkeypatch.setattr(sys, "argv", words)
    with pytest.raises(SystemExit) as left:
        main()
    assert left.value.code == 0
    for walk in (architecture_page.CORNER, architecture_page.PLAN):
        names = [name for name, _ in walk]
        assert [name for name in passed if name in names] == names
