"""What came of concealed cases, kept in a file so that none is run twice."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path


@dataclass(frozen=True)
class Outcome:
    """What came of a case; px are RMS over the corners of frames never shown, noise free."""

    kind: str
    name: str
    board: str
    noise: str
    background: bool
    detectable: bool
    verdict: str
    names: list[str]
    right: bool
    false_names: list[str]
    from_frame_right: bool | None
    link_right: bool | None
    covariate_right: bool | None
    form_right: bool | None
    before_px: float
    after_px: float
    plain_px: float
    oracle_px: float
    cpu_s: float


def read_outcomes(path: Path) -> dict[str, Outcome]:
    """Those in a file of results, by the case's name; none where there is no file."""
    if not path.exists():
        return {}
    lines = path.read_text(encoding="utf-8").splitlines()
    return {outcome.name: outcome for outcome in (Outcome(**json.loads(line)) for line in lines)}


def append_outcome(path: Path, outcome: Outcome) -> None:
    """Keep one more, as a line."""
    with path.open("a", encoding="utf-8") as file:
        file.write(json.dumps(asdict(outcome)) + "\n")
