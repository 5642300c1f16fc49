"""Integer hashes in uint64 arithmetic, with the same results in compiled code and plain Python."""

import numpy as np

from reference_rt.jit.kernel import kernel

LOW32 = np.uint64(0xFFFFFFFF)
_32 = np.uint64(32)
_30, _27, _31 = np.uint64(30), np.uint64(27), np.uint64(31)
_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_M1, _M2 = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)


@kernel
def mix(x: np.uint64) -> np.uint64:
    """A bijection of 64 bits in which each input bit affects each output bit (splitmix64's
    finaliser: Stafford 2011, variant 13)."""
    x = (x ^ (x >> _30)) * _M1
    x = (x ^ (x >> _27)) * _M2
    return x ^ (x >> _31)


@kernel
def combine(a: np.uint64, b: np.uint64) -> np.uint64:
    """A hash of an ordered pair."""
    return mix(a ^ mix(b + _GOLDEN))
