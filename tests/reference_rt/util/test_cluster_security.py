"""A stranger who reaches the scheduler of a batch system is refused."""

import asyncio
import gc
import os
import sys

import pytest

from reference_rt.util.cluster import Cluster

distributed = pytest.importorskip("distributed")
psutil = pytest.importorskip("psutil")  # which distributed needs
pytest.importorskip("dask_jobqueue")

pytestmark = [
    pytest.mark.filterwarnings("ignore"),  # those of distributed are not ours
    pytest.mark.skipif(os.name != "posix", reason="a shell script stands for Slurm"),
]


@pytest.fixture
def started(tmp_path, monkeypatch):
    """started(options) is a cluster of a Slurm that runs its jobs at once, and its description."""
    for name, text in {
        # As Slurm does, it copies the script, which is deleted when this returns.
        "sbatch": f'cp "$1" {tmp_path}/$$; setsid sh {tmp_path}/$$ > {tmp_path}/log 2>&1 & '
        "echo job $!",
        "scancel": 'kill -- "-$1"',
    }.items():
        (tmp_path / name).write_text(f"#!/bin/sh\n{text}\n")
        (tmp_path / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    monkeypatch.chdir(tmp_path)
    found = []

    def start(more=""):
        (tmp_path / "slurm.yaml").write_text(
            "type: slurm\njobs: 1\ncores: 1\nprocesses: 1\nmemory: 1GB\nwalltime: '01:00:00'\n"
            f"python: {sys.executable}\nlocal_directory: {tmp_path}\n{more}"
        )
        found.append(Cluster(file=tmp_path / "slurm.yaml"))
        return found[-1]

    yield start
    for cluster in found:
        cluster.close()
    gc.collect()  # else it warns of Dask's sockets in whatever test it runs


def can_connect(address, security, seconds=2.0):
    """A stranger is refused, and tries again, until the time is over."""

    async def connect():
        client = distributed.Client(
            address, security=security, timeout=seconds, asynchronous=True, set_as_default=False
        )
        try:
            await asyncio.wait_for(client, 5.0 * seconds)
            return True
        except (OSError, TimeoutError):
            return False
        finally:
            await client.close()

    return asyncio.run(connect())


def test_strangers_are_refused(started, tmp_path):
    before = {c.laddr for c in psutil.Process().net_connections() if c.status == "LISTEN"}
    cluster = started()
    assert cluster.submit(abs, -3).result(600.0) == 3
    inner = cluster._cluster
    address = inner.scheduler_address
    assert address.startswith("tls://")
    assert can_connect(address, inner.security, 600.0)
    assert not can_connect(address, distributed.Security.temporary())
    assert not can_connect(address.replace("tls", "tcp"), None)
    listens = {c.laddr for c in psutil.Process().net_connections() if c.status == "LISTEN"} - before
    host = address.removeprefix("tls://").rpartition(":")[0]
    assert {place.ip for place in listens} <= {host, "127.0.0.1"}
    (job,) = inner.workers.values()
    assert "--no-dashboard --dashboard-address 127.0.0.1:0" in job.job_script()
    (keys,) = tmp_path.glob(".reference_rt-*/files")
    assert keys.stat().st_mode & 0o077 == 0
    assert any(keys.iterdir())


def test_the_description_decides(started):
    """None of it on a network of one's own; the scheduler's own options are kept."""
    inner = started("security: false\ninterface: lo\n")._cluster
    assert inner.scheduler_address.startswith("tcp://127.0.0.1:")
    inner = started("scheduler_options: {host: 127.0.0.1, idle_timeout: 1h}\n")._cluster
    assert inner.scheduler_address.startswith("tls://127.0.0.1:")
    assert inner.scheduler.idle_timeout == 3600.0
