"""`cell run` in a process of its own, forked from one that has imported everything already."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import sys
import threading
import time
from multiprocessing.connection import Connection
from pathlib import Path

from cell.sequencer.journal import read_journal

_FORKS = multiprocessing.get_context("forkserver")
_FORKS.set_forkserver_preload(["cell.cli", "cell.verbs.run", "cell.cli.run"])
_START_S = 30.0


class Launch:
    """One `cell run PLAN -o FOLDER --record-only`, with --resume where the folder is there.

    Attributes
    ----------
    pid:
        Of the process, for signals.
    """

    def __init__(self, plan: Path, folder: Path) -> None:
        arguments = ["run", str(plan), "-o", str(folder), "--record-only"]
        if folder.exists():
            arguments.append("--resume")
        self._folder = folder
        self._events_before = len(read_journal(folder))
        self._heard: list[bytes] = []
        here, there = _FORKS.Pipe(duplex=False)
        self._process = _FORKS.Process(target=_cell, args=(arguments, there), daemon=True)
        self._process.start()
        there.close()
        assert self._process.pid is not None
        self.pid = self._process.pid
        self._listener = threading.Thread(target=self._listen, args=(here,), daemon=True)
        self._listener.start()

    @property
    def ended(self) -> bool:
        """Whether the process is gone."""
        return self._process.exitcode is not None

    @property
    def exit_status(self) -> int | None:
        """As a shell would have it, a signal's number below zero; None while it runs."""
        return self._process.exitcode

    @property
    def output(self) -> str:
        """What came on stdout and stderr so far."""
        return b"".join(self._heard).decode(errors="replace")

    def began(self) -> bool:
        """Wait until the journal says that the run began; False where it ended before."""
        deadline_s = time.monotonic() + _START_S
        while time.monotonic() < deadline_s and not self.ended:
            if len(read_journal(self._folder)) > self._events_before:
                return True
            time.sleep(0.005)
        return False

    def send(self, number: signal.Signals) -> None:
        """Send it a signal."""
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.pid, number)

    def finish(self) -> None:
        """Wait until it is gone, whatever it takes."""
        self._process.join(1.0)
        if self._process.exitcode is None:
            self._process.kill()
            self._process.join()
        self._listener.join(1.0)

    def _listen(self, source: Connection) -> None:
        with contextlib.suppress(OSError), source:
            while chunk := os.read(source.fileno(), 65536):
                self._heard.append(chunk)


def _cell(arguments: list[str], output: Connection) -> None:
    os.dup2(output.fileno(), 1)
    os.dup2(output.fileno(), 2)
    output.close()
    os.setsid()
    sys.argv = ["cell", *arguments]
    from cell.cli import main

    main()
