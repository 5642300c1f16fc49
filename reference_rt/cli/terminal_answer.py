"""How a terminal draws pictures: as it says itself, or as the environment says.

Asking needs a terminal that both reads and shows, and a process in its foreground; it is then in
cbreak mode for as long as the answer takes, without echo.  The question comes in two parts: a
picture of one pixel for kitty's protocol, which is not to be shown, and the request for primary
device attributes, which every terminal answers: what has not been answered by then is not known.
"""

import atexit
import functools
import os
import re
import sys
import time
from contextlib import suppress
from typing import IO

from reference_rt.util.errors import UsageError

PROTOCOLS = ("kitty", "sixel", "blocks", "none")

VARIABLE = "REFERENCE_RT_PICTURES"
"""Of the environment: one of PROTOCOLS, and no terminal is asked."""

PATIENCE = 0.3
"""Seconds to wait for an answer: terminals give it at once, or never."""

_KITTY = b"\x1b_Gi=31,s=1,v=1,a=q,t=d,f=24;AAAA\x1b\\"
_KITTY_SAYS = b"\x1b_Gi=31;OK\x1b\\"

_ATTRIBUTES = b"\x1b[c"
_ATTRIBUTES_ARE = re.compile(rb"\x1b\[\?([0-9;]*)c")
"""Such as ESC [ ? 62 ; 4 ; 22 c: a model, and what it can; 4 are sixels."""

_KEEP, _RESTORE = b"\x1b7", b"\x1b8\x1b[K"
"""The cursor, and what a terminal shows that does not know kitty's question and prints it."""

_PRINTING = ("linux", "screen", "tmux")
"""Beginnings of TERM: the console of Linux prints kitty's question, screen makes it the title of
its window; what is in tmux cannot draw by the answer of what tmux is in."""


def chosen() -> str:
    """What the environment says; "" if nothing.  Raises UsageError."""
    given = os.environ.get(VARIABLE, "")
    if given and given not in PROTOCOLS:
        raise UsageError(f"{VARIABLE}: expected one of {', '.join(PROTOCOLS)}, got '{given}'")
    return given


def protocol(shown: IO[str]) -> str:
    """One of PROTOCOLS.  shown: the stream that the pictures go to.  Raises UsageError."""
    if given := chosen():
        return given
    try:
        device = os.ttyname(shown.fileno())
        if os.ttyname(sys.stdin.fileno()) != device:
            return "blocks"
    except (OSError, ValueError, AttributeError):  # no terminal; Windows has no such function
        return "blocks"
    return said_by(device)


@functools.cache
def said_by(device: str) -> str:
    """The protocol that the terminal of this path says it knows, "blocks" if none."""
    import termios

    question = _ATTRIBUTES if _prints_questions() else _KITTY + _ATTRIBUTES
    answer = b""
    with suppress(OSError, termios.error):  # it has hung up
        answer = _asked(device, _KEEP + question + _RESTORE)
    if _KITTY_SAYS in answer:
        return "kitty"
    return "sixel" if says_sixels(answer) else "blocks"


def _prints_questions() -> bool:
    return (
        os.environ.get("TERM", "").startswith(_PRINTING)
        or os.environ.get("TERM_PROGRAM") == "Apple_Terminal"
        or any(os.environ.get(name) for name in ("TMUX", "STY"))
    )


def says_sixels(answer: bytes) -> bool:
    """Whether an answer has device attributes, and these name sixels."""
    found = _ATTRIBUTES_ARE.search(answer)
    return found is not None and b"4" in found[1].split(b";")[1:]


def _asked(device: str, question: bytes) -> bytes:
    """What the terminal sends up to its device attributes, or within `PATIENCE`.  Its mode is
    restored, and nothing of an answer is left, whatever ends the question."""
    import termios
    import tty

    terminal = os.open(device, os.O_RDWR | os.O_NOCTTY)
    answer, end = b"", time.monotonic() + PATIENCE
    try:
        before = termios.tcgetattr(terminal)
        # The kernel stops a process of the background that changes the mode.
        if not _is_foreground(terminal):
            return b""
        try:
            tty.setcbreak(terminal, termios.TCSANOW)
            if _is_waiting(terminal, 0.0):  # somebody has typed ahead: it would be lost
                return b""
            atexit.register(_discard, device)
            os.write(terminal, question)
            while _is_waiting(terminal, max(0.0, end - time.monotonic())):
                answer += os.read(terminal, 64)
                if _ATTRIBUTES_ARE.search(answer):
                    atexit.unregister(_discard)
                    break
            else:
                termios.tcflush(terminal, termios.TCIFLUSH)
        finally:
            termios.tcsetattr(terminal, termios.TCSANOW, before)
    finally:
        os.close(terminal)
    return answer


def _is_foreground(terminal: int) -> bool:
    return os.tcgetpgrp(terminal) == os.getpgrp()


def _is_waiting(terminal: int, seconds: float) -> bool:
    """Whether there is something to read by then."""
    import select

    return bool(select.select([terminal], [], [], seconds)[0])


def _discard(device: str) -> None:
    """At the end of the program: an answer that came late is not for whoever reads next."""
    import termios

    with suppress(OSError, termios.error):
        terminal = os.open(device, os.O_RDWR | os.O_NOCTTY)
        try:
            if _is_foreground(terminal):
                termios.tcflush(terminal, termios.TCIFLUSH)
        finally:
            os.close(terminal)
