"""Thread-pool cooldown: wait until idle threads stop spinning, before the next measurement."""

import time

_INTERVAL = 0.005
"""Seconds between two checks."""
_BUSY = 0.1
"""CPU time over wall-clock time above which a process is busy: one busy thread takes 1, sleeping
between the checks far less."""


def cool_down(longest: float = 1.0) -> None:
    """Wait until no thread of this process is busy, at most `longest` seconds.

    Dr.Jit's threads spin for 20 ms after their last task.  Kernels started in that time, with as
    many threads as cores, took 53 ns instead of 33 (measured).
    """
    end = time.perf_counter() + longest
    while time.perf_counter() < end:
        used, began = time.process_time(), time.perf_counter()
        time.sleep(_INTERVAL)
        if time.process_time() - used < _BUSY * (time.perf_counter() - began):
            return
