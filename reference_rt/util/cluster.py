"""The workers of a Dask scheduler: on this machine, on several, or of a batch system.

Needs `distributed`, and `dask-jobqueue` for a batch system (the extra `cluster`).
"""

import asyncio
import atexit
import importlib
import math
import time
from collections.abc import Callable, Coroutine
from concurrent.futures import CancelledError, Future
from contextlib import ExitStack, suppress
from pathlib import Path
from threading import Thread
from typing import Any, TypeVar

from reference_rt.util import yaml_text
from reference_rt.util.errors import UsageError, WorkersError
from reference_rt.util.extras import needs
from reference_rt.util.files import read_text, temporary_folder

T = TypeVar("T")

_PATIENCE = 60.0
"""Seconds to wait for a scheduler and its first worker, and for an answer.  A batch system may let
jobs wait for days: for their first worker there is no limit."""

_TRY = 5.0
"""Seconds after which an attempt to connect ends.  Dask's own limit leaves out its handshake: there
it waits for ever for a program that accepts connections and says nothing."""

_ASKED = 5.0
"""Seconds between two questions to the scheduler about its workers, which come and go."""

_POLL = 0.1
"""Seconds between two attempts to connect."""

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
    another one, what was submitted is given up here, and what follows gets a new client.

    All clients run in one thread: one that cannot connect would leave a thread of its own behind.
    """

    def __init__(self, scheduler: str = "", file: Path | None = None) -> None:
        """scheduler: its address, such as tcp://host:8786;  file: in its place, a description of a
        batch system (see `batch_cluster`).  Raises UsageError, WorkersError."""
        self._address = scheduler
        self._cluster = None if file is None else batch_cluster(file)
        self._distributed = _module("distributed")
        self._client: Any = None
        self._watch: asyncio.Task[None] | None = None
        """Asks the scheduler; there is one as long as client, scheduler and workers are there."""
        self._connecting = asyncio.Lock()
        self._threads, self._is_stopped = 1, False
        self._running: set[Future[Any]] = set()
        self._submitted: set[asyncio.Task[Any]] = set()
        """Of those that run, the ones that wait for Dask's client."""
        self._thread = _LoopThread()
        try:
            self._begin(self._connected()).result()
        except BaseException:
            self.close()
            raise

    @property
    def threads(self) -> int:
        return self._threads

    def submit(self, function: Callable[..., T], *arguments: Any) -> "Future[T]":
        return self._begin(self._run(function, arguments))

    def recovers(self, error: BaseException) -> bool:
        """A function whose worker died, whose scheduler has gone, or which that gave up, is run
        again, by others."""
        distributed = self._distributed
        cancelled = CancelledError, asyncio.CancelledError, distributed.client.FutureCancelledError
        lost = distributed.KilledWorker, distributed.comm.CommClosedError, OSError
        return isinstance(error, cancelled + lost)

    def stop(self) -> None:
        self._is_stopped = True
        for found in list(self._running):
            found.cancel()

    def close(self) -> None:
        self.stop()
        self._thread.end(self._disconnect())
        with suppress(Exception):
            if self._cluster is not None:
                self._cluster.close()

    def _begin(self, run: Coroutine[Any, Any, T]) -> "Future[T]":
        """Run a coroutine in the thread of the clients, until it ends or is cancelled."""
        if self._is_stopped:
            run.close()
            ended: Future[T] = Future()
            ended.set_exception(CancelledError("stopped"))
            return ended
        found = asyncio.run_coroutine_threadsafe(run, self._thread.loop)
        self._running.add(found)
        found.add_done_callback(self._running.discard)
        if self._is_stopped:  # meanwhile, by another thread
            found.cancel()
        return found

    # ---- in the thread of the clients -----------------------------------------------------------

    async def _run(self, function: Callable[..., T], arguments: tuple[Any, ...]) -> T:
        """The result of a function, from a worker."""
        client = await self._connected()
        # Not pure: a function that is submitted again must be run again.
        given = client.submit(function, *arguments, pure=False)
        task = asyncio.current_task()
        assert task is not None
        self._submitted.add(task)
        try:
            result: T = await given
            return result
        finally:
            self._submitted.discard(task)
            given.release()  # what has not begun never runs

    async def _connected(self) -> Any:
        """A client whose scheduler has workers.  Raises WorkersError."""
        async with self._connecting:
            end = time.monotonic() + (_PATIENCE if self._cluster is None else math.inf)
            reason = "no worker"
            while self._watch is None or self._client.status != "running":
                try:
                    await asyncio.wait_for(self._connect(), _TRY)
                except Exception as error:  # connections fail in many ways
                    await self._disconnect()
                    reason = " ".join(str(error).split()) or "no answer"
                    if isinstance(error, ValueError):  # not an address
                        end = -math.inf
                if self._watch is None:
                    if time.monotonic() > end:
                        raise WorkersError(
                            f"{self._address or 'the batch system'}: no scheduler with a worker in "
                            f"{_PATIENCE:.0f} s ({reason}); expected `dask scheduler` and "
                            "`dask worker` there"
                        )
                    await asyncio.sleep(_POLL)
            return self._client

    async def _connect(self) -> None:
        """Connect to the scheduler, and ask it for its workers."""
        if self._client is None or self._client.status != "running":
            await self._disconnect()
            address, cluster = self._address, self._cluster
            self._client = self._distributed.Client(
                address if cluster is None else cluster.scheduler_address,
                security=getattr(cluster, "security", None),
                timeout=_TRY,
                asynchronous=True,
                set_as_default=False,
            )
            await self._client
        scheduler, threads = await self._ask()
        if threads > 0:
            self._threads = threads
            self._watch = asyncio.create_task(self._ask_for_ever(scheduler))

    async def _ask(self) -> tuple[str, int]:
        """The identity of the client's scheduler, and the threads of its workers."""
        known = await self._client.scheduler.identity(n_workers=0)
        return known["id"], sum((await self._client.nthreads()).values())

    async def _ask_for_ever(self, scheduler: str) -> None:
        """Ask for the threads, until the scheduler is another one or does not answer."""
        found = scheduler
        while found == scheduler:
            await asyncio.sleep(_ASKED)
            try:
                found, threads = await asyncio.wait_for(self._ask(), _PATIENCE)
                self._threads = max(1, threads)
            except Exception:  # its connection has failed in one of many ways
                found = ""
        self._give_up()

    def _give_up(self) -> None:
        """Nothing is expected of the scheduler any more."""
        if self._watch is not None and self._watch is not asyncio.current_task():
            self._watch.cancel()
        self._watch = None
        for task in self._submitted:
            task.cancel()

    async def _disconnect(self) -> None:
        """Close the client: a new one connects where a client's own attempts may have ended."""
        self._give_up()
        client, self._client = self._client, None
        if client is not None:
            with suppress(Exception):
                await asyncio.wait_for(client.close(), 1.0)


