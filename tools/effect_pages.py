"""Writes docs/effects/: a page for each effect of the catalogue, from what its own file says.

``python tools/effect_pages.py`` writes them anew; tests/docs keeps them in step.
"""

from __future__ import annotations

from itertools import groupby
from pathlib import Path

from calib.chain.effect import LINKS, Effect, Parameter
from calib.chain.effects import catalogue
from calib.discovery.ambiguity import experiment
from cell.views.report.evidence.registry import EVIDENCE

FOLDER = Path(__file__).parents[1] / "docs" / "effects"
_PLAN = "configs/irb140-eosens.plan.yaml"
_MIDDLE_FRAME = 20
_ROLES = {
    "amount": "zero where the effect is absent; fitted",
    "shape": "fitted once the effect is there",
    "setting": "chosen among values that suit the recording, not fitted",
}


def by_name() -> dict[str, tuple[Effect, ...]]:
    """The laws of each effect."""
    ordered = sorted(catalogue(), key=lambda effect: effect.name)
    return {name: tuple(laws) for name, laws in groupby(ordered, key=lambda e: e.name)}


def pages() -> dict[str, str]:
    """File name to text, the overview included."""
    found = {f"{name}.md": _page(name, laws) for name, laws in by_name().items()}
    return {"index.md": _overview(), **found}


def _overview() -> str:
    lines = [
        "# The catalogue of effects",
        "",
        "Made by `tools/effect_pages.py` from `calib/chain/effects/`. Each is simulated by "
        "`cell simulate --effect`, fitted, and searched for by `cell diagnose`, all three by the "
        "same few lines. Mix-ups in the log are in [log consistency](../log-consistency.md).",
        "",
        "| link | effect | what happens |",
        "|---|---|---|",
    ]
    for link in LINKS:
        for name, laws in by_name().items():
            if laws[0].link == link:
                lines.append(f"| {link} | [`{name}`]({name}.md) | {laws[0].physics} |")
    return "\n".join(lines) + "\n"


def _page(name: str, laws: tuple[Effect, ...]) -> str:
    first = laws[0]
    parts = [f"# {name}", f"Link: {first.link}. {first.physics}"]
    parts += [_law(effect) for effect in laws]
    parts.append("## To be seen, it needs\n\n" + _needs(first))
    parts.append("## What looks alike\n\n" + _rivals(first))
    picture = EVIDENCE.get(name) or EVIDENCE[first.link]
    parts.append(f"## In the report\n\n{picture.look_for} Drawn from {picture.needs}.")
    parts.append(f"## What to do\n\n{first.remedy}")
    parts.append("## Try it\n\n" + "\n".join(_command(effect) for effect in laws))
    return "\n\n".join(parts) + "\n"


def _law(effect: Effect) -> str:
    title = "## The physics" if effect.law is None else f"## Law `{effect.law}`"
    table = ["| parameter | unit | typical | from, to | |", "|---|---|---|---|---|"]
    table += [_row(p) for p in effect.parameters]
    equation = f"    {effect.equation}"
    return "\n\n".join([title, equation, f"Source: {effect.source}.", "\n".join(table)])


def _row(p: Parameter) -> str:
    role = _ROLES[p.role]
    if not p.identifiable:
        role = "simulated only: hand-eye or board pose absorb it"
    return f"| `{p.name}` | {p.unit} | {p.typical:g} | {p.low:g}, {p.high:g} | {role} |"


def _needs(effect: Effect) -> str:
    columns = ", ".join(f"`{column}`" for column in effect.needs)
    log = f"In the log: {columns}." if columns else "Nothing beyond pictures and flange poses."
    if effect.varies:
        log += " Varied in the run: " + " or ".join(f"`{key}`" for key in effect.varies) + "."
    moved = " Frames taken while the arm moves (`capture: {mode: moving}`)."
    return log + (moved if effect.moving_only else "")


def _rivals(effect: Effect) -> str:
    known = by_name()
    if not effect.confounded_with:
        return "Nothing else in the catalogue."
    return "\n".join(_rival(effect, known[name][0]) for name in effect.confounded_with)


def _rival(effect: Effect, rival: Effect) -> str:
    return f"- [`{rival.name}`]({rival.name}.md). To distinguish them: {experiment(effect, rival)}."


def _command(effect: Effect) -> str:
    numbers = [f"{p.name}={_example(p):g}" for p in effect.parameters if p.identifiable]
    given = ",".join([f"law={effect.law}", *numbers] if effect.law else numbers)
    folder = effect.label.replace(":", "-")
    return f"    cell simulate {_PLAN} --effect {effect.name}:{given} -o runs/{folder}"


def _example(p: Parameter) -> float:
    """A value that shows: a slip before the first frame would be none."""
    return _MIDDLE_FRAME if p.name == "at_frame" else p.typical


def write_all() -> None:
    """Write every page, and remove those of effects that are gone."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    wanted = pages()
    for path in FOLDER.glob("*.md"):
        if path.name not in wanted:
            path.unlink()
    for name, text in wanted.items():
        (FOLDER / name).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    write_all()
