"""The cost of features that a scene does not use, against kernels specialised by hand."""

import functools
import os
from collections.abc import Callable
from typing import Any

import numpy as np

from comparisons.experiments.bench import spheres_only
from comparisons.experiments.bench.row import Row, against
from comparisons.experiments.bench.setting import Setting
from comparisons.experiments.bench.timing import ROUNDS, alternate, ratios, seconds
from reference_rt.cameras import Perspective
from reference_rt.cameras.film import BoxFilter, Film
from reference_rt.integrators import Path
from reference_rt.jit.kernel import precompile, signature_of
from reference_rt.lights import Constant
from reference_rt.materials import AnyMaterial, Diffuse
from reference_rt.rendering.picture import Picture
from reference_rt.rendering.query.radiance import run_tiles
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Sobol
from reference_rt.shapes import Sphere

MANY_ROUNDS = 5 * ROUNDS
"""Single ratios vary by 1 to 5 %, and a difference of 2 % must be resolved."""

SIZE, SPP = 256, 128
"""Enough samples that a millisecond of Python before them does not matter."""

GOAL = 1.02

_GROUND = 100.0

# One of everything, inside the ground, where no ray comes: the picture is the same, and no kernel
# can be specialised away.  Planes, which are infinite, and lights would change the picture.
_EVERYTHING = """
textures:
  squares: {type: checker, first: 0.6, second: 0.5}
materials:
  conductor: {type: conductor, eta: [0.2, 0.9, 1.1], k: [3.9, 2.4, 2.2]}
  dielectric: {type: dielectric}
  diffuse: {type: diffuse, reflectance: squares}
  mirror: {type: mirror}
  plastic: {type: plastic}
  rough_conductor: {type: rough_conductor, eta: [0.2, 0.9, 1.1], k: [3.9, 2.4, 2.2]}
  rough_dielectric: {type: rough_dielectric}
  rough_plastic: {type: rough_plastic}
  principled: {type: principled}
  phong: {type: phong, diffuse: 0.2}
  thin_dielectric: {type: thin_dielectric}
  mask: {type: mask, base: diffuse, opacity: 0.5}
  two_sided: {type: two_sided, base: diffuse}
  blend: {type: blend, first: diffuse, second: plastic, weight: 0.5}
groups:
  one: [{type: sphere, material: mirror, center: [0, -150, 0]}]
shapes:
  - {type: disk, material: conductor, transform: [{translate: [0, -150, 0]}]}
  - {type: rectangle, material: dielectric, transform: [{translate: [0, -150, 0]}]}
  - {type: triangle, material: diffuse, v0: [0, -150, 0], v1: [1, -150, 0], v2: [0, -151, 0]}
  - type: polygon
    material: plastic
    rings: [[[0, 0], [1, 0], [0, 1]]]
    transform: [{translate: [0, -150, 0]}]
  - {type: box, material: rough_conductor, transform: [{translate: [0, -150, 0]}]}
  - {type: cylinder, material: rough_dielectric, transform: [{translate: [0, -150, 0]}]}
  - {type: torus, material: rough_plastic, transform: [{translate: [0, -150, 0]}]}
  - {type: cone, material: principled, transform: [{translate: [0, -150, 0]}]}
  - type: difference
    material: blend
    of: [{type: box}, {type: sphere, radius: 1.3}]
    transform: [{translate: [0, -150, 0]}]
  - {type: instance, group: one}
"""


