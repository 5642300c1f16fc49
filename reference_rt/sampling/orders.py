"""Permutations of the points of each pair in a group that stratify the pairs jointly.

Sample n of a pair takes point C n of its (0, 2)-sequence, with the matrix C over binary digits
modulo 2.  C is upper triangular with ones on the diagonal: it permutes each block of 2^k points
within itself, so that the pair itself is stratified as before.  With C_a(i, j) = binomial(j, i)
a^(j - i) over the field of 4 or 16 elements, on numbers in its digits, different a give the
components of a Faure-Niederreiter net (Niederreiter 1987).  The pair's own two matrices, the unit
matrix and Pascal's triangle, are two more, since C_1 C_a = C_(a + 1).  Ahmed, Skopenkov, Hadwiger &
Wonka 2023, "Analysis and Synthesis of Digital Dyadic Sequences", has such pairs of pairs.
"""

import numpy as np
import numpy.typing as npt

GROUP = 5
"""Pairs in a group: dimensions 5 k to 5 k + 4."""

_MODULUS = {2: 0b111, 4: 0b10011}
"""Irreducible polynomials modulo 2, by degree: x² + x + 1, x⁴ + x + 1."""


def product(a: int, b: int, bits: int) -> int:
    """The product of two elements of the field of 2^bits, polynomials with coefficients as bits."""
    total = 0
    for k in range(bits):
        total ^= (b >> k & 1) * a << k
    for k in reversed(range(bits, 2 * bits)):
        if total >> k & 1:
            total ^= _MODULUS[bits] << (k - bits)
    return total


def pascal_columns(a: int, bits: int) -> list[int]:
    """C_a over the field of 2^bits as a binary matrix: 32 columns, row 0 in the lowest bit."""
    digits = 32 // bits
    powers = [1]
    while len(powers) < digits:
        powers.append(product(powers[-1], a, bits))
    return [
        sum(
            product(1 << bit, powers[j - i], bits) << (bits * i)
            for i in range(j + 1)
            if i & j == i  # where the binomial is odd (Lucas 1878)
        )
        for j in range(digits)
        for bit in range(bits)
    ]


def after(first: list[int], then: list[int]) -> list[int]:
    """The columns of the matrix product `then` times `first`."""
    columns = []
    for column in first:
        total = 0
        for j in range(32):
            total ^= (column >> j & 1) * then[j]
        columns.append(total)
    return columns


def _columns() -> npt.NDArray[np.uint64]:
    """The first two pairs together are a (0, 4)-sequence in base 4, and so are the next two.  The
    matrices that relate these halves and the last pair were chosen by experiment: of those tried
    (from both fields, Sobol's further matrices, random ones) among the ones with the least noise in
    scenes of direct light."""
    four, sixteen = pascal_columns(2, 2), pascal_columns(2, 4)
    orders = [pascal_columns(0, 2), four, sixteen, after(sixteen, four), pascal_columns(8, 4)]
    return np.array(orders, np.uint64)


COLUMNS = _columns()
"""(GROUP, 32): the columns of each pair's matrix, as `pascal_columns`."""


def _of_digits() -> npt.NDArray[np.uint64]:
    digits = np.arange(16, dtype=np.uint64)
    bits = digits[:, None] >> np.arange(4, dtype=np.uint64) & np.uint64(1)
    columns = COLUMNS.reshape(GROUP, 8, 1, 4)
    return np.asarray(np.bitwise_xor.reduce(columns * bits, axis=-1))


OF_DIGITS = _of_digits()
"""(GROUP, 8, 16): lookup table of the matrix products, by hexadecimal digit (lowest first) and its
value: the product of a number with a pair's matrix is the sum (XOR) of eight entries."""
