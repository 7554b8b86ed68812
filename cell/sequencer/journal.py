"""`journal.jsonl`: what a run did, one synced line an event; a resumed run reads it."""

from __future__ import annotations

import fcntl
import json
import os
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from cell.errors import InputError
from cell.storage.files.plan_file import Plan
from cell.storage.incoming import inside, plain_file, read_bytes
from cell.storage.incoming.limits import LOG_BYTES
from cell.storage.recording.disk import disk_errors, write_synced
from cell.storage.recording.file_watch import gone

FILE_NAME = "journal.jsonl"


class Journal:
    """Appends events: start, resume, retry, skip, frame, stop.

    Raises
    ------
    InputError
        Another process writes this recording now.
    """

    def __init__(self, folder: Path) -> None:
        path = inside(folder, FILE_NAME, f"{folder}")
        torn = plain_file(path) and not read_bytes(path, LOG_BYTES).endswith(b"\n")
        self._path = path
        self._file = path.open("ab", buffering=0)
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self._file.close()
            raise InputError(f"{folder}: another run is writing this recording now") from None
        if torn:
            self._file.write(b"\n")

    def write(self, event: str, **values: Any) -> None:
        """Append one event and sync it to the disk; raises `DiskFailed`, also where it is gone."""
        now = datetime.now(UTC).isoformat(timespec="milliseconds")
        line = json.dumps({"event": event, "at": now, **values}, default=str)
        with disk_errors(self._path):
            if os.fstat(self._file.fileno()).st_nlink == 0:
                raise gone(self._path)
            write_synced(self._file, line.encode() + b"\n")

    def close(self) -> None:
        """Let go of the file. Idempotent."""
        self._file.close()


def read_journal(folder: Path) -> list[dict[str, Any]]:
    """The events of a run; lines that a crash tore are left out."""
    path = folder / FILE_NAME
    events = []
    for line in read_bytes(path, LOG_BYTES).splitlines() if plain_file(path) else ():
        try:
            event = json.loads(line)
        except (ValueError, RecursionError):
            continue
        if isinstance(event, dict):
            events.append(event)
    return events


def check_same_plan(folder: Path, plan: Plan, *, simulated: bool) -> list[dict[str, Any]]:
    """The events of the run to go on with.

    Raises
    ------
    InputError
        There is no run to resume, its plan or cell differed, or it was simulated and this is not.
    """
    events = read_journal(folder)
    start = next((event for event in events if event.get("event") == "start"), None)
    if start is None:
        raise InputError(f"{folder}: has no {FILE_NAME} of a run to resume. Start it anew.")
    if start.get("plan_sha256") != plan.sha256:
        raise InputError(
            f"{folder}: was begun with another plan or cell than {plan.path} is now; frames of two"
            " plans are not mixed. Undo the change, or start anew with another -o."
        )
    if start.get("simulated") != simulated:
        kind = "simulated" if start.get("simulated") else "real"
        raise InputError(
            f"{folder}: was begun as a {kind} run; simulated and real frames are not mixed."
            f" {'Add' if start.get('simulated') else 'Leave out'} --dry-run."
        )
    return events


def skipped_views(events: list[dict[str, Any]]) -> dict[int, str]:
    """View number to reason, of the views that a run gave up."""
    return {
        event["view"]: str(event.get("reason"))
        for event in events
        if event.get("event") == "skip" and isinstance(event.get("view"), int)
    }
