"""Runs another renderer's command line, once per replicate."""

import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from comparisons.gate.errors import RendererError
from comparisons.gate.pictures_in import Picture, read_candidate
from reference_rt.util.child_processes import tied
from reference_rt.util.errors import ImageError, UsageError

PLACEHOLDERS = ("scene", "output", "seed", "spp")

_BRACES = re.compile(r"\{([A-Za-z_]*)\}")

_PICTURES = (".exr", ".png", ".pfm", ".hdr", ".npy", ".jpg", ".jpeg", ".ppm", ".tif", ".tiff")

_LAST_LINES = 5
"""Lines of a failed renderer's output that a message quotes."""


@dataclass(frozen=True)
class Command:
    """How a renderer is called.

    template: the command line, split like a shell's but run without a shell; {scene}, {output},
    {seed} and {spp} in its arguments are replaced;  scene: the file for {scene};  suffix: the
    output's, from which most renderers derive the format;  seconds: time limit of one run.
    """

    template: str
    scene: Path | None = None
    spp: int | None = None
    suffix: str = ".exr"
    seconds: float = 600.0

    def arguments(self, output: Path, seed: int) -> list[str]:
        """The arguments of one run.  Raises UsageError."""
        try:
            words = shlex.split(self.template)
        except ValueError as error:
            raise UsageError(f"--command: {str(error).lower()}; expected closed quotes") from None
        if not words:
            raise UsageError("--command: is empty; expected a program and its arguments")
        values = {
            "scene": None if self.scene is None else str(self.scene),
            "output": str(output),
            "seed": str(seed),
            "spp": None if self.spp is None else str(self.spp),
        }
        named = {name for word in words for name in _BRACES.findall(word)}
        known = ", ".join(f"{{{name}}}" for name in PLACEHOLDERS)
        for name in sorted(named - set(PLACEHOLDERS)):
            raise UsageError(f"--command: there is no {{{name}}}; expected some of {known}")
        if "output" not in named:
            raise UsageError("--command: has no {output}; expected it as the picture's file name")
        for name in sorted(named):
            if values[name] is None:
                raise UsageError(f"--command: has {{{name}}}; expected --{name} too")
        return [_BRACES.sub(lambda match: values[match[1]] or "", word) for word in words]


def drive(
    command: Command, seeds: range, keep: Path, say: Callable[[str], None] = lambda line: None
) -> list[Picture]:
    """The pictures of one run per seed, each in a new folder; copies are kept in `keep`.

    Raises UsageError, RendererError (it hung, crashed, or did not write the output) and ImageError
    (the output is not a picture).
    """
    command.arguments(Path("checked first"), 0)
    with suppress(OSError):  # remove the candidates of an earlier run
        for old in keep.glob("candidate-*"):
            old.unlink()
    pictures = []
    for k, seed in enumerate(seeds):
        say(f"candidate {k + 1} of {len(seeds)}, seed {seed}")
        with tempfile.TemporaryDirectory(prefix="candidate-", ignore_cleanup_errors=True) as name:
            folder = Path(name)
            (folder / "output").mkdir()
            output = folder / "output" / f"candidate-{k:02d}{command.suffix}"
            before = _pictures_here()
            _run(command.arguments(output, seed), folder / "said", command.seconds, seed)
            _check_written(output, before, seed)
            kept = keep / output.name
            try:
                keep.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(output, kept)
            except OSError as error:
                raise ImageError(f"{kept}: cannot be written: {error.strerror}") from None
        pictures.append(read_candidate(kept))
    return pictures


def _run(arguments: list[str], said: Path, seconds: float, seed: int) -> None:
    """Run the renderer; after the time limit, kill it and all its children."""
    with said.open("wb") as log:
        try:
            # A session of its own, so that its children can be killed with it; a file instead of
            # a pipe, which a surviving child would keep open.
            process = subprocess.Popen(
                arguments,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                **tied(),
            )
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or str(error)
            raise RendererError(f"{arguments[0]}: cannot be started: {reason}") from None
    name = Path(arguments[0]).name
    guard = _guard(process.pid)
    try:
        code = process.wait(seconds)
    except subprocess.TimeoutExpired:
        raise RendererError(
            f"{name} exceeded the time limit of {seconds:g} s with seed {seed}, and was killed "
            f"with its children; a longer --time-limit would let it run on{_last_lines(said)}"
        ) from None
    finally:
        _kill(process)
        guard.kill()
        guard.communicate()
    if code < 0:
        with suppress(ValueError):
            raise RendererError(
                f"{name} crashed with seed {seed}: {signal.Signals(-code).name}{_last_lines(said)}"
            )
    if code != 0:
        raise RendererError(
            f"{name} failed with seed {seed}: exit code {code}, expected 0{_last_lines(said)}"
        )


def _guard(group: int) -> "subprocess.Popen[bytes]":
    """A process that kills the renderer and its children when this process ends, even if it is
    killed: its standard input is then closed."""
    code = (
        "import os, signal, sys; sys.stdin.buffer.read(); "
        "os.killpg(int(sys.argv[1]), signal.SIGKILL)"
    )
    return subprocess.Popen(
        [sys.executable, "-I", "-S", "-c", code, str(group)],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,  # not killed with a group that this process is in
    )


def _kill(process: "subprocess.Popen[bytes]") -> None:
    """Kill the process and its remaining children, which could write later."""
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def _last_lines(said: Path) -> str:
    """The end of the renderer's output, in one line."""
    with said.open("rb") as file:
        file.seek(0, os.SEEK_END)
        file.seek(max(0, file.tell() - 4000))
        text = file.read().decode("utf-8", "replace")
    lines = [" ".join(line.split()) for line in text.splitlines() if line.strip()]
    printable = ["".join(c if c.isprintable() else "?" for c in line) for line in lines]
    if not printable:
        return "; it said nothing"
    return "; it said: " + " | ".join(line[:200] for line in printable[-_LAST_LINES:])


def _pictures_here() -> set[tuple[str, int]]:
    """Names and times of the pictures in the working folder, where a renderer that ignores {output}
    may write."""
    found = set()
    with suppress(OSError), os.scandir() as entries:
        for entry in entries:
            if Path(entry.name).suffix.lower() in _PICTURES:
                with suppress(OSError):
                    found.add((entry.name, entry.stat().st_mtime_ns))
    return found


def _check_written(output: Path, before: set[tuple[str, int]], seed: int) -> None:
    if output.is_file():
        return
    others = sorted(path.name for path in output.parent.iterdir())
    here = sorted(name for name, _ in _pictures_here() - before)
    if others or here:
        found = [f"{name} in the same folder" for name in others[:3]]
        found += [f"{name} in the working folder" for name in here[:3]]
        raise RendererError(
            f"the renderer wrote another file with seed {seed}: {', '.join(found)}; expected "
            f"{output.name}, at the path given by {{output}}"
        )
    raise RendererError(
        f"the renderer ended without an error with seed {seed}, but wrote no file; expected "
        f"{output.name}, at the path given by {{output}}"
    )
