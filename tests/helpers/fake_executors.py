"""Executors for tests: units that cost nothing, are late, or fail."""

import os
import random
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from reference_rt.rendering.executor import Done, StoppedError
from reference_rt.rendering.noise import statistics
from reference_rt.rendering.units import chunk_of


def sample(pixel, number):
    """A sample (n, 3): any function of pixel and number whose sums depend on their order."""
    x = np.sin(12.9898 * pixel + 78.233 * number) * 43758.5453
    return np.stack([x - np.floor(x), np.exp(x % 3.0), 1.0 / (1.0 + x * x)], axis=-1)


def expected(pixels, spp):
    """The sums (pixels, 3) of all samples."""
    total = np.zeros((pixels, 3))
    for number in range(spp):
        total += sample(np.arange(pixels), number)
    return total


class LostError(Exception):
    """A worker has died."""


class Fake:
    """An `Executor` of `sample`.

    late: seconds that a unit takes at most;  lost: the share of units that are lost, and may be
    computed again, half of them after they were computed;  broken: after so many units, one fails
    for good.
    """

    samples_of_pass = 0

    def __init__(self, pixels, size=4096, slots=6, late=0.0, lost=0.0, broken=None, seed=1):
        self.size, self.slots, self.chunk = size, slots, chunk_of(pixels)
        self.late, self.lost, self.broken = late, lost, broken
        self.random, self.units = random.Random(seed), []
        self.stopped = threading.Event()
        self.pool = ThreadPoolExecutor(3)

    def submit(self, unit, sums):
        self.units.append(unit)
        seconds = self.random.uniform(0.0, self.late)
        fate = self.random.random()
        return self.pool.submit(self.compute, unit, sums, seconds, fate, len(self.units))

    def compute(self, unit, sums, seconds, fate, number):
        if self.stopped.wait(seconds) or self.stopped.is_set():
            raise StoppedError
        if number == self.broken:
            raise ZeroDivisionError("broken")
        if fate < 0.5 * self.lost:
            raise LostError
        before = sums["colour"].copy()
        for k in range(unit.first, unit.last):
            sums["colour"] += sample(np.arange(unit.begin, unit.end), k)
        if fate < self.lost:
            raise LostError
        found = statistics(before, sums["colour"], unit.last - unit.first, self.chunk)
        return Done(sums, found)

    def recovers(self, error):
        return isinstance(error, LostError)

    def progress(self, fraction):
        pass

    def stop(self):
        self.stopped.set()

    def close(self):
        self.pool.shutdown(cancel_futures=True)


def die(*arguments):
    """In place of what a process computes."""
    os._exit(1)
