"""The kinds of study, one file each."""

from __future__ import annotations

from cell.storage.files.study_file import Study
from cell.verbs.study.kinds import monte_carlo, power, recordings
from cell.verbs.study.kinds.kind import Kind, Row, Task

_KINDS = {
    "monte_carlo": monte_carlo.KIND,
    "power": power.KIND,
    "recordings": recordings.KIND,
}


def kind_of(study: Study) -> Kind:
    """The kind of a study."""
    return _KINDS[study.file.kind]


__all__ = ["Kind", "Row", "Task", "kind_of"]
