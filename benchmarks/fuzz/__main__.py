"""``python -m benchmarks.fuzz [--inputs 5000]``: so many of every kind; exit 1 for a bad one."""

from __future__ import annotations

import argparse
import sys

from benchmarks.fuzz.campaign import bound_memory, fuzz, summary
from benchmarks.fuzz.kinds import kinds


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--inputs", type=int, default=5000, help="of every kind; a fifth of slow ones"
    )
    parser.add_argument("--only", default="", help="kinds whose name holds this")
    asked = parser.parse_args()
    bound_memory()
    total = bad = 0
    for kind in kinds():
        if asked.only in kind.name:
            outcome = fuzz(kind, asked.inputs // (5 if kind.slow else 1))
            total, bad = total + outcome.inputs, bad + len(outcome.bad)
            print(summary(kind, outcome), flush=True)
    print(f"{total} inputs, {bad} bad")
    sys.exit(bad > 0)


if __name__ == "__main__":
    main()
