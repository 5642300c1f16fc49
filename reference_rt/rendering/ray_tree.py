"""The rays of one sample of a pixel: what `reference-rt trace` shows.

A second process runs the kernel of a tile as plain Python (NUMBA_DISABLE_JIT=1), which gives the
same bits as compiled kernels, and reads the local variables of kernels when they return, as a
debugger does.  So no kernel is written twice, and none is slower for it.

Each ray is a dictionary:

- kind: camera, mirrored, refracted, scattered or shadow;  parent: the number of the ray at whose
  end it begins, None for the camera's;  depth: edges before it;
- o, d, t_max;  t, end: where it ends, None where it hits nothing;
- weight: the share of its radiance in the sample: of a path the throughput;
- hit: shape, instance, part, face, material, p, n of the surface, None for a miss;  of a shadow ray
  instead occluded;
- medium: of a ray through media alone: the number of that in which it ends, -1 for none;
  is_scattered: whether a medium scatters it at its end;
- adds: (what, value) of each term that it adds to the sample's radiance;
- numbers: by name, the pdfs, MIS weights and probabilities behind these terms;
- steps: the nodes of the BVH that a ray meets when it is traced alone, each with its box in world
  space, None within instances;  tests: how many primitives are tested.

The sum of all `adds`, ray after ray from 0, is the sample's radiance, to the last bit.
"""

import functools
import inspect
import math
import pickle
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from types import CodeType, FrameType
from typing import Any, NamedTuple

import numpy as np

from reference_rt import lights as any_light
from reference_rt import materials as any_material
from reference_rt.accel import block_query
from reference_rt.accel import geometry as geometries
from reference_rt.accel.bvh import CENTER, CHILDREN, child_of, size_of
from reference_rt.accel.leaf import nearer_primitive, nearest_of_triangle_leaf
from reference_rt.accel.single_ray import enter
from reference_rt.core.arrays import FloatArray
from reference_rt.core.ray import Ray, at, hit_of, point_of, ray_of
from reference_rt.core.vec3 import Vec3, is_black, length
from reference_rt.integrators import (
    Light,
    direct,
    direct_light,
    media_path,
    path,
    ray_cast,
    scene_tables,
    shading,
    whitted,
)
from reference_rt.integrators.scene_tables import KernelScene
from reference_rt.jit.simd import VECTOR_WIDTH
from reference_rt.rendering import tiles
from reference_rt.rendering.executor import build_and_check
from reference_rt.rendering.plain_python import PlainTile, plain_tile, request, started_with
from reference_rt.scene.build import BuiltScene
from reference_rt.util.processes import tied

RayRecord = dict[str, Any]

CAMERA, MIRRORED, REFRACTED = "camera", "mirrored", "refracted"
SCATTERED, SHADOW = "scattered", "shadow"


def ray_trees(scene: BuiltScene, places: Sequence[tuple[int, int, int]]) -> list[dict[str, Any]]:
    """What samples are made of, each given by its pixel's column and row and its number: its
    `rays`, its radiance, the filter_weight, the exposure of its film (1 for cameras without), and
    value, the product of these.  Raises SceneError."""
    if isinstance(scene.integrator, Light):
        raise scene.error(
            "a pixel of 'light' is no mean of samples of its own; expected 'path'",
            *("integrator", "type"),
        )
    build_and_check(scene)
    width = scene.film.width
    asked = [((width * y + x), sample) for x, y, sample in places]
    done = subprocess.run(
        **started_with(_answer),
        **tied(),
        input=pickle.dumps((plain_tile(scene), asked)),
        stdout=subprocess.PIPE,
        check=True,
    )
    found: list[dict[str, Any]] = pickle.loads(done.stdout)
    return found


def _answer() -> None:
    """The second process: from the arguments of a kernel on standard input to trees."""
    tile, asked = request()
    with np.errstate(all="ignore"):
        trees = [_tree(tile, *one) for one in asked]
    sys.stdout.buffer.write(pickle.dumps(trees))


