"""The orders in which the pairs of a group take their points, so that they are stratified jointly.

A pair takes point C n, in binary digits and modulo 2, as number n of its (0, 2)-sequence.  C is
upper triangular with ones on the diagonal: it rearranges each block of 2^k points in itself, so
that the pair by itself is as good as before.  With C_a(i, j) = binomial(j, i) a^(j - i) over the
field of 4 or of 16 elements, numbers in its digits, different a give the parts of a Faure-
Niederreiter net (Niederreiter 1987), of which the pair's own two matrices, the unit matrix and
Pascal's triangle, are another two: C_1 after C_a is C_(a + 1).  Ahmed, Skopenkov, Hadwiger & Wonka
2023, "Analysis and Synthesis of Digital Dyadic Sequences", has such pairs of pairs.
"""

import numpy as np
import numpy.typing as npt

GROUP = 5
"""Pairs of a group: dimensions 5 k to 5 k + 4."""

_MODULUS = {2: 0b111, 4: 0b10011}
"""Irreducible polynomials modulo 2, by degree: x² + x + 1, x⁴ + x + 1."""


def product(a: int, b: int, bits: int) -> int:
    """Of two elements of the field of 2^bits, polynomials written as their coefficients."""
    total = 0
    for k in range(bits):
        total ^= (b >> k & 1) * a << k
    for k in reversed(range(bits, 2 * bits)):
        if total >> k & 1:
            total ^= _MODULUS[bits] << (k - bits)
    return total


def pascal_columns(a: int, bits: int) -> list[int]:
    """C_a over the field of 2^bits: 32 columns, each with its first row as the lowest bit."""
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
    """The columns of the product `then` times `first`."""
    columns = []
    for column in first:
        total = 0
        for j in range(32):
            total ^= (column >> j & 1) * then[j]
        columns.append(total)
    return columns


def _columns() -> npt.NDArray[np.uint64]:
    """The first two pairs together are a (0, 4)-sequence in base 4, and so are the next two.  How
    the halves and the last pair lie to each other is measured: of the orders tried (of both fields,
    Sobol's further matrices, random ones) one with the least noise in scenes of direct light."""
    four, sixteen = pascal_columns(2, 2), pascal_columns(2, 4)
    orders = [pascal_columns(0, 2), four, sixteen, after(sixteen, four), pascal_columns(8, 4)]
    return np.array(orders, np.uint64)


COLUMNS = _columns()
"""(GROUP, 32): the columns of each place's matrix, as `pascal_columns`."""


def _of_digits() -> npt.NDArray[np.uint64]:
    digits = np.arange(16, dtype=np.uint64)
    bits = digits[:, None] >> np.arange(4, dtype=np.uint64) & np.uint64(1)
    columns = COLUMNS.reshape(GROUP, 8, 1, 4)
    return np.asarray(np.bitwise_xor.reduce(columns * bits, axis=-1))


OF_DIGITS = _of_digits()
"""(GROUP, 8, 16): of each hexadecimal digit of a number, by its place, lowest first, and its value,
the sum of the columns: a product with the matrix is the sum of eight of these."""
