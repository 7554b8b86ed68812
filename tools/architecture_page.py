"""Writes docs/architecture.md and its pictures, the chain and the floors, counted from the code.

``python tools/architecture_page.py`` writes them anew and prints what it counted: the rooms of the
operator's side, the arrows between them, and any circle of imports, benchmarks and tests included.
tests/docs keeps page and pictures in step and the list of circles empty.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from html import escape
from importlib import import_module
from inspect import getdoc
from pathlib import Path

import grimp

from calib.chain.effect import LINKS
from calib.chain.effects import catalogue

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "docs"
FLOORS = ("cli", "verbs", "views", "devices", "sequencer", "storage")
"""Of the operator's side, the top one first."""
_PASSES = {
    "clock": "when",
    "arm": "where the flange is",
    "mount": "flange to camera",
    "board": "where the corner is",
    "lens": "focus, distortion",
    "sensor": "tilt, shutter, pixels",
    "detector": "what is found",
}
CORNER = (
    ("calib.chain.model:evaluate", "clock, arm, mount and board in turn, each with its effects"),
    (
        "calib.chain.model:start",
        "the logged pose and joints of each frame become the chain's start",
    ),
    ("calib.chain.state:ChainState.move_arm", "moved joints and links move the logged flange"),
    ("calib.chain.state:ChainState.place", "where the camera sees the board: camera_from_board"),
    (
        "calib.chain.projection:project_with_jacobians",
        "lens and sensor: the corner becomes a pixel, with its derivatives",
    ),
    ("calib.detection:detect", "the same corner in a picture, with its uncertainty"),
    ("calib.calibration:calibrate", "every solution of a recording"),
    ("calib.solver.joint:fit_joint", "the difference of both, made least over all corners"),
    ("calib.calibration.mapping:as_mapping", "the numbers as `calibration.json` has them"),
    ("cell.views.report.from_calibration:solution_residuals", "what is left, for the drawings"),
    ("cell.views.report:write_report", "`report.html`"),
)
"""In the order of a dry run, whose camera evaluates the chain before anything is fitted."""
PLAN = (
    ("cell.cli.run:run", "the command line: the file's name and the options"),
    ("cell.storage.files.plan_file:read_plan", "YAML to a checked plan and its cell"),
    ("cell.verbs.run:record", "run, page and running estimate put together"),
    ("cell.devices.factory:simulated_devices", "arm and camera (`real_devices` without --dry-run)"),
    ("cell.sequencer.session:record_plan", "recording and journal opened, or gone on with"),
    ("cell.sequencer.sequencer:Sequencer.run", "one loop that owns the arm"),
    ("cell.sequencer.guard:Guard.check_plan", "every motion checked before the first begins"),
    ("cell.sequencer.watched_arm:WatchedArm.go", "moves, reads, stops"),
    ("cell.storage.recording:RecordingWriter.append", "a frame on the disk, synced"),
    ("cell.verbs.run:evaluate", "calibrated, diagnosed, reported"),
)


def files() -> dict[str, str]:
    """File name under docs/ to text."""
    graph = grimp.build_graph("cell", "calib", "drivers", "sim")
    arrows = _arrows(graph)
    return {
        "architecture.md": _page(graph, arrows),
        "pictures/chain.svg": _chain(),
        "pictures/floors.svg": _floors(arrows),
    }


def circles() -> list[set[str]]:
    """Modules that import each other round a circle, deferred imports included; none is right."""
    graph = grimp.build_graph("cell", "calib", "drivers", "sim", "benchmarks", "tests", "tools")
    imports = {m: graph.find_modules_directly_imported_by(m) for m in graph.modules}
    while True:  # a module that imports, or is imported by, nothing that is left is in no circle
        imported = set().union(*imports.values())
        left = {m: on & imports.keys() for m, on in imports.items() if on and m in imported}
        if left == imports:
            break
        imports = left
    return [_circle_of(start, imports) for start in sorted(imports)[:1]]


def _circle_of(start: str, imports: dict[str, set[str]]) -> set[str]:
    way = [start]
    while way[-1] not in way[:-1]:
        way.append(min(imports[way[-1]]))
    return set(way[way.index(way[-1]) :])


def _room(module: str) -> str:
    """The floor of a module of the operator's side, the package of any other."""
    names = module.split(".")
    return names[1] if names[0] == "cell" and len(names) > 1 and names[1] in FLOORS else names[0]


def _arrows(graph: grimp.ImportGraph) -> Counter[tuple[str, str]]:
    """How many imports lead from one room to another."""
    found: Counter[tuple[str, str]] = Counter()
    for module in graph.modules:
        for other in graph.find_modules_directly_imported_by(module):
            here, there = _room(module), _room(other)
            if here != there and there != "cell":
                found[here, there] += 1
    return found


def _page(graph: grimp.ImportGraph, arrows: Counter[tuple[str, str]]) -> str:
    inside = {key: n for key, n in arrows.items() if set(key) <= set(FLOORS)}
    sizes = Counter(_room(module) for module in graph.modules)
    parts = [
        "# Architecture",
        "Made by `tools/architecture_page.py` from the code: what is counted here is counted from"
        " its imports. `make layers` refuses an import that runs up, or round in a circle.",
        "## The chain",
        "A corner of the board becomes a pixel by passing links. The simulator evaluates the chain"
        " forward, the calibration with unknown numbers, the diagnosis asks link by link what is"
        " missing, the report is laid out along it. Numbers are effects of the"
        " [catalogue](effects/index.md).",
        "![The measurement chain](pictures/chain.svg)",
        "## The floors",
        "`calib`, `drivers` and `sim` are libraries; `cell` is the operator's side, on six floors."
        f" {len(inside)} arrows join them, every one downwards. Before [decision 13]"
        "(decisions/0013-six-floors.md), which lists where what was hardest to find is now, there"
        " were 26 rooms on ten floors, 123 arrows, two of them upwards, and three circles.",
        "![Packages and floors, with the imports between them](pictures/floors.svg)",
        _table(
            ("floor", "modules", "is", "imports from (times)"),
            [
                (
                    f"`cell/{floor}`",
                    str(sizes[floor]),
                    _about(f"cell.{floor}"),
                    _below(floor, inside),
                )
                for floor in FLOORS
            ],
        ),
        "## One corner, from the pose to the report",
        _stops(CORNER),
        "## One plan, from YAML to a recording",
        _stops(PLAN),
        "## Where a new thing goes",
        "CONTRIBUTING.md at the top of the project says it file by file.",
    ]
    return "\n\n".join(parts) + "\n"


