"""Units: every sample of every pixel once, in order, whatever was done before."""

from itertools import pairwise, product

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from reference_rt.rendering.units import BAND, chunk_of, passes, plan


def carried_out(done, units, chunk):
    """The samples of each chunk after these units; each must begin where the last one ended."""
    done = done.copy()
    for unit in units:
        chunks = slice(unit.begin // chunk, -(-unit.end // chunk))
        assert unit.begin % chunk == 0
        assert (done[chunks] == unit.first).all()
        assert unit.last > unit.first
        assert unit.end > unit.begin
        done[chunks] = unit.last
    return done


@given(
    pixels=st.integers(1, 3 * BAND),
    spp=st.integers(1, 200),
    size=st.integers(1, 1 << 22),
    seed=st.integers(0, 99),
    least=st.integers(0, 100),
)
def test_every_sample_once(pixels, spp, size, seed, least):
    chunk = chunk_of(pixels)
    rng = np.random.default_rng(seed)
    done = rng.choice([0, 0, 0, 16, 37, spp], -(-pixels // chunk)).clip(0, spp)
    units = list(plan(done, pixels, spp, size, least))
    assert (carried_out(done, units, chunk) == spp).all()
    for unit in units:
        assert unit.end <= pixels
        assert unit.end % chunk == 0 or unit.end == pixels
        assert unit.begin // BAND == (unit.end - 1) // BAND
        # No larger than asked for, unless chunks and passes are.
        assert unit.samples <= max(size, chunk * (unit.last - unit.first))


def test_chunks_divide_bands_and_are_many():
    for pixels in (1, 63, 64, 65, 4096, 65536, 65537, 1 << 20, 1 << 26, 1 << 30):
        chunk = chunk_of(pixels)
        assert BAND % chunk == 0
        assert chunk == 64 or pixels // chunk >= 512


def test_passes():
    """They end at multiples of 16, so that limits do not divide what the sampler computes at once;
    none takes long."""
    for spp, chunk in product((1, 15, 16, 17, 64, 1000, 1 << 17), (64, 2048)):
        ends = list(passes(spp, chunk))
        assert ends[-1] == spp
        assert all(end % 16 == 0 for end in ends[:-1])
        steps = [b - a for a, b in pairwise([0, *ends])]
        assert min(steps) > 0
        assert max(steps) * chunk <= max(16 * chunk, 1 << 21)
        # A quarter more, so that pixels of two passes have nearly the same noise.
        assert all(b - a <= max(16, a // 4) for a, b in pairwise(ends))


def test_passes_do_not_depend_on_the_end():
    """So that a picture may get more samples later, and limits stop at the same ones."""
    longer = list(passes(1 << 14, 64))
    shorter = list(passes(5000, 64))
    assert shorter[:-1] == longer[: len(shorter) - 1]
