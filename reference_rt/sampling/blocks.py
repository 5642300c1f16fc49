"""SIMD Sobol' sampler: the pairs of `sobol.draw` for a block of 16 samples of a pixel at once.

All samples of a pixel share the seeds of a pair; each lane of a vector computes one sample.
`fill_plainly` is the scalar version.  The vector code does the same operations on 32-bit integers,
with the same bits as results; LLVM splits the vectors where the processor's are narrower.
(Measured on the Cornell box: pairs took a fifth of the time when they were computed singly.)
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.jit.kernel import kernel
from reference_rt.jit.numba_codegen import call_llvm, constant, data_of, nothing, variable
from reference_rt.sampling import sobol
from reference_rt.sampling.sobol import GROUP, OF_DIGITS, SobolSetup, pair, reverse_bits, seeds_of

BLOCK_SAMPLES = 16
"""Samples in a block."""

DIMENSIONS = 11 * GROUP
"""The dimensions whose pairs are computed in blocks, those of the first eleven bounces; later ones
are computed singly.  Their pairs take 11 KiB, which leaves most of the L1 cache to the scene."""

SINGLY = 2**40
"""From this pixel number on all pairs are computed singly: no picture has as many pixels.  For
samples in between those of a pixel, such as the filter's strata, whose pairs would replace those of
the pixel's block each time."""

_MOST_SAMPLES = 2**31
_MOST_BLOCKS = _MOST_SAMPLES // BLOCK_SAMPLES

FLOATS, INTEGERS = 2 * BLOCK_SAMPLES * DIMENSIONS, DIMENSIONS
"""The sizes of `BlockSample.pairs` and `BlockSample.made`."""


class BlockSample(NamedTuple):
    """key: a hash of seed and pixel;  sample: its number in the pixel;  block: a unique number of
    its block, -1 for none;  pairs (FLOATS,): a cache, for each dimension u0 and u1 of all lanes;
    made (INTEGERS,): the block whose pairs each dimension holds, -1 for none."""

    key: np.uint64
    sample: int
    block: int
    pairs: FloatArray
    made: IntArray


@kernel
def start(
    setup: SobolSetup, pixel: int, sample: int, pairs: FloatArray, made: IntArray
) -> BlockSample:
    block = pixel * _MOST_BLOCKS + sample // BLOCK_SAMPLES if pixel < SINGLY else -1
    return BlockSample(sobol.start(setup, pixel, 0).key, sample, block, pairs, made)


@kernel
def split(sampler: BlockSample, n: int, k: int) -> BlockSample:
    number, block = (sampler.sample * n + k) % _MOST_SAMPLES, sampler.block
    if block >= 0:
        block += number // BLOCK_SAMPLES - block % _MOST_BLOCKS
    return BlockSample(sampler.key, number, block, sampler.pairs, sampler.made)


@kernel
def draw(sampler: BlockSample, dimension: int) -> tuple[float, float]:
    """The same numbers as `sobol.draw`."""
    sample, pairs = sampler.sample, sampler.pairs
    if dimension >= DIMENSIONS or sampler.block < 0:
        seeds = seeds_of(sampler.key, dimension)
        return pair(seeds, dimension % GROUP, reverse_bits(np.uint64(sample)))
    at = 2 * BLOCK_SAMPLES * dimension
    lane = sample % BLOCK_SAMPLES
    if sampler.made[dimension] != sampler.block:
        order, x_seed, y_seed = seeds_of(sampler.key, dimension)
        fill(order, x_seed, y_seed, dimension % GROUP, sample - lane, pairs, at)
        sampler.made[dimension] = sampler.block
    return pairs[at + lane], pairs[at + BLOCK_SAMPLES + lane]


@kernel
def fill_plainly(
    order: np.uint64,
    x_seed: np.uint64,
    y_seed: np.uint64,
    place: int,
    first: int,
    pairs: FloatArray,
    at: int,
) -> None:
    """Computes the pairs of TOGETHER samples from `first` on: u0 into pairs[at :], then u1."""
    for lane in range(BLOCK_SAMPLES):
        u0, u1 = pair((order, x_seed, y_seed), place, reverse_bits(np.uint64(first + lane)))
        pairs[at + lane], pairs[at + BLOCK_SAMPLES + lane] = u0, u1


_WORDS = ir.VectorType(ir.IntType(32), BLOCK_SAMPLES)
_REALS = ir.VectorType(ir.DoubleType(), BLOCK_SAMPLES)


def _all(value: int | float, of: ir.VectorType = _WORDS) -> ir.Constant:
    return ir.Constant(of, [value] * BLOCK_SAMPLES)


