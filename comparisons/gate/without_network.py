"""Runs a program without a network.

`python -I -S without_network.py PROGRAM ARGUMENTS...` becomes the program, in a network namespace
of its own where the machine permits that: Linux, with user namespaces or as root.  No interface is
up there, the loopback neither.  Elsewhere the program runs as it is.
"""

import ctypes
import os
import sys
from pathlib import Path

_CLONE_NEWUSER, _CLONE_NEWNET = 0x10000000, 0x40000000  # linux/sched.h


def _left(flags: int) -> bool:
    """Whether this process has left the namespaces of these kinds; with that of users, it stays the
    user that it is."""
    user, group = os.geteuid(), os.getegid()
    if ctypes.CDLL(None).unshare(flags) != 0:
        return False
    if flags & _CLONE_NEWUSER:
        Path("/proc/self/setgroups").write_text("deny", encoding="ascii")  # else no gid_map
        Path("/proc/self/uid_map").write_text(f"{user} {user} 1", encoding="ascii")
        Path("/proc/self/gid_map").write_text(f"{group} {group} 1", encoding="ascii")
    return True


def _can_leave(flags: int) -> bool:
    """Whether `_left` works, tried in a child: half of it would leave this process nobody."""
    child = os.fork()
    if child == 0:
        code = 1
        try:
            code = 0 if _left(flags) else 1
        finally:
            os._exit(code)
    return os.waitpid(child, 0)[1] == 0


def main(program: list[str]) -> None:
    """Become the program.  This process has one thread: others could not leave."""
    if sys.platform == "linux":
        for flags in (_CLONE_NEWNET, _CLONE_NEWUSER | _CLONE_NEWNET):  # as root; as anybody
            if _can_leave(flags):
                _left(flags)
                break
    os.execvp(program[0], program)


if __name__ == "__main__":
    main(sys.argv[1:])
