"""The loop of a render: gives units to an executor, stores what they computed, and stops at limits.

It runs in a thread of its own, so that a signal, which Python raises as an exception in the main
thread, never finds sums that are half written.
"""

import math
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import ALL_COMPLETED, FIRST_COMPLETED, Future, wait
from typing import NamedTuple

import numpy as np

from reference_rt.core.arrays import IntArray
from reference_rt.rendering.accumulation import Sums
from reference_rt.rendering.executor import Done, Executor, StoppedError
from reference_rt.rendering.framebuffer import Framebuffer
from reference_rt.rendering.noise import relative_error
from reference_rt.rendering.units import Unit, plan
from reference_rt.util.errors import ImageError

_POLL = 0.02
"""Seconds in which units are collected together: waking a thread for each costs more."""

_SHOWN = 0.1
"""Seconds between calls of what shows progress."""

_ESTIMATED = 0.5
"""Seconds between estimates of the noise."""

_SHARE = 0.01
"""The share of the time that writing checkpoints may take."""

_AGAIN = 30.0
"""Seconds after which a checkpoint that could not be written is tried again."""


class Limits(NamedTuple):
    """seconds: after which no more samples are begun;  error: the relative standard error
    (`noise.relative_error`) at which a picture is finished, checked after each pass, so that the
    same samples are taken for any number of threads."""

    seconds: float = math.inf
    error: float = 0.0


class Saving(NamedTuple):
    """When a checkpoint is written.  after: seconds before the first time;  every: seconds between
    two times, or more, so that writing takes little time;  needed: whether the render cannot go on
    if that fails."""

    after: float = math.inf
    every: float = 1.0
    needed: bool = False


NO_LIMITS, NEVER = Limits(), Saving()


class Snapshot(NamedTuple):
    """All sums at one moment, and the samples (n,) of each pixel."""

    sums: Sums
    samples: IntArray


