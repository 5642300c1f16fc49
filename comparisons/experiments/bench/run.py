"""Measures the groups of rows one after another on this machine, or reads them if stored.

To add a row: its name and the function that measures it in `GROUPS`; the function in a file of its
own.
"""

import hashlib
import importlib.metadata
import os
import platform
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from llvmlite import binding

from comparisons.experiments.bench import mesh_rays, program, scenes, solids
from comparisons.experiments.bench.outputs import Display, markdown
from comparisons.experiments.bench.row import Row, Setting, row_from
from comparisons.results.files import write_json
from comparisons.runs import engine
from comparisons.runs.provenance import code_fingerprint, ours
from reference_rt.util.errors import ReferenceUnavailableError, UsageError
from reference_rt.util.files import replacing


class Group(NamedTuple):
    """Rows that one function measures together."""

    name: str
    rows: tuple[str, ...]
    measure: Callable[[Setting], list[Row]]


GROUPS = (
    Group("equal_samples", tuple(scenes.VARIANTS), scenes.measure_samples),
    Group(
        "mesh_rays", (*(f"rays_{kind}" for kind in mesh_rays.GOALS), "any_hit"), mesh_rays.measure
    ),
    Group("threads", ("threads",), scenes.measure_threads),
    Group("solids", tuple(f"solids_{name}" for name in solids.OPERATIONS), solids.measure),
    Group("cold", ("cold", "cold_median"), program.measure_ever),
    Group("new_kind", ("new_kind", "new_kind_median"), program.measure_new),
    Group("warm_up", ("warm_up", "after_warm_up"), program.measure_warmed),
    Group("smoke", ("smoke",), program.measure_smoke),
    Group("warm", ("warm",), program.measure_warm),
)


def all_groups(setting: Setting) -> tuple[Group, ...]:
    """Those of every scene, each of the scene's name, and the others."""
    each = [Group(n, (n,), partial(scenes.measure, n)) for n in scenes.names(setting)]
    return (*each, *GROUPS)


def chosen(patterns: Sequence[str], groups: tuple[Group, ...]) -> tuple[Group, ...]:
    """The groups with a row that matches one of these shell patterns; all groups if there are no
    patterns.  Raises UsageError for a pattern that matches no row."""
    for pattern in patterns:
        if not any(fnmatchcase(row, pattern) for group in groups for row in group.rows):
            known = ", ".join(row for group in groups for row in group.rows)
            raise UsageError(f"--only: no row has the name '{pattern}'; expected some of {known}")
    return tuple(
        group
        for group in groups
        if not patterns
        or any(fnmatchcase(row, pattern) for row in group.rows for pattern in patterns)
    )


# ---- the machine --------------------------------------------------------------------------------


_WIDTHS = (("avx512f", 512), ("avx2", 256), ("avx", 256), ("sse2", 128), ("neon", 128))
"""Vector register width in bits of each instruction set."""


def machine() -> dict[str, Any]:
    """Processor, cores, vector width, memory, system and versions, and the current load."""
    facts = ours()
    return {
        **facts,
        "vector_bits": vector_bits(),
        "memory_gib": _memory(),
        "system": platform.platform(),
        "llvmlite": importlib.metadata.version("llvmlite"),
        "mitsuba": _version("mitsuba"),
        "drjit": _version("drjit"),
        "load": round(os.getloadavg()[0], 2) if hasattr(os, "getloadavg") else None,
    }


def vector_bits() -> int | None:
    """Width in bits of the vector registers that LLVM detects; None if it cannot."""
    try:
        features = binding.get_host_cpu_features()
    except RuntimeError:
        return None
    return next((bits for name, bits in _WIDTHS if features.get(name)), None)


def _memory() -> float | None:
    try:
        return round(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") / 2**30, 1)
    except (ValueError, OSError, AttributeError):  # not available on every system
        return None


def _version(package: str) -> str | None:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


# ---- groups, one after another ------------------------------------------------------------------


SCHEMA = 1
"""Increased whenever a reader of the former layout would misread the new one."""

_PACKAGES = ("numpy", "numba", "mitsuba", "drjit")


@dataclass
class Outcome:
    """rows: in the order of the table;  not_measured: reasons, by group;  machine: see
    `machine`."""

    rows: list[Row] = field(default_factory=list)
    not_measured: dict[str, str] = field(default_factory=dict)
    machine: dict[str, Any] = field(default_factory=dict)

    @property
    def met(self) -> bool:
        """Whether everything was measured and every goal is met."""
        return not self.not_measured and all(row.met for row in self.rows)


def run(
    groups: Sequence[Group],
    setting: Setting,
    out: Path,
    display: Display,
    fresh: bool = False,
) -> Outcome:
    """Measure `groups`, and show the progress on `display`.

    Each group's rows are stored in `out`/rows and not measured again for the same sources,
    versions, machine and setting unless `fresh`; `results.json` and `bench.md` are whole after each
    group, with all stored groups.  Raises UsageError, SceneError, ImageError.
    """
    facts = machine()
    key = key_of(setting, facts)
    outcome = Outcome(machine=facts)
    for group in groups:
        path = out / "rows" / f"{group.name}.json"
        rows = None if fresh else read_rows(path, key)
        if rows is not None:
            display.done(rows, "measured before")
            continue
        display.begin(group.name)
        try:
            rows = group.measure(setting)
        except ReferenceUnavailableError as error:
            outcome.not_measured[group.name] = str(error)
            display.line(f"{group.name}: not measured: {error}")
            continue
        engine.store(path, key, [row.as_json() for row in rows])
        display.done(rows)
        _write(out, outcome, key, setting)
    _write(out, outcome, key, setting)
    return outcome


def key_of(setting: Setting, facts: dict[str, Any]) -> str:
    """A hash of all that rows depend on; stored rows with another key are not used."""
    files = sorted(p for p in setting.scenes.rglob("*") if p.is_file())
    files += [] if setting.mesh is None else [setting.mesh]
    return engine.key_of(
        sources=code_fingerprint(),
        files=[hashlib.sha256(path.read_bytes()).hexdigest() for path in files],
        versions=[importlib.metadata.version(name) for name in _PACKAGES if facts.get(name)],
        machine=[facts["machine"], facts["cores"]],
        setting=[setting.quick, setting.threads],
    )


def read_rows(path: Path, key: str) -> list[Row] | None:
    """The rows that are stored with this key, if any."""
    with suppress(KeyError, TypeError):
        kept = engine.stored(path, key)
        return None if kept is None else [row_from(row) for row in kept]
    return None


def _write(out: Path, outcome: Outcome, key: str, setting: Setting) -> None:
    """Write the outputs with the stored rows of all groups, in the order of the table."""
    groups = all_groups(setting)
    kept = {group.name: read_rows(out / "rows" / f"{group.name}.json", key) for group in groups}
    measured = [row for rows in kept.values() for row in rows or ()]
    outcome.rows = [*scenes.summary(measured), *measured]
    document = {
        "schema": SCHEMA,
        "kind": "bench",
        "machine": outcome.machine,
        "setting": {
            "scenes": str(setting.scenes),
            "mesh": None if setting.mesh is None else setting.mesh.name,
            "quick": setting.quick,
            "threads": setting.threads,
        },
        "rows": [row.as_json() for row in outcome.rows],
        "not_measured": outcome.not_measured,
    }
    write_json(out / "results.json", document)
    with replacing(out / "bench.md") as temporary:
        text = markdown(outcome.rows, outcome.machine, outcome.not_measured)
        temporary.write_text(text, encoding="utf-8")
