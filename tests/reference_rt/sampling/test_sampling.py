"""Samplers: uniform, stratified where promised, and functions of their arguments alone."""

import functools
import itertools
import operator

import numpy as np
import pytest

import reference_rt as rt
from reference_rt.jit.kernel import entry_kernel
from reference_rt.sampling import (
    PAIR_FLOATS,
    PAIR_INTEGERS,
    blocks,
    draw_pair,
    sobol,
    split_sample,
    start_in_block,
    start_sample,
)
from reference_rt.sampling.sobol import COLUMNS, GROUP, after, pascal_columns, product

SAMPLERS = [rt.Sobol, rt.Independent]

CHI2_255 = 377.08
"""The quantile 1 - 1e-6 of chi-square with 255 degrees of freedom: scipy.stats.chi2.ppf."""


@entry_kernel
def _draw_all(setup, pixels, samples, dimension, out):
    for i in range(len(pixels)):
        out[i, 0], out[i, 1] = draw_pair(start_sample(setup, pixels[i], samples[i]), dimension)


def draw(sampler, pixels, samples, dimension):
    """(n, 2): the pair of each (pixel, sample)."""
    pixels, samples = np.broadcast_arrays(np.int64(pixels), np.int64(samples))
    out = np.empty((len(pixels), 2))
    _draw_all(sampler.setup(), pixels.copy(), samples.copy(), dimension, out)
    return out


