"""Runs another renderer's command line, once per replicate, or once for several."""

import json
import os
import re
import select
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from comparisons.gate.pictures_in import Picture, read_candidate
from reference_rt.util.errors import ImageError, ReferenceRtError, UsageError
from reference_rt.util.files import discard, kind_of, replacing, temporary_folder


class RendererError(ReferenceRtError):
    """The renderer under test hung, crashed, or did not write the requested file."""

    exit_code = 4


PLACEHOLDERS = ("scene", "output", "seed", "seeds", "spp", "width", "height")

_BRACES = re.compile(r"\{([A-Za-z_]*)\}")

_PICTURES = (".exr", ".png", ".pfm", ".hdr", ".npy", ".jpg", ".jpeg", ".ppm", ".tif", ".tiff")

LOG = "renderer.log"
"""The file beside the pictures for what a renderer that failed printed, at most 10 MB."""

_LAST_LINES = 5
"""Lines of a failed renderer's output that a message quotes."""


@dataclass(frozen=True)
class Command:
    """How a renderer is called.

    template: the command line, split like a shell's but run without a shell; the PLACEHOLDERS in
    its arguments are replaced;  scene: the file for {scene};  size: {width} and {height};  suffix:
    the output's, from which most renderers derive the format;  seconds: time limit of one picture;
    name: the renderer's in messages, by default that of the program.

    With {seeds} the renderer makes several pictures in one start: {seeds} becomes "1,2,3", and
    {output} a file name with %d in place of the seed.
    """

    template: str
    scene: Path | None = None
    spp: int | None = None
    suffix: str = ".exr"
    seconds: float = 600.0
    size: tuple[int, int] | None = None
    name: str = ""

    @classmethod
    def of_page(cls, page: str, **values: Any) -> "Command":
        """A web page, with its `?query`, as a renderer;  values: those of `Command`, of which
        `scene` is the file that the page gets, named scene.json."""
        known = {"spp", "size"} & {key for key, value in values.items() if value is not None}
        sizes = ("{width}", "{height}") if "size" in known else ("-", "-")
        module, wall = "comparisons.gate.browser", Path(__file__).with_name("without_network.py")
        data = "-" if values["scene"] is None else str(values["scene"].parent)
        words = [sys.executable, "-I", "-S", str(wall)]
        words += [sys.executable, "-P", "-m", module, page, data, "{output}", "{seeds}"]
        words += ["{spp}" if "spp" in known else "-", *sizes]
        return cls(shlex.join(words), name=Path(page.partition("?")[0]).name, **values)

    @property
    def together(self) -> bool:
        """Whether one start makes the pictures of several seeds."""
        return "{seeds}" in self.template

    def arguments(self, output: Path, *seeds: int) -> list[str]:
        """The arguments of one start.  Raises UsageError."""
        try:
            words = shlex.split(self.template)
        except ValueError as error:
            raise UsageError(f"--command: {str(error).lower()}; expected closed quotes") from None
        if not words:
            raise UsageError("--command: is empty; expected a program and its arguments")
        width, height = (None, None) if self.size is None else map(str, self.size)
        values = {
            "scene": None if self.scene is None else str(self.scene),
            "output": str(output),
            "seed": str(seeds[0]),
            "seeds": ",".join(map(str, seeds)),
            "spp": None if self.spp is None else str(self.spp),
            "width": width,
            "height": height,
        }
        named = {name for word in words for name in _BRACES.findall(word)}
        known = ", ".join(f"{{{name}}}" for name in PLACEHOLDERS)
        for name in sorted(named - set(PLACEHOLDERS)):
            raise UsageError(f"--command: there is no {{{name}}}; expected some of {known}")
        if "output" not in named:
            raise UsageError("--command: has no {output}; expected it as the picture's file name")
        if {"seed", "seeds"} <= named:
            raise UsageError("--command: has {seed} and {seeds}; expected one of them")
        for name in sorted(named):
            if values[name] is None:
                option = "size or --scene" if name in ("width", "height") else name
                raise UsageError(f"--command: has {{{name}}}; expected --{option} too")
        return [_BRACES.sub(lambda match: values[match[1]] or "", word) for word in words]


