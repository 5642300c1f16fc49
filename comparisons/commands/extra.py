"""What the commands say where the packages that comparing takes are not installed."""

from collections.abc import Iterator
from contextlib import contextmanager

from reference_rt.util.errors import ReferenceUnavailableError


@contextmanager
def compare_extra(doing: str = "comparing") -> Iterator[None]:
    """Around a command's imports, which are made when it runs: `reference-rt render` must not wait
    for what only comparing needs."""
    try:
        yield
    except ModuleNotFoundError as error:
        raise ReferenceUnavailableError(
            f"{doing} needs {error.name}: pip install 'reference-rt[compare]'"
        ) from None
