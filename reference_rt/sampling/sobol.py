"""Sobol' sampler: padded groups of (0, 2)-sequences with hash-based Owen scrambling.

Each pair is the first two dimensions of Sobol's sequence, with order and digits scrambled by hashes
(Burley 2020, "Practical Hash-based Owen Scrambling", JCGT 9(4)): the first 2^k samples of a pixel
are stratified in every pair, and every number is uniform.  Groups of pairs are independent, and so
are pixels; the pairs of a group take their points in different orders, which stratify them jointly.
"""

from typing import Annotated, ClassVar, Literal, NamedTuple

import numpy as np
import numpy.typing as npt
from pydantic import Field

from reference_rt.core.model import Description, Examples
from reference_rt.jit.kernel import kernel
from reference_rt.sampling.independent import LOW32, combine, mix

_1, _2, _4, _8, _15, _16, _32 = (np.uint64(n) for n in (1, 2, 4, 8, 15, 16, 32))
_ODD = np.uint64(1)
_EVEN_1, _ODD_1 = np.uint64(0x55555555), np.uint64(0xAAAAAAAA)
_EVEN_2, _ODD_2 = np.uint64(0x33333333), np.uint64(0xCCCCCCCC)
_EVEN_4, _ODD_4 = np.uint64(0x0F0F0F0F), np.uint64(0xF0F0F0F0)
_EVEN_8, _ODD_8 = np.uint64(0x00FF00FF), np.uint64(0xFF00FF00)
K0, K1, K2 = np.uint64(0x3D20ADEA), np.uint64(0x05526C56), np.uint64(0x53A22864)
_STEP = np.uint64(0x9E3779B97F4A7C15)

PASCAL_MASKS = (np.uint64(0xFFFF0000), _ODD_8, _ODD_4, _ODD_2, _ODD_1)
"""The bits that `pascal` shifts down by 16, 8, 4, 2 and 1."""


class Sobol(Description):
    """Owen-scrambled Sobol' points: stratified and unbiased, with the least noise for powers of
    two."""

    EXAMPLES: ClassVar[Examples] = ({"spp": 4}, {"spp": 4, "seed": 3})
    type: Literal["sobol"] = "sobol"
    spp: Annotated[int, Field(ge=1, le=2**31)] = 16
    """Samples per pixel; powers of two have the least noise."""
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    """Selects the random numbers: pictures of different seeds are independent."""

    def setup(self) -> "SobolSetup":
        return SobolSetup(np.uint64(self.seed))


class SobolSetup(NamedTuple):
    seed: np.uint64


class SobolSample(NamedTuple):
    """key: a hash of seed and pixel;  reversed_index: the sample's number, bits reversed."""

    key: np.uint64
    reversed_index: np.uint64


@kernel
def reverse_bits(x: np.uint64) -> np.uint64:
    """The low 32 bits in reverse order."""
    x = ((x & _EVEN_1) << _1) | ((x & _ODD_1) >> _1)
    x = ((x & _EVEN_2) << _2) | ((x & _ODD_2) >> _2)
    x = ((x & _EVEN_4) << _4) | ((x & _ODD_4) >> _4)
    x = ((x & _EVEN_8) << _8) | ((x & _ODD_8) >> _8)
    return ((x << _16) | (x >> _16)) & LOW32


@kernel
def scramble_low_to_high(x: np.uint64, seed: np.uint64) -> np.uint64:
    """A hash of 32 bits in which each bit depends only on itself and those below it (Laine & Karras
    2011, with Vegdahl's constants): Owen scrambling of the bit-reversed number."""
    x ^= x * K0 & LOW32
    x = (x + seed) & LOW32
    x = x * ((seed >> _16) | _ODD) & LOW32
    x ^= x * K1 & LOW32
    x ^= x * K2 & LOW32
    return x


@kernel
def pascal(x: np.uint64) -> np.uint64:
    """The second generator matrix of Sobol's sequence, bit-reversed: Pascal's triangle modulo 2,
    as a butterfly (Ahmed 2024, "An Implementation Algorithm of 2D Sobol Sequence")."""
    x ^= x >> _16
    x ^= (x & _ODD_8) >> _8
    x ^= (x & _ODD_4) >> _4
    x ^= (x & _ODD_2) >> _2
    return x ^ ((x & _ODD_1) >> _1)


@kernel
def start(setup: SobolSetup, pixel: int, sample: int) -> SobolSample:
    return SobolSample(combine(setup.seed, np.uint64(pixel)), reverse_bits(np.uint64(sample)))


@kernel
def split(sampler: SobolSample, n: int, k: int) -> SobolSample:
    number = reverse_bits(sampler.reversed_index) * np.uint64(n) + np.uint64(k)
    return SobolSample(sampler.key, reverse_bits(number & LOW32))


@kernel
def hash_of(key: np.uint64, dimension: int) -> np.uint64:
    """The hash of seed, pixel (in key) and dimension."""
    return mix(key + np.uint64(dimension + 1) * _STEP)


@kernel
def seeds_of(key: np.uint64, dimension: int) -> tuple[np.uint64, np.uint64, np.uint64]:
    """Seeds for the order of a pixel's samples, which a group shares, and for the digits of x and
    of y."""
    h = hash_of(key, dimension)
    return hash_of(key, dimension - dimension % GROUP) & LOW32, h >> _32, mix(h) & LOW32


@kernel
def reordered(index: np.uint64, place: int) -> np.uint64:
    """The index of the point that pair number `place` of its group takes for sample `index`: the
    product with its matrix in `orders`."""
    if place == 0:
        return index
    total = np.uint64(0)
    for k in range(8):
        total ^= OF_DIGITS[place, k, (index >> np.uint64(4 * k)) & _15]
    return total


@kernel
def pair(
    seeds: tuple[np.uint64, np.uint64, np.uint64], place: int, reversed_index: np.uint64
) -> tuple[float, float]:
    """Two multiples of 2^-32 plus 2^-33, the middles of cells: never 0, never 1."""
    order, x_seed, y_seed = seeds
    index = reordered(reverse_bits(scramble_low_to_high(reversed_index, order)), place)
    x = reverse_bits(scramble_low_to_high(index, x_seed))
    y = reverse_bits(scramble_low_to_high(pascal(index), y_seed))
    return (float(x) + 0.5) * 2.0**-32, (float(y) + 0.5) * 2.0**-32


@kernel
def draw(sampler: SobolSample, dimension: int) -> tuple[float, float]:
    return pair(seeds_of(sampler.key, dimension), dimension % GROUP, sampler.reversed_index)


# ---- the orders of a group's pairs ---------------------------------------------------------------
# Permutations of the points of each pair in a group that stratify the pairs jointly.
#
# Sample n of a pair takes point C n of its (0, 2)-sequence, with the matrix C over binary digits
# modulo 2.  C is upper triangular with ones on the diagonal: it permutes each block of 2^k points
# within itself, so that the pair itself is stratified as before.  With C_a(i, j) = binomial(j, i)
# a^(j - i) over the field of 4 or 16 elements, on numbers in its digits, different a give the
# components of a Faure-Niederreiter net (Niederreiter 1987).  The pair's own two matrices, the unit
# matrix and Pascal's triangle, are two more, since C_1 C_a = C_(a + 1).  Ahmed, Skopenkov, Hadwiger
# & Wonka 2023, "Analysis and Synthesis of Digital Dyadic Sequences", has such pairs of pairs.

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