class _LoopThread(Thread):
    """An event loop in a thread of its own."""

    def __init__(self) -> None:
        super().__init__(name="cluster", daemon=True)
        self._begun: Future[tuple[asyncio.AbstractEventLoop, asyncio.Event]] = Future()
        self.start()
        self.loop, self._end = self._begun.result()

    def run(self) -> None:
        asyncio.run(self._wait())

    async def _wait(self) -> None:
        end = asyncio.Event()
        self._begun.set_result((asyncio.get_running_loop(), end))
        await end.wait()

    def end(self, last: Coroutine[Any, Any, None]) -> None:
        """End the loop and all that runs in it, after a last coroutine."""
        if not self.is_alive():
            last.close()
            return

        async def run() -> None:
            await last
            self._end.set()

        asyncio.run_coroutine_threadsafe(run(), self.loop)
        self.join()


def batch_cluster(file: Path) -> Any:
    """The workers of a batch system, as a YAML file describes them: `type` (slurm, pbs, sge, lsf,
    htcondor, oar, moab), `jobs`, how many of them, and the options of dask-jobqueue's class, such
    as queue, cores, memory, walltime.  Raises UsageError."""
    try:
        described = yaml_text.load(read_text(file))
    except yaml_text.MalformedError as error:
        line = "" if error.line is None else f":{error.line}"
        raise UsageError(f"{file}{line}: malformed: {error}; expected YAML") from None
    except (OSError, UnicodeDecodeError) as error:
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
        cluster = getattr(module, _BATCH_SYSTEMS[kind])(**_guarded(options))
        cluster.scale(jobs=jobs)
    except ImportError as error:  # without cryptography Dask makes no keys
        raise UsageError(needs("a cluster", "cluster", error.name or "cryptography")) from None
    except (TypeError, ValueError, RuntimeError, OSError) as error:
        reason = " ".join(str(error).split())
        raise UsageError(f"{file}: {reason}; expected the options of dask-jobqueue") from None
    return cluster


_NO_PAGES = {"dashboard": False, "dashboard_address": "127.0.0.1:0"}
"""Dask serves pages of its state whether there is a dashboard or not: to this machine only."""


def _guarded(options: dict[str, Any]) -> dict[str, Any]:
    """The options of a batch system, so that no stranger reaches its scheduler and its workers,
    which run whatever code a client sends: TLS with keys made for this run, one network interface,
    no dashboard.  What the options say themselves is kept; `security: false` means none, for a
    network of one's own."""
    found = dict(options)
    of_scheduler = _NO_PAGES | (found.get("scheduler_options") or {})
    if "interface" not in found and not {"host", "interface"} & of_scheduler.keys():
        of_scheduler["host"] = _module("distributed").utils.get_ip()
    found["scheduler_options"] = of_scheduler
    of_workers = ["--no-dashboard", "--dashboard-address", _NO_PAGES["dashboard_address"]]
    found["worker_extra_args"] = [*of_workers, *(found.get("worker_extra_args") or ())]
    if found.setdefault("security", True) is False:
        del found["security"]
    elif "shared_temp_directory" not in found:
        # Jobs read the keys here: in the working folder, which they see as they see the scene.
        stack = ExitStack()
        atexit.register(stack.close)
        found["shared_temp_directory"] = str(stack.enter_context(temporary_folder(Path.cwd())))
    return found


def _module(name: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise UsageError(needs("a cluster", "cluster", error.name or name)) from None
