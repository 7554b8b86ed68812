"""Every fault at ten random instants of a run, as a table.

    python -m benchmarks.fault_runs [--stand ur+gige] [--only WORDS] [--instants 10] [--seed 1]

Each launch goes on with the recording that the fault before it left behind.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from benchmarks.fault_runs.faults import FAULTS, Fault, instants
from benchmarks.fault_runs.stands import STANDS, VIEWS, Stand
from benchmarks.fault_runs.trial import Trial, happening


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    asked.add_argument("--stand", choices=STANDS)
    asked.add_argument("--only", default="")
    asked.add_argument("--instants", type=int, default=10)
    asked.add_argument("--seed", type=int, default=1)
    words = asked.parse_args()
    bad = 0
    print("| cell | fault | as it must be | arm moved | moved on, worst | exit | frames |")
    print("|---|---|---|---|---|---|---|")
    for name, opened in STANDS.items():
        if words.stand not in (None, name):
            continue
        with tempfile.TemporaryDirectory() as folder, opened(Path(folder)) as stand:
            for fault in FAULTS[name]:
                if words.only in fault.name:
                    when = instants(name, fault, words.instants, words.seed)
                    trials = trials_of(
                        stand, Path(folder) / fault.name.replace(" ", "-"), fault, when
                    )
                    bad += _print(name, fault, trials)
    sys.exit(bool(bad))


def trials_of(stand: Stand, folder: Path, fault: Fault, when: list[float]) -> list[Trial]:
    """The same fault at each of these instants, one after the other in one recording."""
    trials: list[Trial] = []
    for number, instant_s in enumerate(when):
        if trials and trials[-1].frames > VIEWS // 2:
            folder = folder.with_name(f"{folder.name}-{number}")
        came = happening(stand, folder, fault, instant_s)
        trials += [came] if came is not None else []
    return trials


def _print(stand: str, fault: Fault, trials: list[Trial]) -> int:
    if not trials:
        print(f"| {stand} | {fault.name} | the machine was too busy | | | | |", flush=True)
        return 1
    good = sum(not one.complaints for one in trials)
    moving = sum(one.moving for one in trials)
    worst_s = max(one.halted_s for one in trials)
    exits = ", ".join(sorted({str(one.exit_status) for one in trials}))
    late = (
        f"{worst_s:.2f} s"
        if fault.halt_s is not None
        else "the run went on"
        if fault.survived
        else "-"
    )
    print(
        f"| {stand} | {fault.name} | {good} of {len(trials)} | {moving} | {late} | {exits}"
        f" | {trials[-1].frames} |",
        flush=True,
    )
    for one in trials:
        for complaint in one.complaints:
            print(f"{stand}: {fault.name}: {complaint}\n{one.output}", file=sys.stderr)
    return len(trials) - good


if __name__ == "__main__":
    main()
