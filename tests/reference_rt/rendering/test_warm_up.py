"""The set of all linked kernels: every picture's linked kernels are in it."""

import itertools
import os
import subprocess
import sys
import typing
from pathlib import Path

import numba
import numpy as np
import pytest
from builders import SCENES
from galleries import GALLERIES

import reference_rt as rt
from reference_rt.accel.geometry import Geometry, geometries
from reference_rt.cameras import views
from reference_rt.cameras.film import film_filters
from reference_rt.integrators import SETUPS
from reference_rt.jit.links import LINK
from reference_rt.lights.dispatch import by_code as lights
from reference_rt.lights.selection.choice import light_trees
from reference_rt.materials.bsdfs.tables import by_code as bsdfs
from reference_rt.materials.nested.flattened import FlattenedMaterials, flattened_materials
from reference_rt.rendering import kernels
from reference_rt.rendering.accumulation import radiance_job
from reference_rt.rendering.kernels import calls_for, operation_of
from reference_rt.rendering.query import tracing
from reference_rt.rendering.query.crossings import solid_crossings
from reference_rt.rendering.query.light import direct_light
from reference_rt.rendering.query.rays import camera_kernel
from reference_rt.rendering.tiles import GivenRays
from reference_rt.rendering.warm_up import (
    all_calls,
    cost,
    picture_calls,
    query_calls,
)
from reference_rt.shapes.meshes.triangle_table import Triangles
from reference_rt.shapes.tables import by_code as shapes
from reference_rt.textures import Textures
from reference_rt.textures.lookup import lookups

pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")

INTEGRATORS_OF = (rt.Path(), rt.Direct(light_samples=2), rt.Whitted(), rt.RayCast())
FILES = sorted(SCENES.glob("*.yaml"))


@pytest.fixture(scope="module")
def known():
    return all_calls()


def described(calls):
    """Of kernels, for messages: the source that is compiled, and for which types."""
    return {(kernel.py_func.__code__.co_filename, kernel.__name__, str(s)) for kernel, s in calls}


def names_in_the_cache(calls):
    """The names of the files that hold compiled kernels."""
    codegen = numba.core.registry.cpu_target.target_context.codegen()
    caches = ((kernel._cache, signature) for kernel, signature in calls)
    return sorted(cache._path(cache._key(signature, codegen)).name for cache, signature in caches)


NAMES = """
from reference_rt.rendering.warm_up import all_calls
from test_warm_up import names_in_the_cache
print(*names_in_the_cache(all_calls()))
"""


def test_every_kernel_is_found_by_the_next_process(known):
    """A name that held an address, or a function's pickled code, would be new each time."""
    here = str(Path(__file__).parent)
    found = subprocess.run(
        [sys.executable, "-c", NAMES],
        env=os.environ | {"PYTHONPATH": os.pathsep.join([here, *sys.path])},
        capture_output=True,
        text=True,
        check=True,
    )
    assert found.stdout.split() == names_in_the_cache(known)


@pytest.mark.cases(4)
@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_every_scene(file, known):
    """Its queries, and its pictures by its own integrator and by all others that may render it."""
    scene = rt.Scene.load(file)
    assert described(set(query_calls(scene)) - set(known)) == set()
    assert described(set(picture_calls(scene)) - set(known)) == set()
    assert len(picture_calls(scene)) > 3
    film = rt.Film(layers=("albedo", "normal", "depth", "id", "variance"))
    for integrator in INTEGRATORS_OF:
        try:
            other = scene.changed(integrator=integrator, sampler=None, film=film)
            calls = picture_calls(other)
        except rt.SceneError:  # a Phong material that path tracing refuses; media of paths alone
            assert "phong" in file.read_text() or scene.has_media
            continue
        assert described(set(calls) - set(known)) == set()


def test_what_the_tests_have_for_every_type(known, tmp_path):
    for gallery in GALLERIES:
        scene = gallery(tmp_path)
        assert described(set(picture_calls(scene)) - set(known)) == set()


def test_radiance_along_given_rays(known):
    """By the same drivers: the rays are in the place of the camera's."""
    rays = GivenRays(np.zeros((4, 3)), np.ones((4, 3)))
    for integrator in INTEGRATORS_OF[:3]:
        tables = rt.Scene(shapes=(rt.Sphere(),), integrator=integrator).tables
        job = radiance_job(integrator.setup(), rt.Independent(spp=2), (4, 1), has_variance=True)
        calls = calls_for([job], tables, rays, rt.BoxFilter().setup())
        assert described(set(calls) - set(known)) == set()


def test_every_type_of_every_operation(known):
    """A type that is added to a group must be added to a scene of the warm-up, too; but for what
    only the layers of costs need, which few ask for."""
    compiled = {kernel for kernel, _ in known}
    for group in (
        *(shapes.operations, bsdfs.operations, lights.operations, geometries.operations),
        *(flattened_materials.operations, light_trees.operations, lookups.operations),
        *(views.operations, film_filters.operations),
    ):
        for name, operation in group.items():
            needed = {operation.call_for(code, numba.types.int64)[0] for code in operation.rows}
            assert needed <= compiled or name == "traversal_cost", name


SOLID = """
shapes:
- type: difference
  of: [{type: sphere, radius: 0.5}, {type: box, transform: [{scale: 0.3}]}]
- {type: rectangle}
lights: [{type: constant, radiance: 1}]
"""


