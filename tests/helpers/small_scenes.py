"""Scenes of `scenes/` in few pixels and samples, and comparison of their pictures."""

from builders import SCENES

import reference_rt as rt

LAYERS = ("albedo", "normal", "position", "depth", "id", "variance")


def small(name):
    """A scene of `scenes/` in few pixels and samples, with all layers."""
    scene = rt.Scene.load(SCENES / f"{name}.yaml")
    casts = isinstance(scene.integrator, rt.RayCast)
    film = {"width": 24, "height": 16, "layers": () if casts else LAYERS}
    sampler = scene.resolved_sampler
    if not isinstance(sampler, rt.Grid):
        sampler = sampler.model_copy(update={"spp": 4})
    return scene.changed(film=scene.film.model_copy(update=film), sampler=sampler)


def same(a, b):
    """Whether two pictures have the same layers with the same bits."""
    return a.layers.keys() == b.layers.keys() and all(
        a.layers[name].tobytes() == b.layers[name].tobytes() for name in a.layers
    )