class Driver:
    """Runs a renderer, each time in a new folder; copies of its pictures are kept in `keep`, from
    which those of an earlier gate are removed.  say: is told of each start;  read: what is done to
    pictures that were read.  Raises UsageError for a command that cannot be run, ImageError for
    what is in a picture's place and is no file."""

    def __init__(
        self,
        command: Command,
        keep: Path,
        say: Callable[[str], None] = lambda line: None,
        read: Callable[[Sequence[Picture]], list[Picture]] = list,
    ) -> None:
        command.arguments(Path("checked first"), 0)
        self._command, self._keep, self._say, self._read = command, keep, say, read
        self.made: list[Path] = []
        """The pictures that are kept."""
        self.seconds = 0.0
        """Wall clock of all starts."""
        with suppress(OSError):
            for old in (keep / LOG, *keep.glob("candidate-*")):
                discard(old)

    @property
    def together(self) -> bool:
        """Whether one start makes several pictures."""
        return self._command.together

    def pictures(self, seeds: Sequence[int]) -> list[Picture]:
        """A picture for each seed.

        Raises RendererError (it hung, crashed, or did not write an output) and ImageError (an
        output is not a picture).
        """
        starts = [seeds] if self._command.together else [[seed] for seed in seeds]
        return [picture for start in starts if start for picture in self._start(start)]

    def _start(self, seeds: Sequence[int]) -> list[Picture]:
        which = _named(seeds)
        first = len(self.made) + 1
        last = first + len(seeds) - 1
        number = f"candidate {first}" if last == first else f"candidates {first} to {last}"
        self._say(f"{number}, {which}")
        suffix = self._command.suffix
        with temporary_folder() as place:
            folder = place / "output"
            folder.mkdir()
            if self._command.together:
                pattern = folder / f"candidate-%d{suffix}"
                outputs = [folder / f"candidate-{seed}{suffix}" for seed in seeds]
            else:
                pattern = folder / f"candidate-{len(self.made):02d}{suffix}"
                outputs = [pattern]
            before = _pictures_here()
            arguments = self._command.arguments(pattern, *seeds)
            begun = time.perf_counter()
            try:
                name = self._command.name or Path(arguments[0]).name
                _run(arguments, place / "said", self._command.seconds * len(seeds), which, name)
                for output in outputs:
                    _check_written(output, before, which)
            except RendererError:
                self._keep_log(place / "said")
                raise
            finally:
                self.seconds += time.perf_counter() - begun
            kept = [self._kept(output) for output in outputs]
        return self._read([read_candidate(path) for path in kept])

    def _kept(self, output: Path) -> Path:
        """Copy a picture; its place among those that are kept.  Raises ImageError."""
        kept = self._keep / f"candidate-{len(self.made):02d}{self._command.suffix}"
        with replacing(kept) as temporary:
            shutil.copyfile(output, temporary)
        self.made.append(kept)
        return kept

    def _keep_log(self, said: Path) -> None:
        """Keep what a renderer that failed printed."""
        with suppress(ImageError), replacing(self._keep / LOG) as temporary:
            shutil.copyfile(said, temporary)


def _named(seeds: Sequence[int]) -> str:
    return f"seed {seeds[0]}" if len(seeds) == 1 else f"seeds {', '.join(map(str, seeds))}"


def _run(arguments: list[str], said: Path, seconds: float, which: str, name: str) -> None:
    """Run the renderer; after the time limit, kill it and all processes that came from it.  said:
    the file for what it prints."""
    supervisor = Path(__file__).with_name("supervisor.py")
    try:
        process = subprocess.Popen(
            [sys.executable, "-I", "-S", str(supervisor), str(said), *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,  # not interrupted or killed with this process's group
        )
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise RendererError(f"{arguments[0]}: cannot be started: {reason}") from None
    try:
        assert process.stdout is not None
        # It answers when the renderer has ended.
        in_time = bool(select.select([process.stdout], [], [], seconds)[0])
    finally:
        answer, _ = process.communicate()  # closes its standard input, and waits for it
    if not in_time:
        raise RendererError(
            f"{name} exceeded the time limit of {seconds:g} s with {which}, and was killed "
            f"with its children; a longer --time-limit would let it run on{_last_lines(said)}"
        )
    try:
        answered = json.loads(answer)
    except ValueError:
        raise RendererError(f"{name}: the process that watches it was killed") from None
    if "error" in answered:
        raise RendererError(f"{arguments[0]}: cannot be started: {answered['error']}")
    code = answered["code"]
    if code < 0:
        with suppress(ValueError):
            raise RendererError(
                f"{name} crashed with {which}: {signal.Signals(-code).name}{_last_lines(said)}"
            )
    if code != 0:
        raise RendererError(
            f"{name} failed with {which}: exit code {code}, expected 0{_last_lines(said)}"
        )


def _last_lines(said: Path) -> str:
    """The end of the renderer's output, in one line."""
    text = said.read_bytes()[-4000:].decode("utf-8", "replace")
    lines = [" ".join(line.split()) for line in text.splitlines() if line.strip()]
    printable = ["".join(c if c.isprintable() else "?" for c in line) for line in lines]
    if not printable:
        return "; it said nothing"
    return "; it said: " + " | ".join(line[:200] for line in printable[-_LAST_LINES:])


def _pictures_here() -> set[tuple[str, int]]:
    """Names and times of the pictures in the working folder, where a renderer that ignores {output}
    may write."""
    names = set()
    with suppress(OSError), os.scandir() as entries:
        for entry in entries:
            if Path(entry.name).suffix.lower() in _PICTURES:
                with suppress(OSError):
                    names.add((entry.name, entry.stat().st_mtime_ns))
    return names


def _check_written(output: Path, before: set[tuple[str, int]], which: str) -> None:
    if output.is_file():
        return
    if os.path.lexists(output):
        there = kind_of(output) or "is a link to nothing"
        raise RendererError(
            f"what the renderer wrote with {which} {there}; expected a picture's file at the path "
            f"given by {{output}}"
        )
    others = sorted(path.name for path in output.parent.iterdir())
    here = sorted(name for name, _ in _pictures_here() - before)
    if others or here:
        places = [f"{name} in the same folder" for name in others[:3]]
        places += [f"{name} in the working folder" for name in here[:3]]
        raise RendererError(
            f"the renderer wrote another file with {which}: {', '.join(places)}; expected "
            f"{output.name}, at the path given by {{output}}"
        )
    raise RendererError(
        f"the renderer ended without an error with {which}, but wrote no file; expected "
        f"{output.name}, at the path given by {{output}}"
    )
