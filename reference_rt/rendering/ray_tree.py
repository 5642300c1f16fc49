"""The rays of one sample of a pixel: what `reference-rt trace` shows.

A second process runs the kernel of a tile as plain Python (NUMBA_DISABLE_JIT=1), which gives the
same bits as compiled kernels, and reads the local variables of kernels when they return, as a
debugger does.  So no kernel is written twice, and none is slower for it.

Each ray is a dictionary:

- kind: camera, mirrored, refracted, scattered or shadow;  parent: the number of the ray at whose
  end it begins, None for the camera's;  depth: edges before it;
- o, d, t_max;  t, end: where it ends, None where it hits nothing;
- weight: the share of its radiance in the sample: of a path the throughput;
- hit: shape, copy, part, face, material, p, n of the surface, None for a miss;  of a shadow ray
  instead occluded;
- adds: (what, value) of each term that it adds to the sample's radiance;
- numbers: by name, the pdfs, MIS weights and probabilities behind these terms;
- steps: the nodes of the BVH that a ray meets when it is traced alone, each with its box in world
  space, None within instances;  tests: how many primitives are tested.

The sum of all `adds`, ray after ray from 0, is the sample's radiance, to the last bit.
"""

import inspect
import math
import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Sequence
from types import CodeType, FrameType
from typing import Any

import numpy as np

from reference_rt import lights as any_light
from reference_rt import materials as any_material
from reference_rt.accel import geometry as geometries
from reference_rt.accel.block_query import any_hits
from reference_rt.accel.bvh import CENTER, CHILDREN, child_of, size_of
from reference_rt.accel.leaf import nearer_primitive, nearest_of_triangle_leaf
from reference_rt.accel.single_ray import enter
from reference_rt.core.ray import Hit, Ray, at
from reference_rt.core.vec3 import Vec3, is_black
from reference_rt.integrators import (
    RayCast,
    direct,
    direct_light,
    path,
    ray_cast,
    shading,
    whitted,
)
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.jit.simd import VECTOR_WIDTH
from reference_rt.rendering import tiles
from reference_rt.rendering.accumulation import jobs_of
from reference_rt.rendering.executor import build_and_check
from reference_rt.scene.build import BuiltScene

RayRecord = dict[str, Any]

CAMERA, MIRRORED, REFRACTED, SCATTERED, SHADOW = KINDS = (
    *("camera", "mirrored", "refracted", "scattered", "shadow"),
)


def ray_tree(scene: BuiltScene, x: int, y: int, sample: int = 0) -> dict[str, Any]:
    """What one sample of the pixel in column x and row y is made of: its `rays`, its radiance, the
    filter_weight, and value, the product of both.  Raises SceneError."""
    return ray_trees(scene, [(x, y, sample)])[0]


def ray_trees(scene: BuiltScene, places: Sequence[tuple[int, int, int]]) -> list[dict[str, Any]]:
    """`ray_tree` of several (x, y, sample)."""
    film = scene.film
    tables = build_and_check(scene, None)
    given = tables, scene.camera.setup(film.width, film.height), film.filter.setup()
    asked = [((film.width * y + x), sample) for x, y, sample in places]
    is_cast = isinstance(scene.integrator, RayCast)
    done = subprocess.run(
        [sys.executable, "-c", f"from {__name__} import _answer; _answer()"],
        input=pickle.dumps((is_cast, jobs_of(scene)[0].arguments(*given), asked)),
        env=os.environ | {"NUMBA_DISABLE_JIT": "1"},
        stdout=subprocess.PIPE,
        check=True,
    )
    found: list[dict[str, Any]] = pickle.loads(done.stdout)
    return found


def _answer() -> None:
    """The second process: from the arguments of a kernel on standard input to trees."""
    is_cast, arguments, asked = pickle.load(sys.stdin.buffer)
    with np.errstate(all="ignore"):
        trees = [_tree(is_cast, arguments, *one) for one in asked]
    sys.stdout.buffer.write(pickle.dumps(trees))


