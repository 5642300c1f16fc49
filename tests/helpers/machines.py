"""A Dask scheduler and workers as processes, as on several machines."""

import gc
import os
import socket
import subprocess
import sys

from builders import HELPERS

PATH = os.pathsep.join([str(HELPERS), os.environ.get("PYTHONPATH", "")]).rstrip(os.pathsep)
"""Where workers find the helpers of tests."""


class Machines:
    """A scheduler and workers, each a process, as on several machines."""

    def __init__(self, folder):
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.address, self.folder = f"tcp://127.0.0.1:{self.port}", folder
        self.processes, self.workers = [], []
        self.start_scheduler()

    def _start(self, *command):
        log = (self.folder / f"log-{len(self.processes)}").open("w")
        process = subprocess.Popen(
            [sys.executable, "-m", "distributed.cli." + command[0], *command[1:]],
            stdout=log,
            stderr=log,
            cwd=self.folder,
            env={**os.environ, "PYTHONPATH": PATH},
        )
        self.processes.append(process)
        return process

    def start_scheduler(self):
        self.scheduler = self._start(
            "dask_scheduler", "--host", "127.0.0.1", "--port", str(self.port), "--no-dashboard"
        )

    def start_worker(self):
        command = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--memory-limit", "0")
        self.workers.append(self._start("dask_worker", self.address, *command))

    def end(self):
        """In a test's teardown, where warnings are ignored: Dask's clients leave sockets to the
        garbage collector, which otherwise warns of them in whatever test it runs."""
        for process in self.processes:
            process.kill()
            process.wait()
        gc.collect()