class Loop:
    """The loop of one render, see `run`.

    fraction: the share of all samples that there are;  error: an estimate of the picture's relative
    standard error, None if there is none yet;  stopped: "time" or "error" if that limit ended the
    render;  save_error: why the last checkpoint could not be written, or "".
    """

    def __init__(
        self,
        frame: Framebuffer,
        executor: Executor,
        spp: int,
        limits: Limits = NO_LIMITS,
        saving: Saving = NEVER,
        at_once: bool = False,
    ) -> None:
        """at_once: whether nobody sees the picture before it is done: it has as few passes as may
        be.  Otherwise passes have work for all slots, except with a limit to the error: what is
        checked after each pass must not depend on the number of workers."""
        self._frame, self._executor, self._limits, self._saving = frame, executor, limits, saving
        self._spp = spp
        least = 1
        if at_once:
            least = spp
        elif limits.error == 0.0:
            least = min(spp, executor.samples_of_pass // frame.pixels)
        self._units = plan(frame.done, frame.pixels, spp, executor.size, least)
        self._planned: Unit | None = None
        self._todo: deque[Unit] = deque()
        self._pass = 0
        self._total = frame.pixels * spp
        sizes = np.minimum(frame.chunk, frame.pixels - np.arange(len(frame.done)) * frame.chunk)
        self._samples = int((np.minimum(frame.done, spp) * sizes).sum())
        self.had = self._samples / self._total
        self.error = self._estimate()
        self.stopped, self.save_error = "", ""
        self._abort, self._finished = threading.Event(), threading.Event()
        self._began = self._estimated = 0.0
        self._next_save, self._save_seconds, self._is_saving = math.inf, 0.0, False
        self._wants_snapshot = False
        self._snapshot: Snapshot | None = None
        self._failure: BaseException | None = None

    @property
    def fraction(self) -> float:
        return self._samples / self._total

    # ---- the main thread ------------------------------------------------------------------------

    def run(self, watch: Callable[[], None]) -> None:
        """Render until all samples are taken or a limit is reached, and call `watch` meanwhile.

        Where `watch` raises, or a signal does, units that are being computed are given up, and a
        checkpoint is written.  Raises what a unit raised; ImageError.
        """
        thread = threading.Thread(target=self._run, name="render")
        try:
            thread.start()
            watch()
            while not self._finished.wait(_SHOWN):
                watch()
        except BaseException:
            self._abort.set()
            self._executor.stop()
            raise
        finally:
            thread.join()
        if self._failure is not None:
            raise self._failure
        watch()

    def snapshot(self) -> Snapshot | None:
        """The sums a moment ago, once each time; asks for them, and returns None until they are
        there.  Only of a picture that is in memory."""
        found, self._snapshot = self._snapshot, None
        self._wants_snapshot = found is None
        return found

    # ---- the loop's thread ----------------------------------------------------------------------

    def _run(self) -> None:
        self._began = time.monotonic()
        self._next_save = self._began + self._saving.after
        running: dict[Future[Done], Unit] = {}
        try:
            while not self._abort.is_set():
                self._submit(running)
                if not running:
                    break
                self._collect(running)
                self._care()
            while running:
                self._collect(running)
            self._save_at_end()
        except BaseException as error:
            self._failure = error
            self._executor.stop()
        finally:
            self._finished.set()

    def _submit(self, running: dict[Future[Done], Unit]) -> None:
        """Submit units as long as there are slots."""
        frame = self._frame
        while len(running) < self._executor.slots and not self.stopped:
            if time.monotonic() - self._began >= self._limits.seconds:
                self.stopped = "time"
                return
            unit = self._next(running)
            if unit is None:
                return
            running[self._executor.submit(unit, frame.take(unit))] = unit

    def _next(self, running: dict[Future[Done], Unit]) -> Unit | None:
        """The next unit; None if there is none, or none before others are finished."""
        while not self._todo:
            planned = self._planned or next(self._units, None)
            self._planned = planned
            if planned is None or not self._frame.is_free(planned):
                return None
            if planned.last != self._pass and self._limits.error > 0.0:
                if running:
                    return None
                self.error = self._estimate()
                if self.error is not None and self.error <= self._limits.error:
                    self.stopped = "error"
                    return None
            self._pass, self._planned = planned.last, None
            self._todo.extend(self._frame.left(planned))
        return self._todo.popleft()

    def _collect(self, running: dict[Future[Done], Unit]) -> None:
        """Wait for units, and store what they computed."""
        is_full = len(running) >= self._executor.slots
        done, _ = wait(running, _POLL, ALL_COMPLETED if is_full else FIRST_COMPLETED)
        # In the order in which they were submitted.
        for future in [future for future in running if future in done]:
            unit = running.pop(future)
            try:
                found = future.result()
            except StoppedError:
                self._frame.forget(unit)
            except BaseException as error:
                self._frame.forget(unit)
                if self._abort.is_set():
                    continue
                if not self._executor.recovers(error):
                    raise
                self._todo.appendleft(unit)
            else:
                self._frame.put(unit, *found)
                self._samples += unit.samples

    def _estimate(self) -> float | None:
        frame = self._frame
        return relative_error(frame.statistics, frame.done, frame.pixels)

    def _care(self) -> None:
        """What is to be done now and then."""
        now = time.monotonic()
        if now - self._estimated > _ESTIMATED:
            self.error, self._estimated = self._estimate(), now
        if self._wants_snapshot and self._frame.whole is not None:
            self._wants_snapshot = False
            sums = {name: array.copy() for name, array in self._frame.whole.items()}
            self._snapshot = Snapshot(sums, self._frame.samples())
        if now >= self._next_save:
            self._save(now)

    def _save(self, now: float) -> None:
        if not self._is_saving:
            self._frame.begin_saving()
            self._is_saving, self._save_seconds = True, 0.0
        try:
            seconds = self._frame.save()
        except ImageError as error:
            self._failed_to_save(error)
            self._is_saving, self._next_save = False, now + _AGAIN
            return
        if seconds is None:
            self._is_saving, self.save_error = False, ""
            rest = self._save_seconds / _SHARE
            self._next_save = now + max(self._saving.every, rest)
        else:
            self._save_seconds += seconds

    def _save_at_end(self) -> None:
        self.error = self._estimate()
        if time.monotonic() - self._began < self._saving.after:
            return
        try:
            self._frame.begin_saving()
            self._frame.save(wait=True)
            self.save_error = ""
        except ImageError as error:
            self._failed_to_save(error)

    def _failed_to_save(self, error: ImageError) -> None:
        if self._saving.needed:
            raise error
        self.save_error = str(error)
