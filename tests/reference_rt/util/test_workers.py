"""Workers run each task once or more, and lose none."""

import os
import signal
import threading
import time
from contextlib import closing

import pytest

from reference_rt.util.errors import WorkersError
from reference_rt.util.workers import Processes, Threads, run_all, run_in_order


def square(number):
    return number * number


def fails(number):
    raise KeyError(number)


def die_once(number, file):
    """Kill this process the first time that it is called for an odd number."""
    if number % 2:
        try:
            file.with_suffix(f".{number}").touch(exist_ok=False)
        except FileExistsError:
            return square(number)
        time.sleep(0.3)  # others are computed, before it and with it
        os.kill(os.getpid(), signal.SIGKILL)
    return square(number)


def die(number):
    os.kill(os.getpid(), signal.SIGKILL)


@pytest.fixture(params=[Threads, Processes])
def workers(request):
    with closing(request.param(3)) as found:
        yield found


def test_all_tasks_are_run_once(workers):
    found = list(run_all(workers, square, ((k,) for k in range(20))))
    assert sorted(found) == [(k, k * k) for k in range(20)]
    assert list(run_in_order(workers, square, ((k,) for k in range(20)))) == [
        k * k for k in range(20)
    ]
    assert list(run_all(workers, square, ())) == []


def test_errors_are_raised(workers):
    with pytest.raises(KeyError, match="7"):
        list(run_all(workers, fails, [(7,)]))
    assert list(run_all(workers, square, [(5,)])) == [(0, 25)]


def test_no_more_tasks_are_begun_than_there_are_threads():
    taken, free, watched = [], threading.Event(), []

    def tasks():
        for k in range(9):
            taken.append(k)
            yield (k,)

    def wait(k):
        assert free.wait(600.0)
        return k

    def watch():
        watched.append(len(taken))
        free.set()

    with closing(Threads(2)) as workers:
        found = list(run_all(workers, wait, tasks(), watch))
    assert sorted(k for _, k in found) == [*range(9)]
    assert watched[0] == 2


@pytest.mark.slow
def test_tasks_of_processes_that_die_are_run_again(tmp_path):
    with closing(Processes(2)) as workers:
        tasks = ((k, tmp_path / "dead") for k in range(8))
        assert list(run_in_order(workers, die_once, tasks)) == [k * k for k in range(8)]
    assert len(list(tmp_path.iterdir())) == 4


def test_processes_that_always_die_end_the_run():
    with closing(Processes(2)) as workers, pytest.raises(WorkersError, match="died 5 times"):
        list(run_all(workers, die, [(1,)]))


def test_what_is_closed_begins_nothing_more():
    begun = []

    def task(k):
        begun.append(k)
        time.sleep(0.05)
        return k

    with closing(Threads(1)) as workers:
        with closing(run_all(workers, task, ((k,) for k in range(50)))) as results:
            next(results)
        count = len(begun)
        time.sleep(0.3)
        assert len(begun) <= count + 1
