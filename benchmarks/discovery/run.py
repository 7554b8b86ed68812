"""Conceal recordings, diagnose them, and count what was reported: the table of docs/discovery.md.

    python -m benchmarks.discovery.run [--clean N] [--catalogue N] [--outside N] [--faults N]
                                       [--hidden N] [--results FILE.jsonl]

The cases of each kind are taken in turn from a list that never changes; a case's name is its seed.
Each case is written to the results as it ends, and is not run again when it stands there already:
the table is printed over all of them. Hidden are cases of the catalogue's physics, diagnosed with
a catalogue that does not have it: right is `unexplained` in the right link, and no name. A case
whose physics the oracle (the true model fitted to the same frames) cannot see counts for no
measure but false names.
"""

from __future__ import annotations

import argparse
import re
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from unittest.mock import patch

import numpy as np

from benchmarks.discovery.faults import FAULTS
from benchmarks.discovery.oracle import Oracle, consult
from benchmarks.discovery.outcomes import Outcome, append_outcome, read_outcomes
from benchmarks.discovery.physics import CATALOGUE, OUTSIDE, Physics, present
from benchmarks.discovery.recordings import Concealed, conceal
from benchmarks.discovery.world import BOARDS, CAMERAS
from calib.chain.effects import catalogue
from calib.chain.model import CellModel, predict
from calib.discovery import candidates
from calib.discovery.diagnose import diagnose
from calib.discovery.diagnosis import Diagnosis
from calib.discovery.laws import contest, review
from calib.errors import CalibrationError
from calib.views import Board, Views

SIZES = (1.0, 2.5, 0.5)
BACKGROUND = ("joint_zero_offset", "link_geometry")
"""Names that are true where the arm's kinematics are off themselves."""

_NAMELESS = ("outside", "hidden")
"""Kinds of which `unexplained` is right."""

_FOUND_IN_LOG = (("optics_step",),)
"""Found by the search of the log, whatever the catalogue has."""


@dataclass(frozen=True)
class Case:
    """What to conceal: (key of physics, size) pairs, and a fault; names kept from the catalogue."""

    kind: str
    name: str
    physics: tuple[tuple[str, float], ...] = ()
    fault: str | None = None
    hidden: tuple[str, ...] = ()


def cases(kind: str) -> Iterator[Case]:
    """Every case of a kind, in an order that never changes."""
    for turn in range(1000):
        if kind == "clean":
            yield Case(kind, f"clean {turn}")
        elif kind == "catalogue":
            yield from _sized(kind, CATALOGUE, turn)
        elif kind == "hidden":
            for what in (p for p in CATALOGUE if p.names not in _FOUND_IN_LOG):
                name = f"hidden {turn}: {what.key}"
                yield Case(kind, name, ((what.key, 1.0),), hidden=what.names)
        elif kind == "outside":
            yield from _sized(kind, OUTSIDE, turn)
            first, other = OUTSIDE[turn % len(OUTSIDE)], CATALOGUE[turn % len(CATALOGUE)]
            both = ((first.key, 1.0), (other.key, 1.0))
            yield Case(kind, f"outside {turn}: {first.key} and {other.key}", both)
        else:
            for fault in FAULTS:
                yield Case(kind, f"fault {turn}: {fault.key}", (), fault.key)


def _sized(kind: str, physics: tuple[Physics, ...], turn: int) -> Iterator[Case]:
    for place, what in enumerate(physics):
        size = SIZES[(turn + place) % len(SIZES)]
        yield Case(kind, f"{kind} {turn}: {what.key} x {size:g}", ((what.key, size),))


def views_of(case: Concealed, rows: np.ndarray) -> Views:
    """Those frames as the diagnosis takes them."""
    board_rows, board_cols, square_m = BOARDS[case.cell.board]
    camera = CAMERAS[case.cell.camera]
    blank = Views.blank(
        Board("chessboard", board_rows, board_cols, square_m),
        width_px=int(camera["width"]),
        height_px=int(camera["height"]),
        frames=len(rows),
        mount="eye_in_hand" if case.cell.in_hand else "eye_to_hand",
    )
    log = {name: column[rows] for name, column in case.log.items()}
    return replace(
        blank,
        frame=rows,
        corners_px=case.pixels[rows],
        base_from_flange=log["poses"],
        joints_rad=log["joints"],
        t_s=log["t_s"],
        temperature_c=log["temperature_c"],
        exposure_s=log["exposure_s"],
        extra={name: log[name] for name in ("gain_db", "dwell_s", "clamp_N", "focus_step")},
        robot_model=case.cell.arm,
        payload_kg=0.9,
    )


