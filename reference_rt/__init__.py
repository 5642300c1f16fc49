"""reference_rt: an independent float64 reference ray tracer.

    from reference_rt import Scene, render

    scene = Scene.load("scenes/cornell_box.yaml")
    picture = render(scene, spp=64)  # a Picture: save(path), show(), layers
    hits = scene.intersect(origins, directions)  # for arrays of rays

`help(reference_rt.Sphere)` and its like describe a type; `Sphere.model_fields["radius"]` a field.

- A scene: Scene, Film, json_schema; SceneError, SceneWarning
- Its parts: a class for each type of shape (Sphere, Mesh, ...), solid (Union, ...), material
  (Diffuse, ...), medium, texture, light, camera, integrator, sampler and filter
- Pictures: render, Picture, read_image, ImageError; by a parameter: derivative, Derivative
- Queries: query (array queries, the methods of Scene), transform (affine maps), textbook (the
  textbook's intersection methods), build_tables, SceneTables
- Other errors: ReferenceRtError, ReferenceUnavailableError, UsageError

Other modules are internal.  A name is imported when it is first used: importing the package takes
milliseconds, and the renderer, with Numba, a second.  Folders from the lowest to the highest, each
of which may import those before it: util, jit, core, sampling, textures, shapes, cameras, accel,
materials, lights, media, integrators, scene, gltf, rendering, textbook, cli.
"""

import textwrap as _textwrap

import lazy_loader as _lazy_loader

__getattr__, __dir__, _names = _lazy_loader.attach_stub(__name__, __file__)

_all = "All names: " + ", ".join(_names)
__doc__ = f"{__doc__}\n{_textwrap.fill(_all, 98, subsequent_indent='  ')}\n"  # for `help`


class _All(list[str]):
    """The names that `import *` gives.  `help` asks which names are in it, and would print all
    types with all their methods: 30,000 lines."""

    def __contains__(self, name: object) -> bool:
        return False


__all__ = _All(_names)
