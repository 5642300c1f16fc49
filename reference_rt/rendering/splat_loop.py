"""The loop of a render by particles, each of which may be seen in any pixel.

A pass is divided into the same units, however many threads there are.  Each unit has a picture of
its own for what its particles add, and these are added in order, once their turn comes: no bit
depends on which thread was first.
"""

import time
from collections import deque
from concurrent.futures import Future
from itertools import pairwise

import numpy as np

from reference_rt.rendering.accumulation import SPLATS
from reference_rt.rendering.executor import Done, StoppedError
from reference_rt.rendering.loop import Loop
from reference_rt.rendering.noise import BETWEEN, PASSES, statistics
from reference_rt.rendering.units import Unit, passes

_UNITS = 16
"""Units of a pass, and pictures in memory at most."""


class SplatLoop(Loop):
    """A loop whose pictures are in memory, without checkpoints; passes are done whole."""

    def _run(self) -> None:
        self._began = time.monotonic()
        frame = self._frame
        try:
            for last in passes(self._spp, frame.chunk):
                if time.monotonic() - self._began >= self._limits.seconds:
                    self.stopped = "time"
                elif self.error is not None and self.error <= self._limits.error:
                    self.stopped = "error"
                if self.stopped or self._abort.is_set():
                    break
                self._add(int(frame.done[0]), last)
                self.error = self._estimate()
                self._care()
        except StoppedError:
            pass  # the pass is given up
        except BaseException as error:
            self._failure = error
        finally:
            self._executor.stop()
            self._finished.set()

    def _add(self, first: int, last: int) -> None:
        """Add the samples of a pass to all pixels."""
        frame, whole = self._frame, self._frame.whole
        assert whole is not None
        own, splats = (
            {name: array.copy() for name, array in whole.items()},
            np.zeros((frame.pixels, 3)),
        )
        edges = np.linspace(0, frame.pixels, _UNITS + 1).astype(int).tolist()
        running: deque[tuple[slice, Future[Done]]] = deque()

        def collect() -> None:
            rows, future = running.popleft()
            sums = future.result().sums
            splats[:] += sums.pop(SPLATS)
            for name, array in sums.items():
                own[name][rows] = array

        for begin, end in pairwise(edges):
            if begin == end:
                continue
            rows = slice(begin, end)
            sums = {name: array[rows].copy() for name, array in whole.items()}
            sums[SPLATS] = np.zeros((frame.pixels, 3))
            running.append((rows, self._executor.submit(Unit(begin, end, first, last), sums)))
            if len(running) >= self._executor.slots:
                collect()
        while running:
            collect()
        own["colour"] += splats
        found = statistics(whole["colour"], own["colour"], last - first, frame.chunk)
        found[:, BETWEEN : PASSES + 1] += frame.statistics[:, BETWEEN : PASSES + 1]
        frame.statistics[:], frame.done[:] = found, last
        for name, array in own.items():
            whole[name][:] = array
        self._samples += frame.pixels * (last - first)
