"""Candidates that are bit for bit pictures of the reference: nothing has changed.

A renderer whose seeds are fixed makes the pictures of its baseline again as long as its result is
the same. Such pictures are no independent sample, and need none: their difference is known, and
is zero. If only some are copies, the others are compared with the reference.
"""

import hashlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from comparisons.gate.pictures_in import Picture
from reference_rt.core.arrays import FloatArray


def fingerprint(picture: FloatArray) -> str:
    """SHA-256 of the values of (height, width, 3) as float32, in which pictures are stored; of a
    picture as a whole outside its normal numbers as float64, since float32 would round 1e-200 and
    1.5e-200 to the same number."""
    largest = float(np.abs(picture[np.isfinite(picture)]).max(initial=0.0))
    known = np.finfo(np.float32)
    fits = largest == 0.0 or float(known.tiny) <= largest <= float(known.max)
    values = picture.astype("<f4" if fits else "<f8") + 0.0  # -0 and 0 are the same radiance
    digest = hashlib.sha256(str(values.shape).encode())
    digest.update(np.ascontiguousarray(values).tobytes())
    return digest.hexdigest()


@dataclass
class Copies:
    """Sorts candidates into copies of the reference's pictures and others.  left: the fingerprints
    of pictures that no candidate is a copy of yet: each may be copied once, since replicates that
    are all the same picture are wrong."""

    left: Counter[str]
    total: int
    count: int = 0

    @classmethod
    def of(cls, fingerprints: Sequence[str]) -> "Copies":
        """fingerprints: those of the reference's pictures; none if it cannot be copied."""
        return cls(Counter(fingerprints), len(fingerprints))

    def others(self, candidates: Sequence[Picture]) -> list[Picture]:
        """The candidates that are no copies; the copies are counted."""
        others = []
        for candidate in candidates:
            name = fingerprint(candidate.radiance) if self.total else ""
            if self.left[name] > 0:
                self.left[name] -= 1
                self.count += 1
            else:
                others.append(candidate)
        return others

    def note(self, others: int) -> str:
        """About copies among candidates of which so many are none; "" without copies."""
        if not self.count:
            return ""
        are = "is a copy" if self.count == 1 else "are copies"
        return (
            f"{self.count} of {self.count + others} candidates {are} of the reference's pictures, "
            "bit for bit, as the same seeds make them; they are left out, and the others compared"
        )

    @property
    def words(self) -> str:
        """That all candidates are copies."""
        each = "the candidate is" if self.count == 1 else f"each of the {self.count} candidates is"
        return (
            f"{each} one of the reference's "
            + (f"{self.total} pictures" if self.total > 1 else "picture")
            + ", bit for bit: nothing has changed"
        )
