"""Where tasks are computed, as the options of a command say."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from reference_rt.util.errors import UsageError
from reference_rt.util.workers import Workers


class Where(NamedTuple):
    """The options --workers, --scheduler, --cluster and --threads, of which one may be given."""

    workers: int | None = None
    scheduler: str | None = None
    cluster: Path | None = None
    threads: int | None = None

    @property
    def is_elsewhere(self) -> bool:
        """Whether other processes or machines compute."""
        return (self.workers, self.scheduler, self.cluster) != (None, None, None)

    @property
    def is_cluster(self) -> bool:
        """Whether the workers are those of a scheduler."""
        return (self.scheduler, self.cluster) != (None, None)

    def check(self) -> None:
        """Raise UsageError if two of them are given."""
        given = [name for name, value in self._asdict().items() if value is not None]
        if len(given) > 1:
            listed = " and ".join(f"--{name}" for name in given)
            raise UsageError(f"{listed} contradict each other; expected one of them")

    def open(self, local: Callable[[int], Workers], default: int = 1) -> Workers:
        """The workers; close them at the end.

        local: makes so many workers on this machine;  default: their number without --workers.
        Raises UsageError, WorkersError.
        """
        self.check()
        if not self.is_cluster:
            return local(self.workers or default)
        from reference_rt.util.cluster import Cluster

        return Cluster(self.scheduler or "", self.cluster)