def _tree(is_cast: bool, arguments: Any, pixel: int, sample: int) -> dict[str, Any]:
    kernel: Any = tiles.aov_tile if is_cast else tiles.render_tile
    out: Any = [np.zeros((1, 10))] if is_cast else [np.zeros((1, 3)), None]
    recorder, scene = _Recorder(), arguments[0 if is_cast else 1]
    recorder.watch(lambda: kernel(*arguments, *out, pixel, pixel + 1, sample, sample + 1))
    radiance = Vec3(0.0, 0.0, 0.0)
    for ray in recorder.rays:
        for _, value in ray["adds"]:
            radiance = radiance + Vec3(*value)
    tree: dict[str, Any] = _plain(
        {
            "rays": [_described(ray, scene) for ray in recorder.rays],
            "radiance": radiance,
            "filter_weight": recorder.filter_weight,
            "value": out[0][0, :3],
        }
    )
    return tree


def _plain(value: Any) -> Any:
    """The same of Python's own types."""
    if isinstance(value, dict):
        return {key: _plain(one) for key, one in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return [*map(_plain, value)] if isinstance(value, tuple | list) else value


def _code(function: Any) -> CodeType:
    code: CodeType = inspect.unwrap(function).__code__
    return code


class _Frames:
    """Calls handlers when certain functions return: with the function's local variables, the code
    and the local variables of its caller, and the result."""

    handlers: dict[CodeType, Callable[[Any, CodeType, Any, Any], None]]

    def watch(self, run: Callable[[], object]) -> None:
        def on_event(frame: FrameType, event: str, result: Any) -> None:
            if event == "return" and frame.f_code in self.handlers:
                caller = frame.f_back
                while caller is not None and caller.f_code.co_name == "choose":
                    caller = caller.f_back  # of `ByClass` and `Linkable`
                assert caller is not None
                self.handlers[frame.f_code](frame.f_locals, caller.f_code, caller.f_locals, result)

        sys.setprofile(on_event)
        try:
            run()
        finally:
            sys.setprofile(None)


_WHITTED, _DIRECT, _PATH = map(_code, (whitted.radiance, direct.radiance, path.radiances))


class _Recorder(_Frames):
    """rays: see above, each with its `Ray` as "ray" and its `Hit` as "found"."""

    def __init__(self) -> None:
        self.rays: list[RayRecord] = []
        self.filter_weight = 1.0
        self._waiting: dict[int, tuple[int | None, str]] = {}
        self._surface: int | None = None
        self._point: Any = None
        self._shadow: tuple[Ray, bool] | None = None
        self._numbers: dict[str, float] = {}
        self._sampled: dict[str, float] = {}
        self.handlers = {
            _code(tiles._camera_film_ray): self._film_ray,
            _code(geometries.closest_hit): self._closest_hit,
            _code(geometries.occluded): self._occluded,
            _code(any_light.background): self._emission,
            _code(any_light.emitted): self._emission,
            _code(any_material.ambient): self._ambient_share,
            _code(any_light.ambient): self._ambient,
            _code(direct_light.direct_from): self._direct_from,
            _code(whitted._push): self._push,
            _code(whitted._direct_light): self._direct_light,
            _code(shading.shade): self._shade,
            _code(direct._light_sample): self._light_sample,
            _code(direct._bsdf_sample): self._bsdf_sample,
            _code(path._environment_emission): self._path_emission,
            _code(path._hit_emission): self._path_emission,
            _code(path._next_event_estimation): self._next_event,
            _code(path._scatter): self._scatter,
            _code(path._edge): self._edge,
            _code(any_hits): self._any_hits,
            _code(ray_cast.cast): self._cast,
        }

    def _ray(self, kind: str, parent: int | None, ray: Ray, **more: Any) -> RayRecord:
        record = {"kind": kind, "parent": parent, "ray": ray, "adds": [], "numbers": {}, **more}
        record["depth"] = 0 if parent is None else self.rays[parent]["depth"] + 1
        self.rays.append(record)
        if kind != SHADOW:
            self._surface = len(self.rays) - 1
        return record

    def _add(self, record: RayRecord, what: str, value: Vec3) -> None:
        if not is_black(value):
            record["adds"].append((what, value))

    def _film_ray(self, own: Any, caller: CodeType, outer: Any, result: Any) -> None:
        self.filter_weight = result.weight

    def _shade(self, own: Any, caller: CodeType, outer: Any, result: Any) -> None:
        self._point = result.point
        if caller in (_WHITTED, _DIRECT):
            self.rays[-1]["point"] = result.point

    # ---- Whitted and direct illumination --------------------------------------------------------

    def _push(self, own: Any, caller: CodeType, outer: Any, result: Any) -> None:
        kind = REFRACTED if own["weight"] is outer.get("refracted") else MIRRORED
        first = own["depth"] == 0
        self._waiting[own["top"]] = (None, CAMERA) if first else (self._surface, kind)

    def _closest_hit(self, own: Any, caller: CodeType, outer: Any, hit: Hit) -> None:
        if caller is _WHITTED:
            parent, kind = self._waiting[outer["top"]]
            self._ray(kind, parent, own["ray"], weight=outer["weight"], found=hit)
        elif caller is _DIRECT:
            self._ray(CAMERA, None, own["ray"], weight=Vec3(1.0, 1.0, 1.0), found=hit)
        elif caller is _code(direct._bsdf_sample):
            weight = outer["scattered"].weight
            self._ray(SCATTERED, 0, own["ray"], weight=weight, found=hit)

    def _emission(self, own: Any, caller: CodeType, outer: Any, radiance: Vec3) -> None:
        what = "emitted" if "q" in own else "background"
        if caller is _WHITTED:
            self._add(self.rays[-1], what, outer["weight"] * radiance)
        elif caller is _DIRECT:
            self._add(self.rays[-1], what, radiance)

    def _ambient_share(self, own: Any, caller: CodeType, outer: Any, share: Vec3) -> None:
        self._share = share

    def _ambient(self, own: Any, caller: CodeType, outer: Any, light: Vec3) -> None:
        if caller is _WHITTED:
            self._add(self.rays[-1], "ambient", outer["weight"] * (self._share * light))

    def _occluded(self, own: Any, caller: CodeType, outer: Any, result: bool) -> None:
        self._shadow = own["ray"], result

    def _direct_from(self, own: Any, caller: CodeType, outer: Any, sample: Any) -> None:
        self._numbers = {"light": outer.get("k"), "light pdf": sample.light.pdf}
        if self._shadow is None:
            return
        weight = self.rays[self._surface or 0]["weight"]
        self._ray(SHADOW, self._surface, self._shadow[0], occluded=self._shadow[1], weight=weight)
        self.rays[-1]["numbers"] = self._numbers
        self._shadow = None

    def _direct_light(self, own: Any, caller: CodeType, outer: Any, result: Vec3) -> None:
        self._add(self.rays[self._surface or 0], "direct light", outer["weight"] * result)

    def _light_sample(self, own: Any, caller: CodeType, outer: Any, value: Vec3) -> None:
        shadow = self.rays[-1]
        if shadow["kind"] != SHADOW or "selection" in shadow["numbers"] or "sample" not in own:
            return
        shadow["numbers"] = _of_light(own["picked"], own["sample"].light, own["sample"].bsdf_pdf)
        shadow["numbers"]["MIS weight"] = own.get("weight", 1.0)
        self._add(shadow, "direct light", value)

    def _bsdf_sample(self, own: Any, caller: CodeType, outer: Any, value: Vec3) -> None:
        if "hit" not in own:
            return
        self._surface = 0
        record, scattered = self.rays[-1], own["scattered"]
        record["point"] = own.get("there")
        record["numbers"] = {
            "bsdf pdf": 0.0 if scattered.is_delta else scattered.pdf,
            "light pdf": own["light_pdf"],
            "MIS weight": own["weight"],
        }
        self._add(record, "emitted" if own["hit"].kind >= 0 else "background", value)

    # ---- path tracing ---------------------------------------------------------------------------

    def _path_emission(self, own: Any, caller: CodeType, outer: Any, result: Vec3) -> None:
        pdf = own["state"].bsdf_pdf
        self._numbers = {"MIS weight": own["weight"]}
        if pdf > 0.0:
            self._numbers |= {"bsdf pdf": pdf, "light pdf": own["light_pdf"]}

    def _next_event(self, own: Any, caller: CodeType, outer: Any, result: Any) -> None:
        self._sampled = {}
        if "sample" in own:
            self._sampled = _of_light(own["picked"], own["light"], own["sample"].bsdf_pdf)
            self._sampled["MIS weight"] = own.get("weight", 1.0)

    def _scatter(self, own: Any, caller: CodeType, outer: Any, step: Any) -> None:
        self._numbers |= {"sampled pdf": own["scattered"].pdf}
        if "survival" in own:
            self._numbers["survival"] = own["survival"]

    def _edge(self, own: Any, caller: CodeType, outer: Any, edge: Any) -> None:
        kind = CAMERA if own["depth"] == 0 else SCATTERED
        state, hit = own["state"], own["hit"]
        record = self._ray(kind, self._surface, own["ray"], weight=state.throughput, found=hit)
        record["point"] = self._point
        record["numbers"], self._numbers = self._numbers, {}
        self._add(record, "emitted" if hit.kind >= 0 else "background", edge.emitted)
        self._connection = edge.connection

    def _any_hits(self, own: Any, caller: CodeType, outer: Any, result: None) -> None:
        if own["n"] == 0:
            return
        occluded = bool(own["hits"].codes[0] >= 0)
        record = self._ray(SHADOW, self._surface, self._connection.shadow, occluded=occluded)
        record["weight"] = self.rays[record["parent"]]["weight"]
        record["numbers"] = self._sampled
        if not occluded:
            self._add(record, "direct light", self._connection.light)

    # ---- ray casting ----------------------------------------------------------------------------

    def _cast(self, own: Any, caller: CodeType, outer: Any, result: Any) -> None:
        record = self._ray(CAMERA, None, own["ray"], weight=Vec3(1.0, 1.0, 1.0), found=own["hit"])
        record["point"] = own.get("point")
        self._add(record, "colour", result.colour)


def _of_light(picked: Any, light: Any, bsdf_pdf: float) -> dict[str, float]:
    return {
        "light": picked.light,
        "selection": picked.probability,
        "light pdf": light.pdf,
        "bsdf pdf": 0.0 if light.is_delta else bsdf_pdf,
    }


# ---- what a ray meets ----------------------------------------------------------------------------


def _described(record: RayRecord, scene: SceneTables) -> RayRecord:
    """The ray as it is shown, of numbers, names and tuples."""
    ray, hit = record.pop("ray"), record.pop("found", None)
    point = record.pop("point", None)
    is_hit = hit is not None and hit.kind >= 0
    record |= {"o": ray.o, "d": ray.d, "t_max": ray.t_max, "hit": None, "t": None, "end": None}
    if is_hit:
        ids = geometries.owner(scene.geometry, hit)._asdict()
        record["hit"] = ids | {"material": point.material, "p": point.p, "n": point.n}
        record["t"], record["end"] = hit.t, point.p
    elif record["kind"] == SHADOW and ray.t_max < math.inf:
        record["end"] = at(ray, ray.t_max)
    walk = _Walk()
    if record["kind"] == SHADOW:
        walk.watch(lambda: geometries.occluded(scene.geometry, ray))
    else:
        walk.watch(lambda: geometries.closest_hit(scene.geometry, ray))
    if scene.geometry.bvh is None:
        walk.tests = sum(len(table.owner) for table in scene.geometry.shapes if table is not None)
    return record | {"steps": walk.steps, "tests": walk.tests}


class _Walk(_Frames):
    """steps: the nodes that a ray meets, as (node, box);  tests: primitives that are tested."""

    def __init__(self) -> None:
        self.steps: list[tuple[int, tuple[float, ...] | None]] = []
        self.tests = 0
        self._boxes: dict[int, tuple[float, ...] | None] = {}
        self.handlers = {
            _code(enter): self._enter,
            _code(nearer_primitive): self._primitive,
            _code(nearest_of_triangle_leaf): self._leaf,
        }

    def _enter(self, own: Any, caller: CodeType, outer: Any, result: int) -> None:
        bvh, node = own["bvh"], own["node"]
        if outer["instance"] >= 0:
            self.steps.append((node, None))
            return
        center = bvh.frames[0 if node != bvh.unbounded else node, CENTER : CENTER + 3]
        planes = bvh.boxes[node, :CHILDREN].reshape(2, 3, VECTOR_WIDTH) + center[:, None]
        for lane in range(VECTOR_WIDTH):
            self._boxes[child_of(bvh, node, lane)] = (*planes[0, :, lane], *planes[1, :, lane])
        whole = (*planes[0].min(axis=1), *planes[1].max(axis=1))
        self.steps.append((node, self._boxes.get(node, whole)))

    def _primitive(self, own: Any, caller: CodeType, outer: Any, result: Hit) -> None:
        self.tests += 1

    def _leaf(self, own: Any, caller: CodeType, outer: Any, result: Hit) -> None:
        self.tests += size_of(own["node"])
