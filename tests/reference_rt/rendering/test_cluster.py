"""Renders by the workers of a Dask scheduler: the same bits, whatever dies meanwhile."""

import os
import signal
import socket
import sys
import threading
import time
from concurrent.futures import CancelledError, wait

import pytest
from machines import Machines
from small_scenes import same, small

import reference_rt as rt
from reference_rt.rendering.executor import Remote
from reference_rt.rendering.render import Session
from reference_rt.util.cluster import Cluster, batch_cluster
from reference_rt.util.errors import UsageError, WorkersError

distributed = pytest.importorskip("distributed")

pytestmark = pytest.mark.filterwarnings("ignore")  # those of distributed are not ours


@pytest.fixture
def machines(tmp_path):
    found = Machines(tmp_path)
    yield found
    found.end()


@pytest.fixture
def small_units(monkeypatch):
    """Units so small that there are many."""
    monkeypatch.setattr(Remote, "size", 1 << 14)


def rendered(scene, address, watch=lambda fraction: None):
    """watch: called now and then with the fraction that is done."""
    with Session(scene, workers=lambda: Cluster(address)) as session:
        session.run(lambda what, fraction: watch(fraction))
        return session.picture()


@pytest.fixture(scope="module")
def box():
    scene = small("cornell_box").changed(sampler=rt.Sobol(spp=200))
    return scene.changed(film=scene.film.model_copy(update={"width": 64, "height": 64}))


@pytest.mark.slow
def test_a_scheduler_that_restarts(machines, box, small_units):
    """With its workers, as a batch system does it."""
    machines.start_worker()
    restarted = []

    def watch(fraction):
        if fraction > 0.2 and not restarted:
            restarted.append(fraction)
            machines.scheduler.kill()
            machines.scheduler.wait()
            machines.workers[0].kill()
            machines.start_scheduler()
            machines.start_worker()

    assert same(rendered(box, machines.address, watch), rt.render(box))
    assert restarted


@pytest.fixture
def cluster(machines, monkeypatch):
    """Which asks its scheduler all the time."""
    monkeypatch.setattr("reference_rt.util.cluster._ASKED", 0.05)
    machines.start_worker()
    found = Cluster(machines.address)
    yield found
    found.close()


def error_of(future):
    """Of a future that ends in a minute, as the loop of a render sees it."""
    assert wait([future], 60.0).done
    try:
        return future.exception()
    except CancelledError as error:
        return error


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
@pytest.mark.parametrize("is_forgotten", [False, True])
def test_what_a_scheduler_took_along_ends(machines, cluster, number, is_forgotten):
    """However it ends; of a unit that was submitted meanwhile the client never says anything."""
    lost = cluster.submit(time.sleep, 1000.0)
    assert not wait([lost], 0.5).done
    if is_forgotten:
        cluster._client.futures.clear()
    machines.scheduler.send_signal(number)
    machines.scheduler.wait()
    machines.workers[0].kill()
    machines.start_scheduler()
    machines.start_worker()
    assert cluster.recovers(error_of(lost))
    assert cluster.submit(abs, -3).result(600.0) == 3
    assert cluster.threads == 1


@pytest.mark.cases(1)
@pytest.mark.parametrize("is_alive", [True, False])
@pytest.mark.parametrize("is_forgotten", [False, True])
@pytest.mark.parametrize("how", ["stop", "close"])
def test_all_ends_with_stop(machines, cluster, is_alive, is_forgotten, how):
    """What runs, what waits for a worker, and what is submitted later, so that Ctrl-C ends too."""
    futures = [cluster.submit(time.sleep, 1000.0) for _ in range(3)]
    assert not wait(futures, 0.5).done
    if is_forgotten:
        cluster._client.futures.clear()
    if not is_alive:
        machines.scheduler.kill()
    getattr(cluster, how)()
    futures.append(cluster.submit(abs, -3))
    assert not wait(futures, 10.0).not_done
    assert {type(error_of(future)) for future in futures} == {CancelledError}


@pytest.mark.slow
@pytest.mark.parametrize("give_up", ["stop", "cancel"])
def test_what_is_given_up_leaves_its_worker(cluster, machines, give_up):
    """What had not begun never runs."""
    first = cluster.submit(time.sleep, 5.0)
    begun = machines.folder / "begun"
    second = cluster.submit(os.mkdir, str(begun))
    if give_up == "stop":
        cluster.stop()
    else:
        assert second.cancel()
        first.result(600.0)
    other = Cluster(machines.address)
    assert other.submit(abs, -3).result(600.0) == 3
    other.close()
    assert not begun.exists()


@pytest.mark.slow
def test_stopped_while_it_waits_for_a_scheduler(machines, cluster):
    """Of a batch system, which may let it wait for days."""
    machines.scheduler.kill()
    machines.scheduler.wait()
    while cluster._watch is not None:  # it has not seen that yet
        time.sleep(0.05)
    given = cluster.submit(abs, -3)
    assert not wait([given], 2.0).done
    cluster.stop()
    assert isinstance(error_of(given), CancelledError)


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="no SIGSTOP")
def test_a_scheduler_that_does_not_answer(machines, cluster, monkeypatch):
    """Nor does it end, as if its machine were too busy."""
    monkeypatch.setattr("reference_rt.util.cluster._PATIENCE", 3.0)
    monkeypatch.setattr("reference_rt.util.cluster._TRY", 1.0)
    lost = cluster.submit(time.sleep, 20.0)
    assert not wait([lost], 0.5).done
    machines.scheduler.send_signal(signal.SIGSTOP)
    assert cluster.recovers(error_of(lost))
    assert isinstance(error_of(cluster.submit(abs, -3)), WorkersError)
    machines.scheduler.send_signal(signal.SIGCONT)
    assert cluster.submit(abs, -3).result(600.0) == 3


