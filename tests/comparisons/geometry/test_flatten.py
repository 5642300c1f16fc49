"""What rays can hit, one by one: also the copies of an instance of many matrices."""

import numpy as np

import reference_rt as rt
from comparisons.geometry.flatten import copies_of
from reference_rt.core import transform


def test_copies_of_a_file_are_those_of_single_instances(tmp_path):
    """In their order, within groups too, with the same numbers."""
    rng = np.random.default_rng(8)
    maps = rng.normal(size=(5, 3, 4))
    np.save(tmp_path / "copies.npy", maps)
    outer = (transform.Translate(translate=(1.0, 2.0, 3.0)),)

    def scene(many):
        one = [
            rt.Instance(group="ball", transform=(transform.Matrix(matrix=m.tolist()), *outer))
            for m in maps
        ]
        every = [rt.Instance(group="ball", file="copies.npy", transform=outer)]
        shapes = every if many else one
        found = rt.Scene(
            groups={"ball": (rt.Sphere(),), "all": tuple(shapes)},
            shapes=(rt.Instance(group="all", transform=outer), rt.Box(), *shapes),
        )
        found._folder = tmp_path
        return found

    found, expected = copies_of(scene(True)), copies_of(scene(False))
    assert len(found) == len(expected) == 11
    for one, other in zip(found, expected, strict=True):
        assert one.group == other.group
        assert len(one.members) == len(other.members)
        np.testing.assert_allclose(one.outer, other.outer, rtol=1e-14, atol=1e-14)
    assert [(c.shape, c.instance) for c in found] == [
        *((0, k) for k in range(5)),
        (1, -1),
        *((2, k) for k in range(5)),
    ]