def _tree(tile: PlainTile, pixel: int, sample: int) -> dict[str, Any]:
    recorder, scene = _Recorder(), tile.arguments[0 if tile.is_cast else 1]
    values: list[FloatArray] = []
    recorder.run(lambda: values.append(tile.add(pixel, sample)))
    radiance = Vec3(0.0, 0.0, 0.0)
    for ray in recorder.rays:
        for _, value in ray["adds"]:
            radiance = radiance + Vec3(*value)
    tree: dict[str, Any] = _plain(
        {
            "rays": [_described(ray, scene) for ray in recorder.rays],
            "radiance": radiance,
            "filter_weight": recorder.filter_weight,
            "exposure": recorder.exposure,
            "value": values[0][:3],
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


class _Return(NamedTuple):
    """A function that returns: its local variables and its result; the code and the local variables
    of its caller."""

    own: dict[str, Any]
    result: Any
    caller: CodeType
    outer: dict[str, Any]


def _code(function: Any) -> CodeType:
    code: CodeType = inspect.unwrap(function).__code__
    return code


def _watch(run: Callable[[], object], handlers: Mapping[Any, Callable[[_Return], Any]]) -> None:
    """Run a function; whenever one of certain functions returns, its handler is called."""
    by_code = {_code(function): handler for function, handler in handlers.items()}

    def on_event(frame: FrameType, event: str, result: Any) -> None:
        if event == "return" and frame.f_code in by_code:
            caller = frame.f_back
            while caller is not None and caller.f_code.co_name == "choose":
                caller = caller.f_back  # of `ByClass` and `Linkable`
            assert caller is not None
            found = _Return(dict(frame.f_locals), result, caller.f_code, caller.f_locals)
            by_code[frame.f_code](found)

    sys.setprofile(on_event)
    try:
        run()
    finally:
        sys.setprofile(None)


_WHITTED, _DIRECT = _code(whitted.radiance), _code(direct.radiances)
_OF_SCATTERED, _PATHS = _code(direct._trace), _code(path.meet)
_OF_PATHS = _code(path.next_edges)
_WHOLE = Vec3(1.0, 1.0, 1.0)


class _Recorder:
    """rays: see above, each with its `Ray` as "ray" and its `Hit` as "found"."""

    def __init__(self) -> None:
        self.rays: list[RayRecord] = []
        self.filter_weight = self.exposure = 1.0
        self._surface: int | None = None
        """The ray at whose end others begin."""
        self._waiting: dict[int, tuple[int | None, str]] = {}
        """By places of Whitted's stack: parent and kind of a ray."""
        self._last: dict[str, _Return] = {}
        """What was returned for the ray that comes next."""
        self._lights: list[_Return] = []
        """What was returned for the shadow rays that come next."""

    def run(self, kernel: Callable[[], object]) -> None:
        keep = {
            name: functools.partial(self._last.__setitem__, name) for name in ("occluded", "share")
        }
        handlers: dict[Any, Callable[[_Return], Any]] = {
            tiles._film_ray: self._film_ray,
            shading.shade: self._shade,
            geometries.closest_hit: self._closest_hit,
            hit_of: self._hit_of_block,
            scene_tables.surface: self._point,
            geometries.occluded: keep["occluded"],
            any_light.background: self._emission,
            any_light.emitted: self._emission,
            any_material.ambient: keep["share"],
            any_light.ambient: self._ambient,
            direct_light.direct_from: self._direct_from,
            whitted._push: self._push,
            direct_light.fixed_lights: self._fixed_lights,
            path.environment_emission: self._weighted_emission,
            path.hit_emission: self._weighted_emission,
            path.connect: self._light_sample,
            scene_tables.surfaces: self._edge,
            path.go_on: self._scattered,
            block_query.any_hits: self._any_hits,
            media_path.fly: self._flight,
            media_path._met: self._emission_of_flight,
            media_path._connect: self._light_of_flight,
            ray_cast.cast: self._cast,
        }
        _watch(kernel, handlers)

    def _ray(self, kind: str, parent: int | None, ray: Ray, weight: Vec3, **more: Any) -> RayRecord:
        depth = 0 if parent is None else self.rays[parent]["depth"] + 1
        record = {"kind": kind, "parent": parent, "depth": depth, "ray": ray, "weight": weight}
        self.rays.append(record | {"adds": [], "numbers": {}, **more})
        if kind != SHADOW:
            self._surface = len(self.rays) - 1
        return self.rays[-1]

    def _shadow(self, ray: Ray, occluded: bool) -> RayRecord:
        assert self._surface is not None
        weight = self.rays[self._surface]["weight"]
        return self._ray(SHADOW, self._surface, ray, weight, occluded=occluded)

    def _film_ray(self, r: _Return) -> None:
        self.filter_weight, self.exposure = r.result.weight, r.result.exposure

    def _shade(self, r: _Return) -> None:
        if r.caller in (_WHITTED, _DIRECT):
            self.rays[-1]["point"] = r.result.point

    def _point(self, r: _Return) -> None:
        if r.caller is _OF_SCATTERED:
            self.rays[-1]["point"] = r.result

    # ---- Whitted and direct illumination --------------------------------------------------------

    def _push(self, r: _Return) -> None:
        kind = REFRACTED if r.own["weight"] is r.outer.get("refracted") else MIRRORED
        is_first = r.own["depth"] == 0
        self._waiting[r.own["top"]] = (None, CAMERA) if is_first else (self._surface, kind)

    def _closest_hit(self, r: _Return) -> None:
        ray = r.own["ray"]
        if r.caller is _WHITTED:
            parent, kind = self._waiting[r.outer["top"]]
            self._ray(kind, parent, ray, r.outer["weight"], found=r.result)

    def _hit_of_block(self, r: _Return) -> None:
        if r.caller is _DIRECT:
            self._ray(CAMERA, None, r.outer["ray"], _WHOLE, found=r.result)
        elif r.caller is _OF_SCATTERED:
            weight = r.outer["state"].throughput
            self._ray(SCATTERED, 0, r.outer["ray"], weight, found=r.result)

    def _emission(self, r: _Return) -> None:
        if r.caller in (_WHITTED, _DIRECT):
            what = "emitted" if "q" in r.own else "background"
            _add(self.rays[-1], what, r.outer.get("weight", _WHOLE) * r.result)

    def _ambient(self, r: _Return) -> None:
        light = self._last.pop("share").result * r.result
        _add(self.rays[-1], "ambient", r.outer["weight"] * light)

    def _direct_from(self, r: _Return) -> None:
        if (query := self._last.pop("occluded", None)) is not None:
            record = self._shadow(query.own["ray"], query.result)
            record["numbers"] = {"light": r.outer.get("k"), "light pdf": r.result.light.pdf}

    def _fixed_lights(self, r: _Return) -> None:
        assert self._surface is not None
        _add(self.rays[self._surface], "direct light", r.outer["weight"] * r.result)

    # ---- path tracing, and direct illumination by samples ---------------------------------------

    def _light_sample(self, r: _Return) -> None:
        if is_black(r.result.light):
            return
        if getattr(r.own["setup"], "shadows", True):
            self._lights.append(r)
        else:
            self.rays[-1]["numbers"] |= _of_light(r.own)
            _add(self.rays[-1], "direct light", r.result.light)

    def _any_hits(self, r: _Return) -> None:
        for k, light in enumerate(self._lights):
            record = self._shadow(light.result.shadow, bool(r.own["hits"].codes[k] >= 0))
            record["numbers"] = _of_light(light.own)
            if not record["occluded"]:
                _add(record, "direct light", light.result.light)
        self._lights.clear()

    def _weighted_emission(self, r: _Return) -> None:
        record = self.rays[-1]
        record["numbers"] |= _of_emission(r.own)
        _add(record, "emitted" if record["found"].kind >= 0 else "background", r.result)

    def _edge(self, r: _Return) -> None:
        """The hit of a path's next edge, and its surface point, are known."""
        if r.caller is not _PATHS:
            return
        ray, hit = ray_of(r.own["rays"], 0), hit_of(r.own["hits"], 0)
        state = path.state_of(r.outer["scratch"], 0)
        kind = CAMERA if r.outer["depth"] == 0 else SCATTERED
        record = self._ray(kind, self._surface, ray, state.throughput, found=hit)
        if hit.kind >= 0:
            record["point"] = point_of(r.own["points"], 0)

    def _scattered(self, r: _Return) -> None:
        if r.caller is _OF_PATHS:
            numbers = self.rays[-1]["numbers"]
            numbers["sampled pdf"] = r.own["drawn"].pdf
            numbers |= {k: r.own[k] for k in ("survival",) if k in r.own}

    # ---- path tracing through media --------------------------------------------------------------

    def _flight(self, r: _Return) -> None:
        outer, flight = r.outer, r.result
        kind = CAMERA if outer["depth"] == 0 else SCATTERED
        record = self._ray(kind, self._surface, outer["ray"], outer["throughput"])
        record |= {"medium": flight.medium, "is_scattered": flight.is_scattered}
        record["numbers"]["optical thickness"] = max(flight.passed.all)
        if flight.is_scattered or flight.hit.kind >= 0:
            record["end"] = flight.point.p
        if not flight.is_scattered:
            record |= {"found": flight.hit, "point": flight.point}

    def _emission_of_flight(self, r: _Return) -> None:
        record = self.rays[-1]
        record["numbers"]["MIS weight"] = r.own["weight"]
        _add(record, "emitted" if record["found"].kind >= 0 else "background", r.result)

    def _light_of_flight(self, r: _Return) -> None:
        if "shadow" in r.own:
            is_open, picked = r.own["way"].is_open, r.own["picked"]
            record = self._shadow(r.own["shadow"], not is_open)
            record["numbers"] = {
                "light": picked.number,
                "selection": picked.probability,
                "light pdf": picked.light.pdf,
            }
            if is_open:
                _add(record, "direct light", r.outer["throughput"] * r.result)

    def _cast(self, r: _Return) -> None:
        record = self._ray(CAMERA, None, r.own["ray"], _WHOLE, found=r.own["hit"])
        record["point"] = r.own.get("point")
        _add(record, "colour", r.result.colour)


def _add(record: RayRecord, what: str, value: Vec3) -> None:
    if not is_black(value):
        record["adds"].append((what, value))


def _of_light(own: dict[str, Any]) -> dict[str, float]:
    light, picked = own["light"], own["picked"]
    return {
        "light": picked.light,
        "selection": picked.probability,
        "light pdf": light.pdf,
        "bsdf pdf": 0.0 if light.is_delta else own["scattered"].density,
        "MIS weight": own["weight"],
    }


def _of_emission(own: dict[str, Any]) -> dict[str, float]:
    bsdf_pdf = own["state"].bsdf_pdf
    pdfs = {"bsdf pdf": bsdf_pdf, "light pdf": own["light_pdf"]} if bsdf_pdf > 0.0 else {}
    return pdfs | {"MIS weight": own["weight"]}


# ---- what a ray meets ----------------------------------------------------------------------------


def _described(record: RayRecord, scene: KernelScene) -> RayRecord:
    """The ray as it is shown, of numbers, names and tuples."""
    ray, hit = record.pop("ray"), record.pop("found", None)
    point = record.pop("point", None)
    is_hit = hit is not None and hit.kind >= 0
    way: dict[str, Any] = {"o": ray.o, "d": ray.d, "t_max": ray.t_max, "hit": None, "t": None}
    record |= way | {"end": record.get("end")}
    if record["end"] is not None:  # behind boundaries without a surface
        record["t"] = length(record["end"] - ray.o)
    if is_hit:
        ids = geometries.owner(scene.geometry, hit)._asdict()
        record["hit"] = ids | {"material": point.material, "p": point.p, "n": point.n}
        if record["end"] is None:
            record["t"], record["end"] = hit.t, point.p
    elif record["kind"] == SHADOW and ray.t_max < math.inf:
        record["end"] = at(ray, ray.t_max)
    return record | _met(ray, record["kind"] == SHADOW, scene)


def _met(ray: Ray, any_hit: bool, scene: KernelScene) -> dict[str, Any]:
    """The `steps` and `tests` of a ray that is traced alone."""
    geometry = scene.geometry
    if geometry.bvh is None:
        count = sum(len(table.face) for table in geometry.shapes if table is not None)
        return {"steps": [], "tests": count}
    steps: list[tuple[int, Any]] = []
    tests: list[int] = []
    boxes: dict[int, Any] = {}

    def entered(r: _Return) -> None:
        bvh, node = r.own["bvh"], r.own["node"]
        if r.outer["instance"] >= 0:
            steps.append((node, None))
            return
        center = bvh.frames[0 if node != bvh.unbounded else node, CENTER : CENTER + 3]
        planes = bvh.boxes[node, :CHILDREN].reshape(2, 3, VECTOR_WIDTH) + center[:, None]
        for lane in range(VECTOR_WIDTH):
            boxes[child_of(bvh, node, lane)] = (*planes[0, :, lane], *planes[1, :, lane])
        steps.append((node, boxes.get(node, (*planes[0].min(axis=1), *planes[1].max(axis=1)))))

    query = geometries.occluded if any_hit else geometries.closest_hit
    handlers: dict[Any, Callable[[_Return], Any]] = {
        enter: entered,
        nearer_primitive: lambda r: tests.append(1),
        nearest_of_triangle_leaf: lambda r: tests.append(size_of(r.own["node"])),
    }
    _watch(lambda: query(geometry, ray), handlers)
    return {"steps": steps, "tests": sum(tests)}
