"""The workers of a Dask scheduler: on this machine, on several, or of a batch system.

Needs `distributed`, and `dask-jobqueue` for a batch system (the extra `cluster`).
"""

import importlib
import math
import time
from collections.abc import Callable
from concurrent.futures import CancelledError, Future
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar
from weakref import WeakSet

import yaml

from reference_rt.util.errors import UsageError, WorkersError
from reference_rt.util.files import read_text

T = TypeVar("T")

_PATIENCE = 60.0
"""Seconds to wait for a scheduler and its first worker.  A batch system may let jobs wait for days:
for these there is no limit."""

_COUNTED = 5.0
"""Seconds between two counts of the workers, which come and go."""

_BATCH_SYSTEMS = {
    "slurm": "SLURMCluster",
    "pbs": "PBSCluster",
    "sge": "SGECluster",
    "lsf": "LSFCluster",
    "htcondor": "HTCondorCluster",
    "oar": "OARCluster",
    "moab": "MoabCluster",
}


class Cluster:
    """`workers.Workers`: the workers of a Dask scheduler, of any number of threads each."""

    def __init__(self, scheduler: str = "", file: Path | None = None) -> None:
        """scheduler: its address, such as tcp://host:8786;  file: in its place, a description of a
        batch system (see `batch_cluster`).  Raises UsageError, WorkersError."""
        self._address = scheduler
        self._cluster = None if file is None else batch_cluster(file)
        self._distributed = _module("distributed")
        self._client: Any = None
        self._executor: Any = None
        self._counted, self._threads = 0.0, 1
        self._scheduler_id, self._futures = "", WeakSet[Future[Any]]()
        try:
            self._connect()
        except BaseException:
            self.close()
            raise

    @property
    def threads(self) -> int:
        now = time.monotonic()
        if now - self._counted > _COUNTED:
            self._counted = now
            with suppress(Exception):  # the scheduler may be gone for a moment
                self._threads = max(1, sum(self._client.nthreads().values()))
                self._give_up_lost()
        return self._threads

    def _give_up_lost(self) -> None:
        """Cancel what was submitted to a scheduler that has been replaced by a new one at its
        address.  The client tells of most such futures, but not of those that it submitted while
        the old one was ending (found under load: they never ended)."""
        # A lambda: sent by value, so that the scheduler need not have this package.
        found = self._client.run_on_scheduler(lambda dask_scheduler: str(dask_scheduler.id))
        if self._scheduler_id not in ("", found):
            for future in list(self._futures):
                future.cancel()
        self._scheduler_id = found

    def submit(self, function: Callable[..., T], *arguments: Any) -> "Future[T]":
        found: Future[T]
        try:
            found = self._executor.submit(function, *arguments)
        except Exception:  # the client has given up a scheduler that has gone
            self._connect()
            found = self._executor.submit(function, *arguments)
        self._futures.add(found)
        return found

    def recovers(self, error: BaseException) -> bool:
        """A function whose worker died, whose scheduler has gone, or which that gave up, is run
        again, by others."""
        lost = (
            CancelledError,
            OSError,
            self._distributed.KilledWorker,
            self._distributed.comm.CommClosedError,
            self._distributed.client.FutureCancelledError,
        )
        if not isinstance(error, lost):
            return False
        if self._client.status != "running":
            self._connect()
        return True

    def stop(self) -> None:
        with suppress(Exception):
            self._executor.shutdown(wait=False, cancel_futures=True)

    def close(self) -> None:
        with suppress(Exception):
            self._executor.shutdown(wait=False, cancel_futures=True)
        for one in (self._client, self._cluster):
            with suppress(Exception):
                if one is not None:
                    one.close()

    def _connect(self) -> None:
        """A new client, once there is a scheduler and a worker."""
        patience = _PATIENCE if self._cluster is None else math.inf
        end = time.monotonic() + patience
        if self._client is not None:
            with suppress(Exception):
                self._client.close(timeout=1)
        target = self._cluster if self._cluster is not None else self._address
        while True:
            try:
                client = self._distributed.Client(target, timeout=5, set_as_default=False)
                left = None if patience == math.inf else max(1.0, end - time.monotonic())
                client.wait_for_workers(1, timeout=left)
                break
            except (OSError, TimeoutError, ValueError) as error:
                if isinstance(error, ValueError) or time.monotonic() > end:
                    raise WorkersError(
                        f"{self._address or 'the batch system'}: no scheduler with a worker in "
                        f"{_PATIENCE:.0f} s; expected `dask scheduler` and `dask worker` there"
                    ) from None
        self._client = client
        # Not pure: a function that is submitted again must be run again.
        self._executor = client.get_executor(pure=False)


def batch_cluster(file: Path) -> Any:
    """The workers of a batch system, as a YAML file describes them: `type` (slurm, pbs, sge, lsf,
    htcondor, oar, moab), `jobs`, how many of them, and the options of dask-jobqueue's class, such
    as queue, cores, memory, walltime.  Raises UsageError."""
    try:
        described = yaml.safe_load(read_text(file))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        reason = " ".join(str(error).split())
        raise UsageError(f"{file}: cannot be read: {reason}; expected YAML") from None
    options = dict(described) if isinstance(described, dict) else {}
    kind, jobs = options.pop("type", None), options.pop("jobs", None)
    if not isinstance(kind, str) or kind not in _BATCH_SYSTEMS:
        raise UsageError(f"{file}: type: expected one of {', '.join(_BATCH_SYSTEMS)}, got '{kind}'")
    if not isinstance(jobs, int) or isinstance(jobs, bool) or jobs < 1:
        raise UsageError(f"{file}: jobs: expected the number of jobs, at least 1, got '{jobs}'")
    module = _module("dask_jobqueue")
    try:
        cluster = getattr(module, _BATCH_SYSTEMS[kind])(**options)
        cluster.scale(jobs=jobs)
    except (TypeError, ValueError, RuntimeError, OSError) as error:
        reason = " ".join(str(error).split())
        raise UsageError(f"{file}: {reason}; expected the options of dask-jobqueue") from None
    return cluster


def _module(name: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError:
        raise UsageError(
            f"{name.replace('_', '-')} is not installed; expected "
            "`pip install 'reference-rt[cluster]'`"
        ) from None