def _about(package: str) -> str:
    """First sentence of a package's docstring."""
    return (getdoc(import_module(package)) or "").split("\n\n")[0].replace("\n", " ")


def _below(floor: str, inside: dict[tuple[str, str], int]) -> str:
    return ", ".join(f"{f} ({inside[floor, f]})" for f in FLOORS if (floor, f) in inside)


def _stops(stops: Iterable[tuple[str, str]]) -> str:
    rows = []
    for place, does in stops:
        module, _, name = place.partition(":")
        target = import_module(module)
        for part in name.split("."):
            target = getattr(target, part)
        rows.append((f"`{module}`", f"`{name}`", does))
    return _table(("module", "function or class", "does"), rows)


def _table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    lines = [head, tuple("---" for _ in head), *rows]
    return "\n".join(f"| {' | '.join(row)} |" for row in lines)


def _chain() -> str:
    counts = Counter(effect.link for effect in catalogue())
    body = []
    for k, (link, passes) in enumerate(_PASSES.items()):
        x = 10 + 132 * k
        effects = f"effects: {counts[link]}" if link in LINKS else ""
        body += [
            _box(x, 20, 108, 66, "#eef3fa"),
            _text(x + 54, 42, link, 15, bold=True),
            _text(x + 54, 60, passes, 10),
            _text(x + 54, 77, effects, 10),
        ]
        if k:
            body.append(_arrow(x - 24, 53, x - 2, 53))
    return _svg(132 * len(_PASSES) + 0, 106, body)


def _floors(arrows: Counter[tuple[str, str]]) -> str:
    body = []
    for k, floor in enumerate(FLOORS):
        y = 10 + 58 * k
        body += [
            _box(10, y, 250, 40, "#eef3fa"),
            _text(135, y + 25, f"cell/{floor}", 14, bold=True),
        ]
        body += _leads(floor, arrows, y)
        if k:
            body.append(_arrow(135, y - 18, 135, y - 1))
    for k, package in enumerate(("sim", "calib", "drivers")):
        y = 40 + 110 * k
        body += [_box(560, y, 150, 48, "#f4f1e8"), _text(635, y + 29, package, 14, bold=True)]
    body += [_arrow(635, 88, 635, 149), _text(650, 122, f"{arrows['sim', 'calib']}", 11, left=True)]
    body += [_bow(), _text(742, 180, f"{arrows['sim', 'drivers']}", 11)]
    return _svg(770, 362, body)


def _leads(floor: str, arrows: Counter[tuple[str, str]], y: int) -> list[str]:
    """What a floor imports from the libraries, in words beside it."""
    to = [f"{p} {arrows[floor, p]}" for p in ("sim", "calib", "drivers") if arrows[floor, p]]
    if not to:
        return []
    return [_arrow(262, y + 20, 300, y + 20), _text(308, y + 24, ", ".join(to), 12, left=True)]


def _bow() -> str:
    return (
        '<path d="M712 64 C 775 110, 775 240, 714 282" fill="none" stroke="#445"'
        ' marker-end="url(#tip)"/>'
    )


def _box(x: int, y: int, width: int, height: int, fill: str) -> str:
    return (
        f'<rect x="{x}" y="{y}" width="{width}" height="{height}" rx="6" fill="{fill}"'
        ' stroke="#445"/>'
    )


def _text(x: int, y: int, text: str, size: int, *, bold: bool = False, left: bool = False) -> str:
    weight = ' font-weight="bold"' if bold else ""
    anchor = "start" if left else "middle"
    return (
        f'<text x="{x}" y="{y}" font-size="{size}" text-anchor="{anchor}"{weight}>'
        f"{escape(text)}</text>"
    )


def _arrow(x: int, y: int, to_x: int, to_y: int) -> str:
    return f'<path d="M{x} {y} L{to_x} {to_y}" stroke="#445" marker-end="url(#tip)"/>'


def _svg(width: int, height: int, body: Iterable[str]) -> str:
    tip = (
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7"'
        ' markerHeight="7" orient="auto"><path d="M0 0 L8 4 L0 8 z" fill="#445"/></marker></defs>'
    )
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}"'
        f' width="{width}" height="{height}" font-family="sans-serif">'
    )
    ground = f'<rect width="{width}" height="{height}" fill="#fff"/>'
    return "\n".join([head, tip, ground, *body, "</svg>"]) + "\n"


def write() -> None:
    """Write page and pictures into docs/."""
    for name, text in files().items():
        (FOLDER / name).write_text(text, encoding="utf-8")
    inside = [key for key in _arrows(grimp.build_graph("cell")) if set(key) <= set(FLOORS)]
    up = [key for key in inside if FLOORS.index(key[0]) > FLOORS.index(key[1])]
    print(f"{len(FLOORS)} floors, {len(inside)} arrows, {len(up)} upwards, circles: {circles()}")


if __name__ == "__main__":
    write()
