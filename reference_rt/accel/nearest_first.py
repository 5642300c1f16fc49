"""A queue in arrays that the caller owns: a binary heap of (key, code), the smallest key first, in
any order at equal keys."""

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.jit.kernel import kernel


@kernel
def push(keys: FloatArray, codes: IntArray, n: int, key: float, code: int) -> int:
    """Adds an entry to n; how many there are now."""
    k = n
    while k > 0:
        above = (k - 1) >> 1
        if not key < keys[above]:
            break
        keys[k], codes[k] = keys[above], codes[above]
        k = above
    keys[k], codes[k] = key, code
    return n + 1


@kernel
def replace_first(keys: FloatArray, codes: IntArray, n: int, key: float, code: int) -> None:
    """Takes the first of n >= 1 entries out and adds another one."""
    k, below = 0, 1
    while below < n:
        right = below + 1
        if right < n and keys[right] < keys[below]:
            below = right
        if not keys[below] < key:
            break
        keys[k], codes[k] = keys[below], codes[below]
        k, below = below, 2 * below + 1
    keys[k], codes[k] = key, code


@kernel
def remove_first(keys: FloatArray, codes: IntArray, n: int) -> int:
    """Takes the first of n >= 1 entries out; how many there are now."""
    replace_first(keys, codes, n - 1, keys[n - 1], codes[n - 1])
    return n - 1
