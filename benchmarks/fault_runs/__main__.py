"""Every fault at ten random instants of a run, as a table.

    python -m benchmarks.fault_runs [--stand ur+gige] [--only WORDS] [--instants 10] [--seed 1]

Each launch goes on with the recording that the fault before it left behind.
"""

from __future__ import annotations

from pathlib import Path

from benchmarks.fault_runs.faults import FAULTS, Fault, instants
from benchmarks.fault_runs.stands import STANDS, VIEWS, Stand
from benchmarks.fault_runs.stop_table import Judged, print_table
from benchmarks.fault_runs.trial import Trial, happening


def main() -> None:
    """Print the table; exit status 1 unless everything was as it must be."""
    print_table(
        (__doc__ or "").splitlines()[0],
        ("cell", "fault", "as it must be", "arm moved", "moved on, worst", "exit", "frames"),
        lambda stand: FAULTS[stand],
        lambda stand, folder: STANDS[stand](folder),
        trials_of,
        _row,
    )


def trials_of(
    stand: Stand, folder: Path, name: str, fault: Fault, count: int, seed: int
) -> Judged[Trial]:
    """The same fault at random instants, one after the other in one recording."""
    folder /= fault.name.replace(" ", "-")
    found: Judged[Trial] = []
    for number, instant_s in enumerate(instants(name, fault, count, seed)):
        if found and found[-1][0].frames > VIEWS // 2:
            folder = folder.with_name(f"{folder.name}-{number}")
        trial = happening(stand, folder, fault, instant_s)
        found += [] if trial is None else [(trial, trial.complaints)]
    return found


def _row(stand: str, fault: Fault, found: Judged[Trial]) -> list[str]:
    if not found:
        return [stand, fault.name, "the machine was too busy", *4 * [""]]
    trials = [trial for trial, _ in found]
    worst_s = max(trial.halted_s for trial in trials)
    moved_on = f"{worst_s:.2f} s" if fault.halt_s is not None else "-"
    return [
        stand,
        fault.name,
        f"{sum(not trial.complaints for trial in trials)} of {len(trials)}",
        f"{sum(trial.moving for trial in trials)}",
        "the run went on" if fault.survived else moved_on,
        ", ".join(sorted({str(trial.exit_status) for trial in trials})),
        f"{trials[-1].frames}",
    ]


if __name__ == "__main__":
    main()
