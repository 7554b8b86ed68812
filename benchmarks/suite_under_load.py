"""The tests, several times, while every core is kept busy besides.

    python -m benchmarks.suite_under_load [--times 3] [--busy 2] [--output FILE] [-- OPTIONS]

OPTIONS are pytest's; without any the whole suite runs. `--busy` processes that only compute run
beside it (one for each core unless it is given), at the tests' own priority. One line a run: tests
passed, failed, duration, load; the names of failed tests follow, and FILE takes all that pytest
wrote. Exit status 1 where a test of any run failed.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import Process
from pathlib import Path

ROOT = Path(__file__).parents[1]
_COUNTED = re.compile(r"(\d+) (passed|failed|error)")


def compute() -> None:
    """Keep one core busy until killed."""
    number = 1
    while os.getppid() > 1:  # a generator that outlives its parent would load the machine for ever
        for _ in range(1_000_000):
            number = number * 1103515245 % 2147483647


@contextmanager
def load(busy: int) -> Iterator[None]:
    """So many processes that compute."""
    processes = [Process(target=compute, daemon=True) for _ in range(busy)]
    for process in processes:
        process.start()
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.join()


def run(options: list[str], output: Path | None) -> tuple[bool, str]:
    """Run pytest once; returns whether all passed, and the line of it."""
    began_s = time.monotonic()
    command = [sys.executable, "-m", "pytest", "-rfE", *options]
    wide = os.environ | {"COLUMNS": "200"}  # or the reasons of failures are cut off
    run_ = subprocess.run(command, cwd=ROOT, env=wide, capture_output=True, text=True, check=False)
    if output is not None:
        with output.open("a") as file:
            file.write(run_.stdout + run_.stderr)
    counted = {what: int(count) for count, what in _COUNTED.findall(run_.stdout[-400:])}
    failed = re.findall(r"(?m)^(?:FAILED|ERROR) .*$", run_.stdout)
    line = (
        f"{counted.get('passed', 0)} passed, {len(failed)} failed,"
        f" {time.monotonic() - began_s:.0f} s, load {os.getloadavg()[0]:.1f}"
    )
    unforeseen = [] if run_.returncode in (0, 1) else [run_.stdout[-2000:] + run_.stderr[-2000:]]
    return run_.returncode == 0, "\n    ".join([line, *failed, *unforeseen])


def main() -> None:
    """Print a line a run."""
    asked = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    asked.add_argument("--times", type=int, default=3)
    asked.add_argument("--busy", type=int, default=os.cpu_count() or 2)
    asked.add_argument("--output", type=Path)
    asked.add_argument("options", nargs="*", help="for pytest; after a --")
    given = asked.parse_args()
    good = True
    with load(given.busy):
        for number in range(given.times):
            passed, line = run(given.options, given.output)
            good = good and passed
            print(f"run {number + 1}: {line}", flush=True)
    sys.exit(not good)


if __name__ == "__main__":
    main()
