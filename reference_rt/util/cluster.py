"""The workers of a Dask scheduler: on this machine, on several, or of a batch system.

Needs `distributed`, and `dask-jobqueue` for a batch system (the extra `cluster`).
"""

import asyncio
import importlib
import math
import time
from collections.abc import Callable
from concurrent.futures import CancelledError, Future, InvalidStateError
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

import yaml

from reference_rt.util.errors import UsageError, WorkersError
from reference_rt.util.files import read_text

T = TypeVar("T")

_PATIENCE = 60.0
"""Seconds to wait for a scheduler and its first worker.  A batch system may let jobs wait for days:
for these there is no limit."""

_ASKED = 5.0
"""Seconds after which the scheduler is asked for its workers, which come and go."""

_POLL = 0.1
"""Seconds between two looks for a scheduler and its first worker."""

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
    """`workers.Workers`: the workers of a Dask scheduler, of any number of threads each.

    Every future ends, whatever becomes of the scheduler.  Dask's client ends most futures of a
    scheduler that has gone, but not those that were submitted while it was ending: a render waited
    for them for ever.  So the scheduler is asked now and then.  If it does not answer, or is
    another one, all futures are given up here, and a new client connects.
    """

    def __init__(self, scheduler: str = "", file: Path | None = None) -> None:
        """scheduler: its address, such as tcp://host:8786;  file: in its place, a description of a
        batch system (see `batch_cluster`).  Raises UsageError, WorkersError."""
        self._address = scheduler
        self._cluster = None if file is None else batch_cluster(file)
        self._distributed = _module("distributed")
        self._client: Any = None
        self._scheduler_id, self._asked, self._threads = "", 0.0, 1
        self._is_connected = self._is_stopped = False
        self._running: dict[Future[Any], Any] = {}
        """Futures that have not ended, and those of Dask from which they get their results."""
        try:
            self._connect()
        except BaseException:
            self.close()
            raise

    @property
    def threads(self) -> int:
        if self._is_connected and time.monotonic() - self._asked > _ASKED:
            try:
                found, threads = self._ask()
            except Exception:  # its connection has failed in one of many ways
                found = ""
            if found == self._scheduler_id:
                self._threads, self._asked = max(1, threads), time.monotonic()
            else:
                self._disconnect()
        return self._threads

    def submit(self, function: Callable[..., T], *arguments: Any) -> "Future[T]":
        found: Future[T] = Future()
        if not self._is_connected or self._client.status != "running":
            self._connect()
        if self._is_connected:
            try:
                # Not pure: a function that is submitted again must be run again.
                given = self._client.submit(function, *arguments, pure=False)
            except Exception:
                if self._client.status == "running":
                    raise
                _end(found, CancelledError("the client has closed itself"))
                return found
            self._running[found] = given
            found.add_done_callback(self._ended)
            self._client.loop.add_callback(_pass_on, given, found)
        if self._is_stopped:  # perhaps meanwhile, by another thread
            self._give_up()
            _end(found, CancelledError("stopped"))
        return found

    def recovers(self, error: BaseException) -> bool:
        """A function whose worker died, whose scheduler has gone, or which that gave up, is run
        again, by others."""
        distributed = self._distributed
        cancelled = CancelledError, asyncio.CancelledError, distributed.client.FutureCancelledError
        lost = distributed.KilledWorker, distributed.comm.CommClosedError, OSError
        return isinstance(error, cancelled + lost)

    def stop(self) -> None:
        self._is_stopped = True
        self._give_up()

    def close(self) -> None:
        self.stop()
        self._disconnect()
        with suppress(Exception):
            if self._cluster is not None:
                self._cluster.close()

    def _give_up(self) -> None:
        for found in list(self._running):
            _end(found, CancelledError("given up"))

    def _ended(self, found: "Future[Any]") -> None:
        """A future has its result, or was given up: then nobody needs that of Dask."""
        given = self._running.pop(found, None)
        if given is not None and not given.done():
            with suppress(Exception):  # its client may be closed
                given.client.loop.add_callback(given.cancel)

    def _ask(self) -> tuple[str, int]:
        """The identity of the client's scheduler, and the threads of its workers."""
        # The first call returns what it remembers if there is no answer, the second one raises.
        found = self._client.scheduler_info(n_workers=0)["id"]
        return found, sum(self._client.nthreads().values())

    def _connect(self) -> None:
        """A new client, once there is a scheduler and a worker.  Returns without one if `stop` is
        called meanwhile.  Raises WorkersError."""
        self._disconnect()
        end = time.monotonic() + (_PATIENCE if self._cluster is None else math.inf)
        target = self._cluster if self._cluster is not None else self._address
        reason = "no worker"
        while not self._is_stopped:
            try:
                if self._client is None or self._client.status != "running":
                    self._client = self._distributed.Client(target, timeout=5, set_as_default=False)
                self._scheduler_id, threads = self._ask()
                if threads > 0:
                    self._threads, self._asked = threads, time.monotonic()
                    self._is_connected = True
                    return
            except Exception as error:  # connections fail in many ways
                self._disconnect()
                reason = " ".join(str(error).split())
                if isinstance(error, ValueError):  # not an address
                    end = -math.inf
            if time.monotonic() > end:
                raise WorkersError(
                    f"{self._address or 'the batch system'}: no scheduler with a worker in "
                    f"{_PATIENCE:.0f} s ({reason}); expected `dask scheduler` and `dask worker` "
                    "there"
                )
            time.sleep(_POLL)

    def _disconnect(self) -> None:
        """Close the client: a new one connects where a client's own attempts may have ended."""
        self._is_connected = False
        self._give_up()
        with suppress(Exception):
            if self._client is not None:
                self._client.close(timeout=1)
        self._client = None


async def _pass_on(given: Any, found: "Future[Any]") -> None:
    """In the client's thread: end a future as that of Dask ends."""
    try:
        result = await given
    except BaseException as error:
        _end(found, error)
    else:
        with suppress(InvalidStateError):  # it was given up meanwhile
            found.set_result(result)


def _end(found: "Future[Any]", error: BaseException) -> None:
    with suppress(InvalidStateError):  # it has ended already
        found.set_exception(error)


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