@pytest.mark.parametrize(
    "answer",
    [None, b"", b"HTTP/1.1 400 Bad Request\r\n\r\n", bytes(64)],
    ids=["nothing", "", "http", "zeros"],
)
def test_not_a_scheduler(answer, monkeypatch):
    """A program that says nothing, closes the connection, or speaks of something else.  Attempts
    leave no threads behind: there may be many, of a batch system that lets jobs wait."""
    monkeypatch.setattr("reference_rt.util.cluster._PATIENCE", 0.5)
    monkeypatch.setattr("reference_rt.util.cluster._TRY", 0.1)
    listening, open_ones = socket.create_server(("127.0.0.1", 0)), []

    def serve():
        try:
            while True:
                connection, _ = listening.accept()
                open_ones.append(connection)
                if answer is not None:
                    connection.sendall(answer)
                    connection.close()
        except OSError:  # the test has ended
            pass

    before = set(threading.enumerate())
    server = threading.Thread(target=serve)
    server.start()
    with pytest.raises(WorkersError, match="no scheduler with a worker"):
        Cluster(f"tcp://127.0.0.1:{listening.getsockname()[1]}")
    listening.shutdown(socket.SHUT_RDWR)
    listening.close()
    server.join()
    for connection in open_ones:
        connection.close()
    assert open_ones
    assert set(threading.enumerate()) <= before


def test_no_scheduler(box, monkeypatch):
    monkeypatch.setattr("reference_rt.util.cluster._PATIENCE", 1.0)
    monkeypatch.setattr("reference_rt.util.cluster._TRY", 1.0)
    with pytest.raises(WorkersError, match="no scheduler with a worker"):
        rendered(box, "tcp://127.0.0.1:1")


@pytest.mark.slow
def test_a_worker_killed_at_every_tenth_of_a_render(machines, box, small_units):
    """Of four; each is replaced, except the first; the scheduler is restarted once."""
    for _ in range(4):
        machines.start_worker()
    scene = box.changed(sampler=rt.Sobol(spp=3000))
    events = []

    def watch(fraction):
        alive = [worker for worker in machines.workers if worker.poll() is None]
        if fraction < 0.1 * (len(events) + 1) or not alive:
            return
        restarts = len(events) == 4
        events.append(fraction)
        if restarts:
            machines.scheduler.kill()
            machines.scheduler.wait()
            machines.start_scheduler()
        for worker in alive if restarts else alive[:1]:
            worker.kill()
            if len(events) > 1:
                machines.start_worker()

    assert same(rendered(scene, machines.address, watch), rt.render(scene))
    assert len(events) >= 8


# ---- descriptions of batch systems --------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[1, 2", ":2: malformed"),
        ("jobs: 3\ntype: slurm\njobs: 4", ":3: malformed: found duplicate key 'jobs'"),
        ("jobs: 3", "type: expected one of slurm, pbs"),
        ("{type: [slurm], jobs: 3}", "type: expected one of slurm, pbs"),
        ("{type: slurm}", "jobs: expected the number of jobs"),
        ("{type: slurm, jobs: 0}", "jobs: expected the number of jobs"),
        ("{type: slurm, jobs: true}", "jobs: expected the number of jobs"),
        ("{type: slurm, jobs: 1, colour: red}", "expected the options of dask-jobqueue"),
    ],
)
def test_wrong_descriptions(text, said, tmp_path):
    if "red" in text:
        pytest.importorskip("dask_jobqueue")
    file = tmp_path / "slurm.yaml"
    file.write_text(text)
    with pytest.raises(UsageError, match=said):
        batch_cluster(file)
    with pytest.raises(UsageError, match="cannot be read"):
        batch_cluster(tmp_path / "nowhere.yaml")


@pytest.mark.skipif(os.name != "posix", reason="a shell script stands for Slurm")
def test_jobs_of_slurm(tmp_path, box, monkeypatch):
    """`sbatch` that runs the job at once, as Slurm does when a machine is free."""
    pytest.importorskip("dask_jobqueue")
    tools = tmp_path / "bin"
    tools.mkdir()
    log = tmp_path / "sbatch.log"
    (tools / "sbatch").write_text(
        f'#!/bin/sh\ncp "$1" {log}\nsetsid sh {log} > {tmp_path}/job.log 2>&1 &\n'
        f'echo $! > {tmp_path}/pid\necho "Submitted batch job 77"\n'
    )
    (tools / "scancel").write_text(f"#!/bin/sh\nkill -- -$(cat {tmp_path}/pid)\n")
    for name in ("sbatch", "scancel"):
        (tools / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{tools}:{os.environ['PATH']}")
    file = tmp_path / "slurm.yaml"
    file.write_text(
        f"type: slurm\njobs: 1\ncores: 1\nprocesses: 1\nmemory: 1GB\nqueue: long\n"
        f"walltime: '01:00:00'\ninterface: lo\npython: {sys.executable}\n"
        f"local_directory: {tmp_path}\n"
    )
    with Session(box, workers=lambda: Cluster(file=file)) as session:
        session.run(lambda what, fraction: None)
        assert same(session.picture(), rt.render(box))
    assert "#SBATCH -p long" in log.read_text()
