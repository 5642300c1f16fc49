"""The code fingerprint: a change of any line of the sources invalidates stored results."""

import functools
import hashlib
from pathlib import Path

import reference_rt

_COMPARISONS = Path(__file__).parents[1]


@functools.cache
def code_fingerprint(*excluded: str) -> str:
    """SHA-256 of the sources of both packages, without the `excluded` modules and packages of
    `comparisons`."""
    digest = hashlib.sha256()
    for root in (Path(reference_rt.__path__[0]), _COMPARISONS):
        for source in sorted(root.rglob("*.py")):
            name = source.relative_to(root)
            if root == _COMPARISONS and name.parts[0] in excluded:
                continue
            digest.update(name.as_posix().encode() + b"\0")
            digest.update(hashlib.sha256(source.read_bytes()).digest())
    return digest.hexdigest()