def _reverse(builder: ir.IRBuilder, x: ir.Value) -> ir.Value:
    return call_llvm(builder, f"llvm.bitreverse.v{BLOCK_SAMPLES}i32", _WORDS, [x])


def _scramble(builder: ir.IRBuilder, x: ir.Value, seed: ir.Value) -> ir.Value:
    """`sobol.scramble_low_to_high`; 32-bit integers wrap without masks."""

    def stir(x: ir.Value, factor: np.uint64) -> ir.Value:
        return builder.xor(x, builder.mul(x, _all(int(factor))))

    odd = builder.or_(builder.lshr(seed, _all(16)), _all(1))
    x = builder.mul(builder.add(stir(x, sobol.K0), seed), odd)
    return stir(stir(x, sobol.K1), sobol.K2)


def _pascal(builder: ir.IRBuilder, x: ir.Value) -> ir.Value:
    """`sobol.pascal`."""
    for shift, kept in zip((16, 8, 4, 2, 1), sobol.PASCAL_MASKS, strict=True):
        moved = builder.lshr(builder.and_(x, _all(int(kept))), _all(shift))
        x = builder.xor(x, moved)
    return x


def _reordered(builder: ir.IRBuilder, x: ir.Value, place: ir.Value, lanes: Any) -> ir.Value:
    """`sobol.reordered`.  Each bit of `x` depends only on the sample number's bits from there up,
    so that lanes differ in the lowest digit alone: the other digits are summed once for all."""
    number, word = place.type, ir.IntType(32)
    values = ir.Constant(ir.ArrayType(word, OF_DIGITS.size), [int(x) for x in OF_DIGITS.ravel()])
    table = constant(builder, "sampling_orders", values)
    total = variable(builder, x)
    with builder.if_then(builder.icmp_signed(">", place, number(0))):

        def of_digit(k: int, digit: ir.Value) -> ir.Value:
            row = builder.add(builder.mul(place, number(8)), number(k))
            start = builder.add(builder.mul(row, number(16)), digit)
            return builder.load(builder.gep(table, [number(0), start], inbounds=True))

        one, shared = builder.extract_element(x, word(0)), word(0)
        for k in range(1, 8):
            digit = builder.and_(builder.lshr(one, word(4 * k)), word(15))
            shared = builder.xor(shared, of_digit(k, builder.zext(digit, number)))
        sums = lanes(shared)
        for bit in range(4):
            set_to_all = builder.ashr(builder.shl(x, _all(31 - bit)), _all(31))
            kept = builder.and_(set_to_all, lanes(of_digit(0, number(1 << bit))))
            sums = builder.xor(sums, kept)
        builder.store(sums, total)
    return builder.load(total)


def _generate(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any) -> ir.Value:
    *seeds, place, first, pairs, at = arguments

    def broadcast(x: ir.Value) -> ir.Value:
        word = ir.IntType(32)
        low = x if x.type == word else builder.trunc(x, word)
        one = builder.insert_element(_all(0), low, word(0))
        return builder.shuffle_vector(one, _all(0), _all(0))

    def store(x: ir.Value, offset: int) -> None:
        u = builder.uitofp(_reverse(builder, x), _REALS)
        u = builder.fmul(builder.fadd(u, _all(0.5, _REALS)), _all(2.0**-32, _REALS))
        data = data_of(context, builder, signature.args[5], pairs)
        place = builder.gep(data, [builder.add(at, at.type(offset))])
        builder.store(u, builder.bitcast(place, _REALS.as_pointer()), align=8)

    order, x_seed, y_seed = (broadcast(seed) for seed in seeds)
    sample = builder.add(broadcast(first), ir.Constant(_WORDS, list(range(BLOCK_SAMPLES))))
    index = _reverse(builder, _scramble(builder, _reverse(builder, sample), order))
    index = _reordered(builder, index, place, broadcast)
    store(_scramble(builder, index, x_seed), 0)
    store(_scramble(builder, _pascal(builder, index), y_seed), BLOCK_SAMPLES)
    return nothing(context)


@intrinsic  # type: ignore[untyped-decorator]
def _fill(
    typing_context: Any,
    order: Any,
    x_seed: Any,
    y_seed: Any,
    place: Any,
    first: Any,
    pairs: Any,
    at: Any,
) -> Any:
    seed, number = types.uint64, types.int64
    return types.void(seed, seed, seed, number, number, pairs, number), _generate


fill: Callable[..., None] = fill_plainly if numba.config.DISABLE_JIT else _fill
