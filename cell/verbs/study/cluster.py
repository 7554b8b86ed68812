"""The workers: processes on this machine's cores, or those of a scheduler by its address."""

from __future__ import annotations

import logging
import os
import platform
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version
from multiprocessing import resource_tracker

import dask
from distributed import Client, LocalCluster

from drivers.errors import DeviceUnreachable

# its tracebacks of lost links are no news: the messages say what they mean; its client's log has a
# level of its own
for _name in ("distributed", "distributed.client"):
    logging.getLogger(_name).setLevel(logging.CRITICAL)

PACKAGE = "calibration-cell"
REACH_S = 10.0
_WORKER_S = 60.0
_SETTINGS = {
    "distributed.nanny.pre-spawn-environ": dict.fromkeys(
        ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1"
    ),
    # a worker that died and is slow to come back on a busy machine would be given up after 15 s
    "distributed.deploy.lost-worker-timeout": "1 day",
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
}


@contextmanager
def workers_of(scheduler: str | None, count: int | None = None) -> Iterator[Client]:
    """A client whose workers can do tasks.

    Parameters
    ----------
    scheduler:
        Its address, such as ``tcp://10.0.0.5:8786``; None for processes on this machine.
    count:
        How many of those; as many as this process may use cores where None.

    Raises
    ------
    DeviceUnreachable
        No scheduler is there, it has no workers, or they cannot do this program's work.
    """
    if scheduler is None:
        with _local(count) as cluster, Client(cluster, set_as_default=False) as client:
            yield client
        return
    try:
        client = Client(scheduler, timeout=REACH_S, set_as_default=False)
    except (OSError, ValueError) as error:
        raise DeviceUnreachable(
            f"--scheduler {scheduler}: no Dask scheduler answers there ({error}). Is `dask"
            " scheduler` running, and is this its address?"
        ) from None
    with client:
        _check(client, scheduler)
        yield client


@contextmanager
def _local(count: int | None) -> Iterator[LocalCluster]:
    """One process a core, one thread each, on loopback and without a dashboard."""
    cores = count or len(os.sched_getaffinity(0))
    with dask.config.set(_SETTINGS):
        with _signals_for_us_alone():
            cluster = LocalCluster(
                n_workers=cores,
                threads_per_worker=1,
                processes=True,
                host="127.0.0.1",
                # their web servers cannot be left out; they get free ports, and no page to serve
                scheduler_kwargs={"dashboard": False, "dashboard_address": "127.0.0.1:0"},
                silence_logs=logging.CRITICAL,
            )
        with cluster:
            yield cluster


@contextmanager
def _signals_for_us_alone() -> Iterator[None]:
    """Threads and processes begun in here never hear Ctrl-C: this process alone decides."""
    # starting it later would let the signal through again
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _check(client: Client, scheduler: str) -> None:
    """Make sure that workers are there and have this program."""
    try:
        client.wait_for_workers(1, timeout=_WORKER_S)
    except TimeoutError:
        raise DeviceUnreachable(
            f"--scheduler {scheduler}: has no workers; start `dask worker {scheduler}` where they"
            " shall work"
        ) from None
    here, reported = version(PACKAGE), _versions(client)
    for who, theirs in reported.items():
        if theirs != here:
            raise DeviceUnreachable(
                f"--scheduler {scheduler}: scheduler and workers need {PACKAGE}[study] {here}, as"
                f" here; {who} has: {theirs}"
            )
    if len(reported) == 1:
        raise DeviceUnreachable(
            f"--scheduler {scheduler}: none of its workers answered in {_WORKER_S:.0f} s: all at"
            f" other work, or their Python or `distributed` differ from {_dask_here()} here"
        )


def _dask_here() -> str:
    return f"{platform.python_version()} and {version('distributed')}"


def _versions(client: Client) -> dict[str, str]:
    """The version of this program at the scheduler and by worker; who does not answer is left out.

    The scheduler unpacks what it passes on, and needs it as well.
    """

    # sent as it stands, being local: a worker that cannot import what it is sent dies of it
    def theirs(package: str) -> str:
        from importlib.metadata import PackageNotFoundError, version

        try:
            return version(package)
        except PackageNotFoundError:
            return "none"

    asked = {
        worker: client.submit(theirs, PACKAGE, workers=[worker], pure=False)
        for worker in client.nthreads()
    }
    until = time.monotonic() + _WORKER_S
    reported = {"the scheduler": client.run_on_scheduler(theirs, PACKAGE)}
    for worker, future in asked.items():
        try:
            reported[worker] = future.result(timeout=max(until - time.monotonic(), 0.1))
        except TimeoutError:
            pass
        except Exception as error:
            reported[worker] = f"failed: {type(error).__name__}: {error}"
    client.cancel(list(asked.values()))
    return reported
