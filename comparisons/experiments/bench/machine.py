"""Properties of the machine that affect speed."""

import importlib.metadata
import os
import platform
from typing import Any

from llvmlite import binding

from comparisons.runs.provenance import ours

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