@contextmanager
def without_names(names: tuple[str, ...]) -> Iterator[None]:
    """Let the diagnosis know a catalogue without these effects."""
    known = tuple(effect for effect in catalogue() if effect.name not in names)
    with ExitStack() as stack:
        for module in (candidates, contest, review):
            stack.enter_context(patch.object(module, "catalogue", lambda: known))
        yield


def run(case: Case) -> Outcome:
    """Conceal, diagnose, judge."""
    physics = tuple((present(key), size) for key, size in case.physics)
    return diagnosed(case, conceal(case.name, physics, case.fault))


def diagnosed(case: Case, concealed: Concealed) -> Outcome:
    """Diagnose what was concealed, and judge."""
    oracle = consult(concealed) if case.physics else Oracle(np.nan, np.nan, 0.0, 0)
    rows = np.arange(len(concealed.ahead))
    started = time.process_time()
    try:
        with without_names(case.hidden):
            found = diagnose(
                views_of(concealed, rows[~concealed.ahead]), log=views_of(concealed, rows)
            )
    except CalibrationError as error:
        return _refused(case, concealed, oracle, str(error), time.process_time() - started)
    return _judged(case, concealed, oracle, found, time.process_time() - started)


def _refused(case: Case, concealed: Concealed, oracle: Oracle, why: str, cpu_s: float) -> Outcome:
    return Outcome(
        case.kind, case.name, concealed.cell.board, concealed.noise, bool(concealed.cell.dh.any()),
        _sees(case, oracle), f"refused: {why}", [], False, [], None, None, None, None,
        np.nan, np.nan, oracle.plain_px, oracle.true_px, cpu_s,
    )  # fmt: skip


def _sees(case: Case, oracle: Oracle) -> bool:
    return not case.physics or oracle.detectable


def _judged(
    case: Case, concealed: Concealed, oracle: Oracle, found: Diagnosis, cpu_s: float
) -> Outcome:
    names = [effect.name for effect in found.effects]
    true = [what.names for what, _ in concealed.physics if not case.hidden]
    true += [concealed.fault.names] if concealed.fault and concealed.fault.names else []
    background = bool(concealed.cell.dh.any())
    tolerated = {name for every in true for name in every} | set(BACKGROUND if background else ())
    false = [name for name in names if name not in tolerated]
    unexplained = found.unexplained_all
    named = all(set(names) & set(every) for every in true if every)
    nameless = [what for what, _ in concealed.physics if not what.names or case.hidden]
    rejects = concealed.fault is not None and not concealed.fault.names
    ok = not false and (
        (named and not nameless and not unexplained and not rejects)
        or (bool(unexplained) and (case.kind in _NAMELESS or rejects))
    )
    link, covariate, form = _located(case, concealed, found)
    before, after = (_miss(concealed, found, cell.model) for cell in (found.plain, found.twin))
    return Outcome(
        case.kind, case.name, concealed.cell.board, concealed.noise, background,
        _sees(case, oracle), found.verdict, names, ok, false, _frame_right(concealed, found), link,
        covariate, form, before, after, oracle.plain_px, oracle.true_px, cpu_s,
    )  # fmt: skip


def _located(
    case: Case, concealed: Concealed, found: Diagnosis
) -> tuple[bool | None, bool | None, bool | None]:
    """Link, covariate and form of what has no name; a right name counts as right in all."""
    if case.kind not in _NAMELESS or found.verdict == "consistent":
        return None, None, None
    what = concealed.physics[0][0]
    if not case.hidden and any(effect.name in what.names for effect in found.effects):
        return True, True, True
    first = found.unexplained_all[0] if found.unexplained_all else None
    if first is None:
        return False, False, False
    if case.hidden:
        return first.link in what.links, None, None
    covariates = {first.covariate} | set(first.law.covariates if first.law else ())
    return (
        first.link in what.links,
        any(c in s or s in c for c in what.covariates for s in covariates),
        None if first.law is None else first.law.form in what.forms,
    )


def _frame_right(concealed: Concealed, found: Diagnosis) -> bool | None:
    if concealed.from_frame is None:
        return None
    recorded = np.flatnonzero(~concealed.ahead)
    before = int(recorded[recorded < concealed.from_frame].max(initial=-1))
    reported = {
        int(value.value)
        for effect in found.effects
        for name, value in effect.parameters.items()
        if name in ("at_frame", "from_frame")
    }
    sentences = [effect.physics for effect in found.effects]
    sentences += [term.where for term in found.unexplained_all]
    in_text = {int(number) for number in re.findall(r"\b\d+\b", " ".join(sentences))}
    inside = any(before < frame <= concealed.from_frame for frame in reported)
    return inside or concealed.from_frame in in_text