def test_operations_on_solids_are_compiled_where_there_are_some():
    """They do not compile for a geometry without, and `warm-up` would fail."""
    for text, solids in ((SOLID, True), ("shapes: [{type: rectangle}]", False)):
        names = {kernel.__name__ for kernel, _ in query_calls(rt.Scene.parse(text))}
        assert any(name.startswith("crossings_of_solid") for name in names) == solids


@pytest.mark.slow
def test_queries_call_these_kernels():
    """That is with arguments of these types: nothing else is compiled."""
    scene = rt.Scene.parse(SOLID)
    calls = query_calls(scene)
    o, d = np.zeros((2, 3)), np.ones((2, 3))
    many = np.zeros((tracing.FEW + 1, 3))
    scene.intersect(o, d, t_min=0.5, t_max=np.ones(2)), scene.first_hits(o, d)
    scene.occluded(o, d), scene.occluded(many, d[0], t_max=2.0)
    scene.crossings(o, d, t_max=2.0), scene.first_hits(many, d[0])
    scene.camera_rays([[0, 0]]), scene.radiance(o, d, integrator=rt.RayCast())
    scene.sample_lights(o, d * 0.5), scene.light_pdf(o, d), scene.bsdf(None).sample(d, d * 0.5)
    direct_light(scene.tables, o, d, 0), solid_crossings(scene.tables, 0, o, d)
    for kernel, signature in calls:
        if isinstance(signature, tuple):  # an entry kernel, not an operation
            others = [key for key in kernel.overloads if LINK in leaves(key)]
            assert set(others) <= {signature}, kernel.__name__
            assert others or kernel is camera_kernel, kernel.__name__


def leaves(numba_types):
    """The types of tuples' items, and of their items."""
    for one in numba_types:
        yield one
        if isinstance(one, numba.types.BaseTuple):
            yield from leaves(one.types)


def optional(table):
    """The fields of a table that a scene may lack."""
    hints = typing.get_type_hints(table)
    return [name for name in table._fields if type(None) in typing.get_args(hints[name])]


def present(table, calls):
    """The sets of optional fields that the tables of a class have, in the kernels' types."""
    types_of = {
        signature.args[0].dtype
        for _, signature in calls
        if not isinstance(signature, tuple)
        and getattr(signature.args[0].dtype, "instance_class", None) is table
    }
    names = optional(table)
    assert names
    return {
        tuple(
            name
            for name in names
            if not isinstance(of.types[of.fields.index(name)], numba.types.NoneType)
        )
        for of in types_of
    }


def subsets(names):
    return {c for n in range(len(names) + 1) for c in itertools.combinations(names, n)}


def test_every_combination_of_optional_columns(known):
    for table in (Triangles, FlattenedMaterials, Textures):
        # A scene without textures has no such table, and products are of other textures.
        nothing = {(), ("products",)} if table is Textures else set()
        names = [name for name in optional(table) if name != "more_uvs"]  # the textures have them
        assert present(table, known) == subsets(names) - nothing


def test_every_combination_of_geometry(known):
    """Solids, instances and parts are in hierarchies only, and what has parts is one of them."""
    names = ("bvh", "solids", "instances", "parts")
    expected = {()} | {
        tuple(name for name in names if name in ("bvh", *chosen, *(("parts",) if chosen else ())))
        for chosen in subsets(("solids", "instances"))
    }
    assert present(Geometry, known) == expected
    corners = {
        signature.args[0].dtype.types[Geometry._fields.index("bvh")]
        for kernel, signature in known
        if operation_of(kernel) == "any_hits"
    }
    assert len(corners) == 2  # no hierarchy, and one: without triangles `corners` is empty


def test_every_integrator_with_every_sampler(known):
    drivers = {
        tuple(of.instance_class.__name__ for of in arguments if hasattr(of, "instance_class"))
        for kernel, arguments in known
        if kernel.__name__ == "render_tile"
    }
    expected = {
        (setup.__name__, "KernelScene", "View", "Link", sampler)
        for setup in SETUPS
        for sampler in ("SobolSetup", "IndependentSetup", "GridSetup")
        if setup.__name__ in ("WhittedSetup", "DirectSetup") or sampler != "GridSetup"
    }
    assert drivers == expected


def test_the_longest_come_first_and_each_once(known):
    costs = [cost(call) for call in known]
    assert costs == sorted(costs, reverse=True)
    assert len(set(known)) == len(known)
    assert known[0][0].__name__ == "render_tile"


def test_a_render_reports_the_kernels_that_it_compiles(monkeypatch):
    """By their numbers, in place of the fraction."""
    compile_all = kernels.precompile_all

    def slowly(calls, threads, say, ahead):
        say(0, 2)
        say(2, 2)
        return compile_all(calls, threads)

    monkeypatch.setattr(kernels, "precompile_all", slowly)
    scene = rt.Scene(
        shapes=(rt.Sphere(),), integrator=rt.RayCast(), film=rt.Film(width=4, height=4)
    )
    counted, said = [], []
    rt.render(scene, compiling=lambda *n: counted.append(n), progress=lambda *n: said.append(n))
    assert counted == [(0, 2), (2, 2)]
    assert said[0] == ("compile", 1.0)
    said.clear()
    rt.render(scene, progress=lambda *n: said.append(n))
    assert said[0] == ("compile", 1.0)