def spheres() -> Scene:
    """Seven spheres in diffuse colours, the largest being the ground, under a white sky."""
    rng = np.random.default_rng(7)
    radii = [0.7, 0.5, 0.6, 0.4, 0.45, 0.35]
    angles = np.linspace(0.0, 2.0 * np.pi, len(radii), endpoint=False)
    colours = rng.uniform(0.3, 0.8, (len(radii), 3))
    materials: dict[str, AnyMaterial] = {"ground": Diffuse(reflectance=(0.5, 0.5, 0.5))}
    shapes = [Sphere(center=(0.0, -_GROUND, 0.0), radius=_GROUND, material="ground")]
    for k, (r, angle) in enumerate(zip(radii, angles, strict=True)):
        materials[f"clay{k}"] = Diffuse(reflectance=tuple(colours[k].tolist()))
        center = (1.3 * float(np.cos(angle)), r, 1.3 * float(np.sin(angle)))
        shapes.append(Sphere(center=center, radius=r, material=f"clay{k}"))
    return Scene(
        camera=Perspective(eye=(0.0, 2.0, 5.0), target=(0.0, 0.4, 0.0), fov=40.0),
        film=Film(width=SIZE, height=SIZE, filter=BoxFilter()),
        sampler=Sobol(spp=SPP),
        integrator=Path(max_depth=8),
        materials=materials,
        shapes=tuple(shapes),
        lights=(Constant(radiance=(1.0, 1.0, 1.0)),),
    )


def with_everything(scene: Scene) -> Scene:
    """The scene with one hidden object of every type."""
    more = Scene.parse(_EVERYTHING)
    return scene.changed(
        textures=scene.textures | more.textures,
        materials=scene.materials | more.materials,
        groups=scene.groups | more.groups,
        shapes=(*scene.shapes, *more.shapes),
    )


def render_pruned(scene: Scene, threads: int | None = None) -> Picture:
    """The picture by the kernels of `spheres_only`, on the renderer's own bands."""
    film, integrator, sampler = scene.film, scene.integrator, scene.resolved_sampler
    assert isinstance(integrator, Path)
    out = np.zeros((film.height, film.width, 3))
    setup = integrator.setup()
    arguments: tuple[Any, ...] = (
        setup.max_depth,
        setup.rr_depth,
        spheres_only.world_of(scene),
        scene.camera.setup(film.width, film.height),
        sampler.setup(),
        (film.width, film.height),
        sampler.spp,
        out.reshape(-1, 3),
    )
    pixels, threads = out[..., 0].size, threads or os.cpu_count() or 1
    band = precompile(spheres_only.render_tile, signature_of(*arguments, 0, 0, 0, 0))
    run_tiles(functools.partial(band, *arguments), pixels, sampler.spp, threads)
    return Picture({"colour": out})


def measure(setting: Setting) -> list[Row]:
    """The renderer against kernels specialised by hand; the details have the time of the renderer
    without specialisation too."""
    scene = spheres()
    everything = with_everything(scene)
    runs: dict[str, Callable[[], float]] = {
        "ours": lambda: seconds(
            lambda: render(scene, tables=scene.tables, threads=setting.threads, specialised=True)
        ),
        "by hand": lambda: seconds(lambda: render_pruned(scene, setting.threads)),
    }
    with_all: dict[str, Callable[[], float]] = {
        "nothing pruned": lambda: seconds(
            lambda: render(
                everything, tables=everything.tables, threads=setting.threads, specialised=True
            )
        ),
        "by hand": runs["by hand"],
    }
    for name, run in (runs | with_all).items():
        setting.say(f"compiling, {name}", 0.0)
        run()
    times = alternate(runs, MANY_ROUNDS, setting.say)
    all_times = alternate(with_all, say=setting.say)
    left_in = ratios(all_times["nothing pruned"], all_times["by hand"])
    same = np.array_equal(render(scene).colour, render_pruned(scene).colour)
    return [
        against(
            "unused",
            "spheres only: time / the same kernels specialised by hand "
            f"(without specialisation {left_in.median:.2f})",
            times["ours"],
            ("kernels specialised by hand", times["by hand"]),
            GOAL,
            details={
                "seconds": times,
                "seconds_with_everything_left_in": all_times,
                "everything_left_in": left_in.median,
                "same_picture_bit_for_bit": same,
            },
        )
    ]
