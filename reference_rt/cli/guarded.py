"""What all commands share: errors as one line with an exit code, and safe printing."""

import errno
import functools
import inspect
import re
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, TypeVar

import typer

from reference_rt.util.errors import (
    CacheWarning,
    ImageError,
    ReferenceRtError,
    ReferenceUnavailableError,
    SceneError,
    SceneWarning,
    printable,
)
from reference_rt.util.extras import extra_of, needs
from reference_rt.util.memory import machine_memory
from reference_rt.util.processes import dropped, exit_code_of

F = TypeVar("F", bound=Callable[..., Any])

_INTERRUPTED = "interrupted; nothing unfinished was written"


def guarded(command: F) -> F:
    """Report every error of a command as one line on standard error, with its exit code."""

    @functools.wraps(command)
    def run(*args: Any, **kwargs: Any) -> Any:
        try:
            with our_warnings(lambda text: typer.echo(f"warning: {text}", err=True)):
                return command(*args, **kwargs)
        except ReferenceRtError as error:
            others = error.others if isinstance(error, SceneError) else ()
            *first, last = (error, *others)
            for one in first:
                with suppress(OSError):
                    say(f"error: {one}", err=True)
            _fail(str(last), error.exit_code)
        except typer.Exit:
            raise
        except KeyboardInterrupt as error:
            _fail(_INTERRUPTED, exit_code_of(error))
        except BrokenPipeError:
            raise
        except Exception as error:
            if (signal := dropped()) is not None:
                _fail(_INTERRUPTED, exit_code_of(signal))
            if is_output_lost(error):
                _fail(lost_output(error), ImageError.exit_code)
            if isinstance(error, MemoryError) or getattr(error, "errno", None) == errno.ENOMEM:
                _fail(_out_of_memory(), SceneError.exit_code)
            if isinstance(error, ModuleNotFoundError) and (extra := extra_of(error.name)):
                message = needs("this command", extra, error.name)
                _fail(message, ReferenceUnavailableError.exit_code)
            message = " ".join(str(error).split())
            _fail(f"internal error: {type(error).__name__}: {message}; please report it", 5)

    # Typer breaks lines where the source does, besides at the terminal's width.
    paragraphs = inspect.cleandoc(command.__doc__ or "").split("\n\n")
    run.__doc__ = "\n\n".join(" ".join(one.split()) for one in paragraphs)
    return run  # type: ignore[return-value]


def say(text: str, err: bool = False) -> None:
    """Print one line; unprintable characters are escaped."""
    typer.echo(printable(text), err=err)


def lost_output(error: BaseException) -> str:
    """The message for a failed print."""
    reason = getattr(error, "strerror", None)
    return f"standard output cannot be written: {reason}; expected free space"


def is_output_lost(error: BaseException) -> bool:
    """Whether a print failed, as on a full disk.  Our output files raise ImageError instead."""
    lost = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
    return isinstance(error, OSError) and error.errno in lost and error.filename is None


def _out_of_memory() -> str:
    limit = machine_memory()
    there = "" if limit is None else f", which is limited to {limit / 2**30:.1f} GiB here"
    return f"the scene does not fit into memory{there}; expected a smaller one, or more memory"


MOST_ALIKE = 3
"""Warnings of one kind that are reported; the rest are counted.  A modelling program's scene of 439
meshes has triangles without area in 206 of them."""


OURS = (SceneWarning, CacheWarning)
"""Warnings to users; all others are to programmers."""


@contextmanager
def our_warnings(report: Callable[[str], None]) -> Iterator[None]:
    """Call `report` with the texts of warnings of OURS; others are Python's.

    Of those that differ in the part of the scene and in numbers alone the first MOST_ALIKE are
    reported, and at the end the last one with the count of those left out.
    """
    alike: dict[str, list[str]] = {}
    with warnings.catch_warnings():
        others = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], *place: Any, **to: Any) -> None:
            if not issubclass(category, OURS):
                others(message, category, *place, **to)
                return
            text = str(message)
            told = alike.setdefault(re.sub(r"\d[\d,.]*", "#", text.rpartition(": ")[2]), [])
            if text in told:
                return
            told.append(text)
            if len(told) <= MOST_ALIKE:
                report(text)

        for ours in OURS:
            warnings.simplefilter("always", ours)
        warnings.showwarning = show
        try:
            yield
        finally:
            for told in alike.values():
                if len(told) == MOST_ALIKE + 1:
                    report(told[-1])
                elif len(told) > MOST_ALIKE:
                    left_out = len(told) - MOST_ALIKE - 1
                    report(f"{told[-1]} ({left_out:,} more warnings of this kind are left out)")


def _fail(message: str, code: int) -> None:
    with suppress(OSError):  # standard error may fail, too
        say(f"error: {message}", err=True)
    raise typer.Exit(code)
