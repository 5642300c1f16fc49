"""Runs POV-Ray: finds the program, and reads its pictures."""

import functools
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import OpenEXR

from reference_rt.core.arrays import FloatArray
from reference_rt.util.errors import ReferenceUnavailableError
from reference_rt.util.files import temporary_folder
from reference_rt.util.processes import tied

HOW = "apt install povray"

SERIES = "3.7"
"""The versions whose pictures were measured."""

SECONDS = 600.0
"""Time limit of one run: against hanging, not against slow machines."""


def program() -> str:
    """The path of POV-Ray.  Raises ReferenceUnavailableError."""
    found = shutil.which("povray")
    if found is None:
        raise ReferenceUnavailableError(f"POV-Ray is not installed; to get it: {HOW}")
    return found


def version() -> str:
    """Such as 3.7.0.10.  Raises ReferenceUnavailableError, also for another series."""
    return _version(program())


@functools.cache
def _version(path: str) -> str:
    try:
        run = subprocess.run(
            [path, "--version"],
            capture_output=True,
            text=True,
            timeout=60.0,
            check=False,
            **tied(),
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise ReferenceUnavailableError(f"{path}: {error}; expected: {HOW}") from None
    told = re.search(r"POV-Ray (\d+(?:\.\d+)+)", run.stdout + run.stderr)
    if told is None or not told[1].startswith(f"{SERIES}."):
        found = "no version" if told is None else told[1]
        raise ReferenceUnavailableError(f"{path}: is {found}; expected POV-Ray {SERIES}: {HOW}")
    return told[1]


def rendered(text: str, width: int, height: int, threads: int | None = None) -> FloatArray:
    """The picture (height, width, 3) of a text, of half floats.  Raises
    ReferenceUnavailableError."""
    with temporary_folder() as folder:
        _run(text, folder, ("+FE", f"+W{width}", f"+H{height}"), threads)
        planes = OpenEXR.File(str(folder / "out.exr"), separate_channels=True).channels()
        return np.stack([planes[c].pixels.astype(np.float64) for c in "RGB"], axis=-1)


def frames(
    text: str, width: int, height: int, count: int, threads: int | None = None
) -> FloatArray:
    """The first `count` frames, fewer than ten, (count, height, width, 3), of 16 bits from 0 to 1.
    Raises ReferenceUnavailableError."""
    with temporary_folder() as folder:
        size = (f"+W{width}", f"+H{height}", "+KFI1", f"+KFF{count}")
        _run(text, folder, ("+FP16", *size), threads)
        found = [(folder / f"out{k}.ppm").read_bytes() for k in range(1, count + 1)]
    head = re.compile(rb"P6\s+(?:#.*\s+)*(\d+)\s+(\d+)\s+65535\s")
    values = []
    for data in found:
        begun = head.match(data)
        if begun is None or tuple(map(int, begun.groups())) != (width, height):
            raise ReferenceUnavailableError("POV-Ray: wrote no picture of 16 bits")
        values.append(np.frombuffer(data, ">u2", offset=begun.end()).reshape(height, width, 3))
    return np.stack(values) / 65535.0


def _run(text: str, folder: Path, options: tuple[str, ...], threads: int | None) -> None:
    scene = folder / "scene.pov"
    scene.write_text(text, encoding="utf-8")
    ending = "exr" if "+FE" in options else "ppm"
    command = [program(), f"+I{scene}", f"+O{folder / f'out.{ending}'}", *options, "-D", "-A"]
    if threads is not None:
        command.append(f"+WT{threads}")
    try:
        run = subprocess.run(
            [*command, "File_Gamma=1"],
            capture_output=True,
            text=True,
            errors="replace",
            timeout=SECONDS,
            check=False,
            cwd=folder,
            **tied(),
        )
    except subprocess.TimeoutExpired:
        raise ReferenceUnavailableError(f"POV-Ray: no picture in {SECONDS:g} s") from None
    if run.returncode != 0:
        told = [line for line in run.stderr.splitlines() if "rror" in line]
        raise ReferenceUnavailableError(
            f"POV-Ray: {(told or [f'exit code {run.returncode}'])[-1].strip()}"
        )
