"""The message of a command whose Python packages, the extra `compare`, are not installed."""

from collections.abc import Iterator
from contextlib import contextmanager

from reference_rt.util.errors import ReferenceUnavailableError


@contextmanager
def compare_extra(doing: str = "comparing") -> Iterator[None]:
    """Wrap a command's own imports.  Raises ReferenceUnavailableError if a package is missing."""
    try:
        yield
    except ModuleNotFoundError as error:
        raise ReferenceUnavailableError(
            f"{doing} needs {error.name}: pip install 'reference-rt[compare]'"
        ) from None
