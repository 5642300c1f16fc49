"""Provenance: versions, machine and date, which a reader needs to repeat a run."""

import datetime
import importlib.metadata
import os
import platform
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.mitsuba.backend import backend


def provenance(**more: Any) -> dict[str, Any]:
    """Versions, machine and date, and `more`.  Raises ReferenceUnavailableError."""
    chosen = backend()
    return {
        **ours(),
        "mitsuba": f"{chosen.version}, {chosen.variant}: {chosen.reason}",
        **more,
    }


def ours() -> dict[str, Any]:
    """The same without Mitsuba, for runs that do not use it."""
    return {
        "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "reference_rt": importlib.metadata.version("reference-rt"),
        "numpy": np.__version__,
        "numba": importlib.metadata.version("numba"),
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}, {_processor()}",
        "cores": os.cpu_count(),
    }


def _processor() -> str:
    """The processor's name, if the system reports it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or "unknown processor"
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else "unknown processor"
