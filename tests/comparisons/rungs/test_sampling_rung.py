"""The rung of light samples: scenes of every light agree, and wrong tables of lights are found."""

import dataclasses

import numpy as np
import pytest
from builders import SCENES

import reference_rt as rt
from comparisons.rungs import sampling


def _scaled(tables, field, factor):
    """The tables with a probability by power that is not the one that lights are picked with."""
    choice = tables.lights.choice
    values = getattr(choice, field).copy()
    values[0] *= factor
    lights = tables.lights._replace(choice=choice._replace(**{field: values}))
    return dataclasses.replace(tables, lights=lights)


def _other_leaf(tables):
    """The tables of a light tree in which two lights have each other's way from the root."""
    tree = tables.lights.tree
    trail = tree.trail.copy()
    trail[[0, -1]] = trail[[-1, 0]]
    tree = tree._replace(trail=trail)
    return dataclasses.replace(tables, lights=tables.lights._replace(tree=tree))


def _turned_sky(tables):
    """The tables of a sky whose texels, and so densities, are 11 degrees beside the sums that
    samples are drawn from."""
    sky = tables.lights.environment
    sky = sky._replace(texels=np.roll(sky.texels, 8, axis=1))
    return dataclasses.replace(tables, lights=tables.lights._replace(environment=sky))


FAULTS = {
    "probability by power": ("light_shapes", lambda t: _scaled(t, "probability", 1.01)),
    "share of the tree": ("regressions/many_lamps", _other_leaf),
    "density of a sky": ("environment", _turned_sky),
}


@pytest.mark.parametrize("name", FAULTS)
def test_faults_are_found(name):
    source, change = FAULTS[name]
    scene = rt.Scene.load(SCENES / f"{source}.yaml")
    assert sampling(scene, scene.tables).status == "agree"
    found = sampling(scene, change(scene.tables))
    assert found.status == "differ"
    assert "light" in found.reason


BALL = rt.Sphere(center=(0, 0, -3))


def test_without_lights():
    scene = rt.Scene(shapes=(BALL,))
    found = sampling(scene, scene.tables)
    assert found.status == "agree"
    assert "no light is sampled" in found.reason
    assert "1 materials" in found.reason


@pytest.mark.parametrize(
    ("integrator", "reason"),
    [
        (rt.Whitted(), "whitted draws no samples"),
        (rt.RayCast(), "ray_cast draws no samples"),
        (rt.Direct(bsdf_samples=0), "direct samples no materials"),
    ],
    ids=lambda x: getattr(x, "type", ""),
)
def test_what_draws_nothing(integrator, reason):
    scene = rt.Scene(shapes=(BALL,), integrator=integrator)
    found = sampling(scene, scene.tables)
    assert found.status == "not-applicable"
    assert reason in found.reason
