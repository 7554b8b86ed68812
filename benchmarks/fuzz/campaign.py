"""Runs mutated inputs through their readers, with CPU and memory bounded."""

from __future__ import annotations

import logging
import random
import resource
import signal
import tempfile
import time
import traceback
import zlib
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType

from benchmarks.fuzz.kind import Kind
from benchmarks.fuzz.mutations import mutated

CPU_S = 5.0
"""CPU time that one input may take."""
MEMORY_BYTES = 2**30
"""Address space beyond what the libraries have mapped."""


class TooLong(BaseException):
    """An input took more than `CPU_S`."""


@dataclass
class Outcome:
    """What became of a kind's inputs.

    Attributes
    ----------
    bad:
        Number of the input, and what it made the reader raise that is no refusal.
    slowest_s:
        CPU time of the slowest.
    """

    inputs: int = 0
    refused: int = 0
    slowest_s: float = 0.0
    bad: dict[int, str] = field(default_factory=dict)


def fuzz(kind: Kind, inputs: int, first: int = 0) -> Outcome:
    """Read `inputs` mutations of a kind, numbered from `first`; the same ones every time."""
    outcome = Outcome()
    logging.disable(logging.CRITICAL)
    before = signal.signal(signal.SIGVTALRM, _too_long)
    try:
        with tempfile.TemporaryDirectory() as name:
            for number in range(first, first + inputs):
                _one(kind, number, Path(name), outcome)
    finally:
        signal.signal(signal.SIGVTALRM, before)
        logging.disable(logging.NOTSET)
    return outcome


def input_of(kind: Kind, number: int) -> bytes:
    """The input of a number."""
    rng = random.Random(zlib.crc32(f"{kind.name}/{number}".encode()))
    return mutated(rng.choice(kind.examples), rng)


def _one(kind: Kind, number: int, folder: Path, outcome: Outcome) -> None:
    data = input_of(kind, number)
    outcome.inputs += 1
    began_s = time.process_time()
    signal.setitimer(signal.ITIMER_VIRTUAL, CPU_S)
    try:
        kind.read(folder, data)
    except kind.refused:
        outcome.refused += 1
    except (Exception, TooLong) as fault:
        at = traceback.extract_tb(fault.__traceback__)[-1]
        outcome.bad[number] = f"{type(fault).__name__} at {Path(at.filename).name}:{at.lineno}"
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
    outcome.slowest_s = max(outcome.slowest_s, time.process_time() - began_s)


def bound_memory() -> None:
    """Let this process have no more than `MEMORY_BYTES` beyond what it has."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    limit = pages * resource.getpagesize() + MEMORY_BYTES
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


def summary(kind: Kind, outcome: Outcome) -> str:
    """One line."""
    kinds = Counter(outcome.bad.values())
    reported = "; ".join(f"{count} x {what}" for what, count in kinds.most_common(3))
    return (
        f"{kind.name:28s} {outcome.inputs:7d} inputs {outcome.refused:7d} refused"
        f" {len(outcome.bad):4d} bad {outcome.slowest_s:6.2f} s {reported}"
    )


def _too_long(number: int, frame: FrameType | None) -> None:
    raise TooLong
