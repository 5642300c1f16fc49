"""Quadrics of every kind."""

import numpy as np
import pytest

import reference_rt as rt

BOX = {"lower": (-1.0, -1.0, -1.0), "upper": (1.0, 1.0, 1.0)}


def quadric_of(*coefficients, capped=False, **box):
    return rt.Quadric(coefficients=coefficients, capped=capped, **(box or BOX))


def open_and_capped(*coefficients, **box):
    return [quadric_of(*coefficients, capped=capped, **box) for capped in (False, True)]


ELLIPSOIDS = [rt.Sphere(), rt.Sphere(center=(0.3, -0.2, 0.7), radius=1.7)]
KINDS = {
    "ellipsoid": ELLIPSOIDS,
    "ellipsoid by coefficients": open_and_capped(2, 3, 4, 0.5, -0.3, 0.2, 0.1, 0.2, -0.3, -1),
    "elliptic cylinder": open_and_capped(1, 2, 0, 0, 0, 0, 0, 0, 0, -0.5),
    "double cone": [
        *open_and_capped(1, 1, -1, 0, 0, 0, 0, 0, 0, 0),
        quadric_of(-1, -1, 1, 0, 0, 0, 0, 0, 0, 0, capped=True),
    ],
    "paraboloid": open_and_capped(1, 1.3, 0, 0, 0, 0, 0.1, 0, -1, -0.3),
    "saddle": open_and_capped(1, -1, 0, 0, 0, 0, 0, 0, -1, 0),
    "hyperboloid of one sheet": open_and_capped(1, 1, -1, 0, 0, 0, 0, 0, 0, -0.2),
    "hyperboloid of two sheets": open_and_capped(1, 1, -1, 0, 0, 0, 0, 0, 0, 0.2),
    "turned, off the middle": open_and_capped(
        *(1, 0.5, 0.7, -0.3, 0.2, 0.9, 0.3, -0.4, 0.2, -0.3),
        lower=(-1.3, -0.8, -0.2),
        upper=(0.8, 2.1, 1.0),
    ),
    "plane": open_and_capped(0, 0, 0, 0, 0, 0, 1, 2, 3, 0.25),
    "pair of planes": [
        *open_and_capped(1, -1, 0, 0, 0, 0, 0, 0, 0, 0),
        *open_and_capped(1, 0, 0, 0, 0, 0, 0, 0, 0, -0.25),
    ],
    "box": [quadric_of(0, 0, 0, 0, 0, 0, 0, 0, 0, -1, capped=True)],
}
BY_NAME = pytest.mark.parametrize("name", KINDS)


def seeded(name, *more):
    return np.random.default_rng([list(KINDS).index(name), *more])
