"""A scheduler and a worker that share nothing with the client but a port; and one that dies."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from cell.verbs.study.folder import RESULTS
from tests.study.studies import seeds, write_study

pytestmark = pytest.mark.slow

Process = subprocess.Popen[bytes]
CELL = "from cell.cli import main; main()"


def _elsewhere(folder: Path) -> dict[str, str]:
    """The environment of a machine with a home and temporary files of its own."""
    for name in ("home", "tmp"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    return {**os.environ, "HOME": str(folder / "home"), "TMPDIR": str(folder / "tmp")}


@contextmanager
def _running(folder: Path, module: str, *words: str) -> Iterator[Process]:
    """A program of Dask's in a session of its own, killed in the end with all it began."""
    process = subprocess.Popen(
        [sys.executable, "-m", f"distributed.cli.{module}", *words],
        cwd=folder,
        env=_elsewhere(folder),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        yield process
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


@contextmanager
def _cluster(folder: Path, port: int) -> Iterator[tuple[Process, Process]]:
    """A scheduler at that port, and a worker."""
    with ExitStack() as stack:
        scheduler = stack.enter_context(
            _running(folder, "dask_scheduler", *_at(port), "--no-dashboard")
        )
        while not _answers(port):
            assert scheduler.poll() is None
            time.sleep(0.05)
        worker = stack.enter_context(
            _running(
                folder,
                "dask_worker",
                f"tcp://127.0.0.1:{port}",
                "--nthreads",
                "1",
                "--no-dashboard",
            )
        )
        yield scheduler, worker


def _at(port: int) -> tuple[str, ...]:
    return "--host", "127.0.0.1", "--port", str(port)


def _answers(port: int) -> bool:
    with socket.socket() as link:
        return link.connect_ex(("127.0.0.1", port)) == 0


def _free_port() -> int:
    with socket.socket() as link:
        link.bind(("127.0.0.1", 0))
        return int(link.getsockname()[1])


def test_a_cluster_that_dies_bit_by_bit_costs_nothing_that_was_done(tmp_path: Path) -> None:
    here, there, port = tmp_path / "client", tmp_path / "cluster", _free_port()
    for folder in (here, there):
        folder.mkdir()
    address = f"tcp://127.0.0.1:{port}"
    study = write_study(here, seeds(6)).name
    words = [sys.executable, "-c", CELL, "study", study, "-o", "out", "--scheduler", address]
    parts = here / "out" / RESULTS
    with _cluster(there, port) as (scheduler, worker):
        client = subprocess.Popen(words, cwd=here, stderr=subprocess.PIPE, text=True)
        assert client.stderr is not None
        while not list(parts.glob("part-*")):
            assert client.poll() is None, client.stderr.read()
            time.sleep(0.02)
        os.killpg(worker.pid, signal.SIGKILL)
        # where nothing was compiled before, the first line says so
        first = (line for line in client.stderr if "compiling" not in line)
        assert f"{address} has no workers any more" in next(first)
        scheduler.kill()
        _, output = client.communicate(timeout=120)
    assert client.returncode == 3, output
    assert output == (
        "error: the Dask scheduler went away; what was done is written: give the same command"
        " again when it is back\n"
    )
    done = pq.read_table(parts).to_pylist()
    assert 0 < len(done) < 6
    with _cluster(there, port):
        again = subprocess.run(words, cwd=here, capture_output=True, text=True, timeout=300)
    assert again.returncode == 0, again.stderr
    assert "6 tasks, 0 failed" in again.stdout
    rows = pq.read_table(parts).to_pylist()
    assert sorted(row["seed"] for row in rows) == list(range(6))
    assert [row for row in rows if row in done] == done
