"""What one measurement leaves behind must not slow the next."""

import time

_LOOK = 0.005
"""Seconds between two looks."""
_BUSY = 0.1
"""CPU time over wall-clock time of a process that is not at rest: sleeping and looking takes far
less, one busy thread 1."""


def settle(longest: float = 1.0) -> None:
    """Wait until no thread of this process is busy, at most `longest` seconds.

    Dr.Jit's threads go on looking for work for 20 ms after their last: what began meanwhile, with
    as many threads as there are cores, took 53 ns for what takes 33 (measured).
    """
    end = time.perf_counter() + longest
    while time.perf_counter() < end:
        used, began = time.process_time(), time.perf_counter()
        time.sleep(_LOOK)
        if time.process_time() - used < _BUSY * (time.perf_counter() - began):
            return