def chi_square(points, cells=16):
    """Against uniform over cells x cells squares: cells² - 1 degrees of freedom."""
    counts, _, _ = np.histogram2d(*points.T, bins=cells, range=[[0, 1], [0, 1]])
    expected = len(points) / cells**2
    return np.sum((counts - expected) ** 2) / expected


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_numbers_are_inside_the_unit_interval(sampler):
    u = draw(sampler(spp=1), np.arange(10**6) % 1000, np.arange(10**6) // 1000, 3)
    assert u.min() > 0.0
    assert u.max() < 1.0


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_numbers_are_a_pure_function(sampler):
    """Any order gives the same; plain Python too."""
    rng = np.random.default_rng(61)
    pixels, samples = rng.integers(0, 2**40, 1000), rng.integers(0, 2**31, 1000)
    made = sampler(spp=1, seed=2**62 + 12345)
    u = draw(made, pixels, samples, 5)
    order = rng.permutation(1000)
    assert np.array_equal(draw(made, pixels[order], samples[order], 5), u[order])
    with np.errstate(over="ignore"):  # wrapping is what hashes are made of
        for i in range(50):
            twin = draw_pair(start_sample(made.setup(), int(pixels[i]), int(samples[i])), 5)
            assert twin == tuple(u[i])


@entry_kernel
def _draw_in_blocks(setup, pixels, samples, dimensions, pairs, made, out):
    for i in range(len(pixels)):
        sampler = start_in_block(setup, pixels[i], samples[i], pairs, made)
        out[i, 0], out[i, 1] = draw_pair(sampler, dimensions[i])


@pytest.mark.parametrize("sampler", [*SAMPLERS, rt.Grid])
def test_blocks_give_the_same_numbers(sampler):
    """Pixel after pixel and back, from any sample on, beyond the dimensions of blocks too."""
    rng = np.random.default_rng(62)
    n = 20000
    pixels = rng.choice(rng.integers(0, 2**36, 5), n)
    samples = rng.choice([0, 15, 16, 12345, 2**31 - 40], n) + rng.integers(0, 40, n)
    dimensions = rng.choice([0, 1, 3, blocks.DIMENSIONS - 1, blocks.DIMENSIONS, 1000], n)
    order = np.lexsort((dimensions, samples, pixels))
    order = np.concatenate([order, order[::-1], rng.permutation(n)])
    pixels, samples, dimensions = pixels[order], samples[order], dimensions[order]
    setup = sampler(spp=1).setup() if sampler is rt.Grid else sampler(spp=1, seed=77).setup()
    pairs, made = np.full(PAIR_FLOATS, np.nan), np.full(PAIR_INTEGERS, -1)
    found = np.empty((len(pixels), 2))
    _draw_in_blocks(setup, pixels, samples, dimensions, pairs, made, found)
    expected = np.empty_like(found)
    for dimension in np.unique(dimensions):
        which = dimensions == dimension
        each = np.empty((which.sum(), 2))
        _draw_all(setup, pixels[which], samples[which], dimension, each)
        expected[which] = each
    assert np.array_equal(found, expected)


@entry_kernel
def _draw_parts(setup, n, samples, pairs, made, alone, in_blocks):
    for i in range(len(samples)):
        one = start_sample(setup, 5, samples[i])
        same = start_in_block(setup, 5, samples[i], pairs, made)
        for k in range(n):
            j = i * n + k
            alone[j, 0], alone[j, 1] = draw_pair(split_sample(one, n, k), 7)
            in_blocks[j, 0], in_blocks[j, 1] = draw_pair(split_sample(same, n, k), 7)
        # The sample itself between its parts, whose block is another.
        draw_pair(same, 7)


@pytest.mark.parametrize("sampler", SAMPLERS)
@pytest.mark.parametrize("n", [1, 2, 3, 17])
def test_parts_of_samples_are_one_sequence(sampler, n):
    samples = np.random.default_rng(65).permutation(2000)
    pairs, made = np.full(PAIR_FLOATS, np.nan), np.full(PAIR_INTEGERS, -1)
    alone, in_blocks = np.empty((2, 2000 * n, 2))
    _draw_parts(sampler(spp=1, seed=9).setup(), n, samples, pairs, made, alone, in_blocks)
    assert np.array_equal(in_blocks, alone)
    assert len(np.unique(alone, axis=0)) == 2000 * n
    assert chi_square(alone) < CHI2_255
    if sampler is rt.Sobol or n == 1:
        numbers = (samples[:, None] * n + np.arange(n)).ravel()
        assert np.array_equal(alone, draw(sampler(spp=1, seed=9), 5, numbers, 7))


@entry_kernel
def _fill_both(order, x_seed, y_seed, place, first, fast, plain):
    blocks.fill(order, x_seed, y_seed, place, first, fast, 0)
    blocks.fill_plainly(order, x_seed, y_seed, place, first, plain, 0)


def test_vector_code_gives_the_bits_of_the_plain_kernel():
    rng = np.random.default_rng(63)
    fast, plain = np.empty((2, 2 * blocks.BLOCK_SAMPLES))
    for k in range(300):
        seeds = rng.integers(0, 2**32, 3, dtype=np.uint64)
        first, place = int(rng.integers(0, 2**27)) * blocks.BLOCK_SAMPLES, k % GROUP
        _fill_both(*seeds, place, first, fast, plain)
        assert np.array_equal(fast, plain)
    # And of Python's.
    with np.errstate(over="ignore"):
        blocks.fill_plainly(*seeds, place, first, plain, 0)
    assert np.array_equal(fast, plain)
    assert [tuple(p) for p in plain.reshape(2, -1).T] == [
        sobol.pair(tuple(seeds), place, sobol.reverse_bits(np.uint64(first + k)))
        for k in range(blocks.BLOCK_SAMPLES)
    ]


@pytest.mark.parametrize("dimension", [0, 1, 2, 3, 4, 7, 1000])
def test_sobol_samples_are_nets(dimension):
    """The first 2^k: one in each elementary interval of area 2^-k, whatever its shape."""
    for seed, pixel in ((0, 0), (0, 1), (7, 12345), (2**63 - 1, 2**40)):
        u = draw(rt.Sobol(spp=1, seed=seed), pixel, np.arange(1024), dimension)
        for k in range(11):
            for a in range(k + 1):
                x, y = (u[: 2**k] * [2**a, 2 ** (k - a)]).astype(int).T
                assert len(set(zip(x, y, strict=True))) == 2**k


def boxes(points, exponents):
    """In how many boxes there are points (n, d), of 4^exponents[k] to the unit along axis k."""
    return len(np.unique((points * 4 ** np.array(exponents)).astype(int), axis=0))


@pytest.mark.parametrize("first", [0, 2, 5, 7, 1000, 1002])
def test_two_pairs_of_a_group_are_nets_in_base_4(first):
    """Film with light pick and lobe, light point with direction: the first 4^m samples, one in each
    box of volume 4^-m with sides that are powers of 4."""
    for seed, pixel in ((0, 0), (7, 12345), (2**63 - 1, 2**40)):
        both = [draw(rt.Sobol(seed=seed), pixel, np.arange(256), first + k) for k in range(2)]
        u = np.concatenate(both, axis=1)
        for m in range(1, 5):
            for exponents in itertools.product(range(m + 1), repeat=4):
                if sum(exponents) == m:
                    assert boxes(u[: 4**m], exponents) == 4**m


def test_orders_rearrange_blocks():
    """Upper triangular with ones on the diagonal: the first 2^k points stay the first 2^k."""
    for row in COLUMNS:
        for j, column in enumerate(row.tolist()):
            assert column >> j == 1


def test_reordered_is_the_product_with_the_matrix():
    """Against the sum of the columns where bits are set, for single bits and random numbers."""
    rng = np.random.default_rng(64)
    numbers = [*(1 << np.arange(32)).tolist(), *rng.integers(0, 2**32, 100).tolist()]
    for place in range(GROUP):
        for number in numbers:
            columns = [int(COLUMNS[place, j]) for j in range(32) if number >> j & 1]
            total = functools.reduce(operator.xor, columns, 0)
            assert sobol.reordered(np.uint64(number), place) == total


@pytest.mark.parametrize("bits", [2, 4])
def test_orders_add_up(bits):
    """C_a after C_b is C_(a + b): a wrong product of the field would show."""
    for a in range(2**bits):
        for b in range(2**bits):
            total = after(pascal_columns(b, bits), pascal_columns(a, bits))
            assert total == pascal_columns(a ^ b, bits)


@pytest.mark.parametrize("bits", [2, 4])
def test_fields_are_fields(bits):
    """The multiples of any element but zero are all; products distribute over sums."""
    elements = range(2**bits)
    for a in elements[1:]:
        assert sorted(product(a, b, bits) for b in elements) == list(elements)
        for b, c in itertools.product(elements, repeat=2):
            total = product(a, b, bits) ^ product(a, c, bits)
            assert product(a, b ^ c, bits) == total


@pytest.mark.parametrize("sampler", SAMPLERS)
@pytest.mark.parametrize("sample", [0, 5])
def test_one_sample_of_many_pixels_is_uniform(sampler, sample):
    """Each sample by itself, of whatever number: what makes estimates unbiased."""
    u = draw(sampler(spp=1), np.arange(10**6), sample, 2)
    assert chi_square(u) < CHI2_255


def test_independent_samples_of_a_pixel_are_uniform():
    u = draw(rt.Independent(spp=1), 3, np.arange(10**6), 2)
    assert chi_square(u) < CHI2_255


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_no_two_are_correlated(sampler):
    """Other seeds, pixels, samples and dimensions, and the two of a pair, over many pixels."""
    n = 2**17
    pixels = np.arange(n)
    first = draw(sampler(spp=1), pixels, 0, 2)[:, 0]
    others = {
        "partner": draw(sampler(spp=1), pixels, 0, 2)[:, 1],
        "seed": draw(sampler(spp=1, seed=1), pixels, 0, 2)[:, 0],
        "dimension": draw(sampler(spp=1), pixels, 0, 3)[:, 0],
        "pixel": draw(sampler(spp=1), pixels + 1, 0, 2)[:, 0],
        "pixel below": draw(sampler(spp=1), pixels + 256, 0, 2)[:, 0],
    }
    if sampler is rt.Independent:  # Sobol's samples of a pixel keep apart on purpose
        others["sample"] = draw(sampler(spp=1), pixels, 1, 2)[:, 0]
    for name, other in others.items():
        # The correlation of n independent pairs has the standard deviation 1 / sqrt(n): five.
        assert abs(np.corrcoef(first, other)[0, 1]) < 5 / np.sqrt(n), name


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_no_pixel_repeats_another_seeds_pixel(sampler):
    """Pairs of 64 bits: among 2^15 a single repetition has a chance of 1 in 2^35."""
    pairs = np.concatenate([draw(sampler(spp=1, seed=s), np.arange(1024), 0, 2) for s in range(32)])
    assert len(np.unique(pairs, axis=0)) == len(pairs)


def test_sobol_dimensions_are_shuffled_against_each_other():
    """Within a pixel, sample k of one pair says nothing of sample k of another group's."""
    u = np.array(
        [
            [draw(rt.Sobol(spp=1), p, np.arange(256), k)[:, 0] - 0.5 for k in (2, 2 + GROUP)]
            for p in range(400)
        ]
    )
    each = 12 * np.mean(u[:, 0] * u[:, 1], axis=1)
    # Correlations of 256 shuffled pairs: standard deviation 1/16, their mean's 1/16/20: five.
    assert abs(each.mean()) < 5 / 16 / 20
    assert 0.04 < each.std() < 0.09


def test_other_seeds_give_other_numbers():
    a, b = (draw(rt.Sobol(spp=1, seed=s), 0, np.arange(256), 0) for s in (0, 1))
    assert (a != b).all()


def test_grid_is_the_centres_of_cells():
    grid = rt.Grid(spp=9)
    u = draw(grid, 4, np.arange(9), 0)
    sixth = [1 / 6, 0.5, 5 / 6]
    assert u.tolist() == [[x, y] for y in sixth for x in sixth]
    assert draw(grid, 4, np.arange(9), 1).tolist() == [[0.5, 0.5]] * 9


@pytest.mark.parametrize("spp", [2, 3, 8, 0, -4])
def test_a_grid_needs_a_square(spp):
    with pytest.raises(rt.SceneError, match=r"square number|greater than or equal"):
        rt.Grid(spp=spp)


@pytest.mark.slow
def test_sobol_nets_of_many_seeds():
    for seed in range(300):
        u = draw(rt.Sobol(spp=1, seed=seed), seed, np.arange(4096), seed % 50)
        for a in range(13):
            x, y = (u * [2**a, 2 ** (12 - a)]).astype(int).T
            assert len(set(zip(x, y, strict=True))) == 4096