def _miss(concealed: Concealed, found: Diagnosis, model: CellModel) -> float:
    rows = np.isin(found.log.frame, np.flatnonzero(concealed.ahead))
    log = found.log.take(rows)
    miss = predict(model, log) - concealed.true_pixels[log.frame]
    return float(np.sqrt((miss**2).sum(-1).mean()))


def table(outcomes: list[Outcome]) -> str:
    """The measures of the proof, over whatever was run."""

    def of(kind: str) -> list[Outcome]:
        return [o for o in outcomes if o.kind == kind]

    def share(of_these: list[Outcome], good: list[bool]) -> str:
        return f"{sum(good)}/{len(good)}" if of_these else "-"

    seen = [o for o in of("catalogue") if o.detectable]
    out = [o for o in of("outside") if o.detectable]
    hidden = [o for o in of("hidden") if o.detectable]
    clean, faults = of("clean"), of("fault")
    gains = [
        (o.before_px - o.after_px) / (o.before_px - o.oracle_px)
        for o in out
        if o.before_px > 1.15 * o.oracle_px and np.isfinite(o.after_px)
    ]
    worse = [o.after_px > 1.05 * o.before_px + 0.02 for o in outcomes if np.isfinite(o.after_px)]
    rows = [
        ("clean called clean (background tolerated)", share(clean, [_is_clean(o) for o in clean])),
        ("catalogue: exact names and verdict", share(seen, [o.right for o in seen])),
        ("catalogue: a name that is not true",
         share(of("catalogue"), [bool(o.false_names) for o in of("catalogue")])),
        ("outside the catalogue: a wrong name", share(out, [bool(o.false_names) for o in out])),
        ("... consistent though the oracle sees it",
         share(out, [o.verdict == "consistent" for o in out])),
        *(
            (f"... {what} right", share(out, [bool(v) for v in values if v is not None]))
            for what, values in (
                ("link", [o.link_right for o in out]),
                ("covariate", [o.covariate_right for o in out]),
                ("form", [o.form_right for o in out]),
            )
        ),
        ("... held-out gain over the oracle's, median",
         f"{np.median(gains):.2f} of {len(gains)}" if gains else "-"),
        ("hidden from the catalogue: a wrong name",
         share(hidden, [bool(o.false_names) for o in hidden])),
        ("... unexplained, no name, in the right link",
         share(hidden, [o.right and bool(o.link_right) for o in hidden])),
        ("predictions worse than before", share(outcomes, worse)),
        ("faults: what is named", share(faults, [o.right for o in faults])),
        ("faults: from which frame on",
         share(faults, [bool(o.from_frame_right) for o in faults
                        if o.from_frame_right is not None])),
        ("faults: held-out error at most 1 px",
         share(faults, [o.after_px <= 1.0 for o in faults])),
        ("CPU s a case, median", f"{np.median([o.cpu_s for o in outcomes]):.1f}"),
    ]  # fmt: skip
    missed = [o for o in outcomes if o.detectable and not (o.right or _is_clean(o))]
    lines = ["| measure | value |", "|---|---|", *(f"| {what} | {value} |" for what, value in rows)]
    lines += ["", "Missed:", ""]
    lines += [
        f"- {o.name}: {o.verdict}, {', '.join(o.names) or 'no name'};"
        f" {o.before_px:.2f} -> {o.after_px:.2f} px (oracle {o.oracle_px:.2f})"
        for o in missed
    ]
    return "\n".join(lines)


def _is_clean(o: Outcome) -> bool:
    return o.kind == "clean" and not o.false_names and o.verdict != "unexplained"


def main() -> None:
    """Run what was asked for and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    for kind in ("clean", "catalogue", "outside", "faults", "hidden"):
        parser.add_argument(f"--{kind}", type=int, default=0, metavar="N")
    parser.add_argument("--results", type=Path, default=Path("discovery-benchmark.jsonl"))
    asked = parser.parse_args()
    done = read_outcomes(asked.results)
    for kind, count in (
        ("clean", asked.clean),
        ("catalogue", asked.catalogue),
        ("outside", asked.outside),
        ("fault", asked.faults),
        ("hidden", asked.hidden),
    ):
        every = cases(kind)
        for case in (next(every) for _ in range(count)):
            if case.name in done:
                continue
            outcome = done[case.name] = run(case)
            append_outcome(asked.results, outcome)
            mark = "ok " if outcome.right or _is_clean(outcome) else "BAD"
            print(
                f"{mark} {outcome.name}: {outcome.verdict} {outcome.names}"
                f" {outcome.before_px:.2f} -> {outcome.after_px:.2f}"
                f" (oracle {outcome.oracle_px:.2f}) px {outcome.cpu_s:.0f} s",
                flush=True,
            )
    print(table(list(done.values())))


if __name__ == "__main__":
    main()
