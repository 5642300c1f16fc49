"""A process between the gate and a renderer, so that no process of the renderer outlives it and
nothing that it prints fills the disk.

`python -I -S supervisor.py LOG ARGUMENTS...` starts the renderer with these arguments.  It ends all
processes that came from it when the renderer ends or when standard input is closed, which also
happens where the gate is killed.  It then writes what the renderer printed to LOG, its beginning
and its end where it is long, and one line of JSON to standard output: `code`, the renderer's exit
code (negative: its signal), null if it was ended; or `error`, why it could not be started.

Linux gives orphans to the nearest process that asked for them, and this one asks: children that
leave the renderer's session or process group are found, too.  Other systems: its process group.
"""

import contextlib
import ctypes
import json
import os
import selectors
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

KEPT = 5_000_000
"""Bytes of the beginning, and of the end, of what a renderer prints."""

_PR_SET_PDEATHSIG, _PR_SET_CHILD_SUBREAPER = 1, 36  # linux/prctl.h


class _Log:
    """The first KEPT bytes and the last KEPT bytes."""

    def __init__(self) -> None:
        self.head, self.tail, self.left_out = bytearray(), bytearray(), 0

    def add(self, text: bytes) -> None:
        room = KEPT - len(self.head)
        self.head += text[:room]
        self.tail += text[room:] if room > 0 else text
        if len(self.tail) > 2 * KEPT:  # not each time: the rest is moved
            self._shorten()

    def _shorten(self) -> None:
        more = len(self.tail) - KEPT
        if more > 0:
            del self.tail[:more]
            self.left_out += more

    def text(self) -> bytes:
        self._shorten()
        between = b"\n[%d bytes are left out]\n" % self.left_out if self.left_out else b""
        return bytes(self.head) + between + bytes(self.tail)


def _descendants() -> Iterator[int]:
    """The processes of this machine that come from this one."""
    children: dict[int, list[int]] = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            with contextlib.suppress(OSError, ValueError, IndexError):
                parent = int((entry / "stat").read_bytes().rpartition(b")")[2].split()[1])
                children.setdefault(parent, []).append(int(entry.name))
    left = [os.getpid()]
    while left:
        found = children.get(left.pop(), [])
        yield from found
        left += found


def _end_all(group: int) -> None:
    """Kill the renderer and all that came from it, until nothing is left."""
    with contextlib.suppress(OSError):
        os.killpg(group, signal.SIGKILL)
    if sys.platform != "linux":
        return
    while True:
        for pid in _descendants():
            with contextlib.suppress(OSError):
                os.kill(pid, signal.SIGKILL)
        try:
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass
        except ChildProcessError:
            return  # there is no child left, and so no descendant
        time.sleep(0.005)


def main(log_file: str, arguments: list[str]) -> None:
    libc = ctypes.CDLL(None) if sys.platform == "linux" else None
    if libc is not None:
        libc.prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)

    def tie() -> None:
        if libc is not None:
            libc.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)

    # Woken by SIGCHLD, so that the renderer's end is seen at once though children of its hold the
    # pipe open.
    woken, wake = os.pipe()
    os.set_blocking(wake, False)
    signal.set_wakeup_fd(wake)
    signal.signal(signal.SIGCHLD, lambda number, frame: None)
    try:
        renderer = subprocess.Popen(
            arguments,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            preexec_fn=tie,
        )
    except (OSError, ValueError) as error:
        print(json.dumps({"error": getattr(error, "strerror", None) or str(error)}), flush=True)
        return
    assert renderer.stdout is not None
    output = renderer.stdout.fileno()
    os.set_blocking(output, False)
    log = _Log()
    with selectors.DefaultSelector() as selector:
        for number in (0, woken, output):
            selector.register(number, selectors.EVENT_READ)
        while (code := renderer.poll()) is None:
            ready = {key.fd for key, _ in selector.select()}
            if 0 in ready and not os.read(0, 1):
                break
            if woken in ready:
                os.read(woken, 1024)
            if output in ready and not _copied(output, log):
                selector.unregister(output)
    _end_all(renderer.pid)
    for _ in range(64):  # what is left in the pipe: one that is still written to has no end
        if not _copied(output, log):
            break
    Path(log_file).write_bytes(log.text())
    with contextlib.suppress(BrokenPipeError):  # the gate was killed
        print(json.dumps({"code": code}), flush=True)


def _copied(output: int, log: _Log) -> bool:
    """Copy what the pipe holds; False at its end or where it is empty."""
    try:
        text = os.read(output, 1 << 20)
    except BlockingIOError:
        return False
    log.add(text)
    return bool(text)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
