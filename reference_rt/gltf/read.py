"""Scenes of glTF files: nodes, meshes, instances, cameras and lights as ours."""

import json
import math
import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from pydantic import ValidationError

from reference_rt.cameras import AnyCamera, Orthographic, Perspective
from reference_rt.cameras.film import Film
from reference_rt.core import transform
from reference_rt.core.arrays import FloatArray
from reference_rt.core.diagnosis import scene_error
from reference_rt.core.transform import Affine
from reference_rt.gltf.document import (
    HARMLESS,
    READ,
    Document,
    Instancing,
    Light,
    Node,
    Primitive,
)
from reference_rt.gltf.surfaces import Reading, Surfaces
from reference_rt.lights import AnyLight, Constant, Directional, EnvironmentMap, Point, Spot
from reference_rt.scene.model import WITHOUT_LINES, SceneModel
from reference_rt.shapes import Mesh
from reference_rt.shapes.csg import AnyShape
from reference_rt.shapes.instances import Instance
from reference_rt.shapes.meshes.files.data import NotReadError, RawMesh
from reference_rt.shapes.meshes.files.gltf import GltfFile, local_map, open_glb
from reference_rt.util.errors import SceneError, SceneWarning
from reference_rt.util.files import read_input

M = TypeVar("M", bound=SceneModel)

LONGEST_SIDE = 512
"""Pixels of the picture: a glTF file has only its shape."""

MOST_COPIES = 1 << 20
"""The most instances in all: a few bytes may stand for any number of them."""

LARGEST_LAMP = 1 << 20
"""Triangles up to which an emissive mesh is repeated for each node that shows it: light sampling
covers no instances."""

MOST_NAMES = 12
"""Extensions that one line names."""

_OPTIONS = ("camera", "environment", "scene")


def read_file(
    path: Path,
    cls: type[M],
    defaults: Mapping[str, str] | None = None,
    allow_missing: bool = False,
) -> M:
    """The scene in a .gltf or .glb file, an object of `cls`.

    defaults: `camera`, a name or a number from 0; `scene`, a number; `environment`, an image file,
    or a number, the radiance from everywhere.  allow_missing: whether to leave out what our scenes
    lack, with a warning for each.  Raises SceneError; warns of what is read otherwise.
    """
    options = dict(defaults or {})
    unknown = [name for name in options if name not in _OPTIONS]
    if unknown:
        expected = f"expected {', '.join(_OPTIONS[:-1])} or {_OPTIONS[-1]}"
        raise SceneError(f"has no default '{unknown[0]}'; {expected}", file=str(path))
    with np.errstate(all="ignore"):  # the checks of meshes and maps find overflow and NaN
        try:
            reading = _opened(path)
            scene = _scene(reading, cls, options)
        except SceneError as error:
            if error.file is not None:
                raise
            raise SceneError(error.message, error.path, str(path), others=error.others) from None
        except MemoryError:
            raise SceneError("does not fit into memory", file=str(path)) from None
        except NotReadError as error:
            raise SceneError(f"cannot be read: {error}", file=str(path)) from None
        except Exception as error:
            # Accessors, views and buffers have no schema: any error of reading them means that the
            # file is malformed.
            detail = (str(error).splitlines() or [""])[0][:200]
            if not isinstance(error, ValueError):
                detail = f"{type(error).__name__} {detail}"
            raise SceneError(f"is malformed: {detail}", file=str(path)) from None
    missing = [reading.error(text) for text in reading.missing]
    if missing and not allow_missing:
        first, *others = missing
        advice = f"{first.message}; or --allow-missing, which leaves it out"
        raise SceneError(advice, file=str(path), others=others)
    for text in missing:
        warnings.warn(SceneWarning(f"{text}; left out"), stacklevel=3)
    for note in reading.notes:
        warnings.warn(SceneWarning(f"{path}: {note}"), stacklevel=3)
    scene._folder, scene._source = path.parent, (str(path), WITHOUT_LINES)
    scene._defaults, scene._allows_missing = options, allow_missing
    return scene


def _opened(path: Path) -> Reading:
    try:
        content = read_input(path)
    except OSError as error:
        message = f"cannot be read: {error.strerror}; expected a scene file"
        raise SceneError(message, file=str(path)) from None
    if path.suffix.lower() == ".glb":
        file = open_glb(content, path.parent)
    else:
        file = GltfFile(content, None, path.parent)
    try:
        document = Document.model_validate(file.root)
    except ValidationError as error:
        raise scene_error(Document, error, file.root) from None
    required = [name for name in document.extensions_required if name not in READ | HARMLESS]
    if required:
        known = ", ".join(sorted(READ))
        shown = json.dumps(required[0][:60])
        raise SceneError(f"requires the extension {shown}, which is unknown; expected {known}")
    reading = Reading(path, document, file)
    unknown = sorted(_extensions(file.root) - READ - HARMLESS)
    for name in unknown:
        if name.startswith("KHR_"):
            reading.lack(f"uses the extension {json.dumps(name[:60])}, which is unknown")
    if vendors := [json.dumps(name[:60]) for name in unknown if not name.startswith("KHR_")]:
        more = f" and {len(vendors) - MOST_NAMES} more" if len(vendors) > MOST_NAMES else ""
        reading.note(
            "extensions of vendors that the file does not require are left out: "
            f"{', '.join(vendors[:MOST_NAMES])}{more}"
        )
    if document.animations:
        reading.note("animations are ignored: nodes are where the file puts them")
    return reading


def _extensions(root: Any) -> set[str]:
    """The names of all extensions that are used anywhere."""
    found: set[str] = set()
    waiting = [root]
    while waiting:
        part = waiting.pop()
        if isinstance(part, dict):
            if isinstance(used := part.get("extensions"), dict):
                found |= used.keys()
            waiting += [value for key, value in part.items() if key != "extras"]
        elif isinstance(part, list):
            waiting += part
    return found


# ---- the scene -----------------------------------------------------------------------------------


def _scene(reading: Reading, cls: type[M], options: Mapping[str, str]) -> M:
    shapes = _Shapes(reading)
    cameras: list[tuple[Node, int, Affine]] = []
    lights: list[AnyLight] = []
    number = _number(reading, options, "scene")
    nodes = [
        (reading.one("nodes", index), index, m) for index, m in reading.file.placed_nodes(number)
    ]
    for node, index, m in nodes:
        if node.camera is not None:
            cameras.append((node, index, m))
        if node.extensions.light is not None:
            lights.append(_light(reading, node.extensions.light.light, index, m))
        if node.mesh is not None:
            shapes.place(node, index, m)
    shapes.finish()
    lights += _environment(reading, options, bool(lights) or shapes.is_lit)
    camera, film = _view(reading, options, cameras, shapes.bounds)
    return cls(
        camera=camera,
        film=film,
        textures=shapes.surfaces.textures,
        materials=shapes.surfaces.materials,
        media=shapes.surfaces.media,
        shapes=tuple(shapes.shapes),
        groups=shapes.groups,
        lights=tuple(lights),
    )


def _number(reading: Reading, options: Mapping[str, str], name: str) -> int | None:
    if name not in options:
        return None
    if not options[name].isdecimal():
        raise reading.error(f"-D {name}={options[name]}: expected a number from 0")
    return int(options[name])


# ---- meshes --------------------------------------------------------------------------------------


class _Shapes:
    """Meshes where nodes put them: each as shapes of the scene, or where several nodes show it as a
    group and instances."""

    def __init__(self, reading: Reading) -> None:
        self.reading, self.surfaces = reading, Surfaces(reading)
        self.shapes: list[Mesh | Instance] = []
        self.groups: dict[str, tuple[AnyShape, ...]] = {}
        self.bounds = np.full((2, 3), np.nan)  # lower and upper corner
        self.lamps: set[str] = set()  # names of materials
        self.tilts: dict[str | None, str] = {}  # the normal map of a material
        self.mirrored: set[str] = set()  # names of normal maps
        self.is_lit = False
        self._copies: list[tuple[int, Affine]] = []

    def place(self, node: Node, index: int, m: Affine) -> None:
        assert node.mesh is not None
        if node.skin is not None:
            self.reading.note("skins are ignored: meshes have the shape in which they were bound")
        maps = [m]
        if node.extensions.instancing is not None:
            maps = _instances(self.reading, node.extensions.instancing, index, m)
        kept = [m for m in maps if not transform.flattens(m)]
        if len(kept) < len(maps):
            self.reading.note(f"nodes[{index}] is flat, by a scale of 0, and is left out")
        self._copies += [(node.mesh, m) for m in kept]
        if len(self._copies) > MOST_COPIES:
            raise self.reading.error(f"has more than {MOST_COPIES} instances of meshes")

    def finish(self) -> None:
        """Make the shapes of all meshes that were placed."""
        counts: dict[int, int] = {}
        for mesh, _ in self._copies:
            counts[mesh] = counts.get(mesh, 0) + 1
        made = {mesh: list(self._primitives(mesh)) for mesh in counts}
        names: dict[int, str] = {}
        for mesh, count in counts.items():
            faces = sum(len(part.faces) for part in made[mesh] if part.faces is not None)
            is_lamp = any(part.material in self.lamps for part in made[mesh])
            if made[mesh] and count > 1 and not (is_lamp and count * faces <= LARGEST_LAMP):
                name = self.reading.one("meshes", mesh).name or f"mesh {mesh}"
                names[mesh] = name if name not in self.groups else f"{name} ({mesh})"
                self.groups[names[mesh]] = tuple(made[mesh])
        for mesh, m in self._copies:
            is_identity = np.array_equal(m, transform.IDENTITY)
            steps = () if is_identity else (transform.Matrix(matrix=m.tolist()),)
            if mesh in names:
                self.shapes.append(Instance(group=names[mesh], transform=steps))
            else:
                self.shapes += [p.model_copy(update={"transform": steps}) for p in made[mesh]]
            for part in made[mesh]:
                self._bound(part, m)
                if part.material in self.tilts and transform.flips_orientation(m):
                    self.mirrored.add(self.tilts[part.material])
        self.surfaces.follow_v(self.mirrored)

    def _bound(self, part: Mesh, m: Affine) -> None:
        assert part.vertices is not None
        low, high = part.vertices.min(axis=0), part.vertices.max(axis=0)
        corners = np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, 8).T
        points = np.vstack([transform.apply_points(m, corners), self.bounds])
        self.bounds = np.array([np.nanmin(points, axis=0), np.nanmax(points, axis=0)])

    def _primitives(self, index: int) -> Iterator[Mesh]:
        """The primitives of a mesh, without a transform."""
        for k, part in enumerate(self.reading.one("meshes", index).primitives):
            where = f"meshes[{index}].primitives[{k}]"
            if part.mode < 4:
                self.reading.lack(f"{where} are points or lines; expected triangles")
                continue
            raw = self.reading.file.root["meshes"][index]["primitives"][k]
            sets = self.surfaces.uv_sets(part.material)
            found = self.reading.file.primitive(raw, sets or (0,))
            for n in sets:
                if f"TEXCOORD_{n}" not in part.attributes:
                    self.reading.note(f"{where} has no TEXCOORD_{n}: its textures show one point")
            if part.targets:
                self.reading.note("morph targets are ignored")
            if not sets:
                found = found._replace(uv=None)
            elif found.uv is None:
                found = found._replace(uv=np.zeros((len(found.vertices), 2)))
            yield self._mesh(part, found, where)

    def _mesh(self, part: Primitive, found: RawMesh, where: str) -> Mesh:
        surface = self.surfaces.surface(part.material, "COLOR_0" in part.attributes)
        self.lamps |= {surface.name} if surface.emits else set()
        self.is_lit = self.is_lit or surface.is_bright
        if surface.is_clear and "alpha of COLOR_0" in found.ignored:
            self.reading.lack(f"{where} has opacities of vertices; expected 1, or OPAQUE")
        colours = None if found.colours is None else np.clip(found.colours, 0.0, 1.0)
        try:
            made = Mesh(
                vertices=found.vertices,
                faces=found.faces,
                normals=found.normals,
                uv=found.uv,
                more_uv=found.more_uv,
                colours=colours,
                material=surface.name,
                interior=surface.medium,
            )
        except SceneError as error:
            raise self.reading.error(f"{where}: {error}") from None
        if surface.tilt is not None and made.uv is not None:
            self.tilts[surface.name] = surface.tilt
            if _is_mirrored(made.uv[made.faces]):
                self.mirrored.add(surface.tilt)
        return made


def _is_mirrored(uv: FloatArray) -> bool:
    """Whether any triangle of (m, 3, 2) texture coordinates goes around clockwise."""
    (a, b), (c, d) = (uv[:, 1] - uv[:, 0]).T, (uv[:, 2] - uv[:, 0]).T
    return bool((a * d - b * c < 0.0).any())


def _instances(reading: Reading, found: Instancing, index: int, m: Affine) -> list[Affine]:
    """The maps of EXT_mesh_gpu_instancing: each copy's own, then the node's."""
    columns: dict[str, FloatArray] = {}
    for name, width in (("TRANSLATION", 3), ("ROTATION", 4), ("SCALE", 3)):
        if name in found.attributes:
            accessor = reading.file.accessor(found.attributes[name], (width,))
            columns[name.lower()] = np.asarray(accessor, np.float64)
    counts = {len(column) for column in columns.values()}
    if len(counts) != 1 or max(counts) > MOST_COPIES:
        raise reading.error(
            f"nodes[{index}]: the attributes of its instances have {sorted(counts)} rows; expected "
            f"as many in each, at most {MOST_COPIES}"
        )
    rows = range(counts.pop())
    return [transform.compose(local_map({k: v[i] for k, v in columns.items()}), m) for i in rows]


# ---- lights --------------------------------------------------------------------------------------


def _triple(vector: FloatArray) -> tuple[float, float, float]:
    x, y, z = vector.tolist()
    return x, y, z


def _axes(reading: Reading, index: int, m: Affine) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Where a node is, and the unit directions that its -z axis and its y axis point to."""
    forward, up = -m[:, 2], m[:, 1]
    sizes = np.linalg.norm(forward), np.linalg.norm(up)
    if not (np.isfinite(m).all() and min(sizes) > 0.0):
        raise reading.error(f"nodes[{index}] has no direction; expected a transform without zeros")
    return m[:, 3], forward / sizes[0], up / sizes[1]


def _light(reading: Reading, number: int, index: int, m: Affine) -> AnyLight:
    lights = reading.document.extensions.lights.lights
    if number >= len(lights):
        raise reading.error(f"nodes[{index}] names light {number}; expected one of {len(lights)}")
    light: Light = lights[number]
    if light.range is not None:
        reading.note("ranges of lights are ignored: light falls with the square of the distance")
    axes = _axes(reading, index, m)
    place, forward = _triple(axes[0]), _triple(axes[1])
    r, g, b = (light.intensity * x for x in light.color)
    if light.type == "directional":
        return Directional(direction=forward, irradiance=(r, g, b))
    if light.type == "point":
        return Point(position=place, intensity=(r, g, b))
    if not light.spot.inner_cone_angle < light.spot.outer_cone_angle:
        raise reading.error(f"light {number}: expected innerConeAngle below outerConeAngle")
    reading.note(
        "between a spot's cones light falls linearly with the angle; the formula that glTF "
        "recommends is the square of a ramp of the cosine"
    )
    return Spot(
        origin=place,
        target=_triple(axes[0] + axes[1]),
        intensity=(r, g, b),
        cutoff_angle=math.degrees(light.spot.outer_cone_angle),
        beam_width=math.degrees(light.spot.inner_cone_angle),
    )


def _environment(reading: Reading, options: Mapping[str, str], is_lit: bool) -> list[AnyLight]:
    wanted = options.get("environment")
    if wanted is None and is_lit:
        return []
    if wanted is None:
        reading.note(
            "has no lights, or only surfaces that emit at most 1: the environment is 1 everywhere; "
            "expected lights, or -D environment=FILE or =RADIANCE"
        )
    try:
        radiance = float(wanted or 1.0)
    except ValueError:
        return [EnvironmentMap(file=str(Path(str(wanted)).resolve()))]
    return [Constant(radiance=(radiance,) * 3)] if radiance != 0.0 else []


# ---- cameras -------------------------------------------------------------------------------------


def _view(
    reading: Reading,
    options: Mapping[str, str],
    found: list[tuple[Node, int, Affine]],
    bounds: FloatArray,
) -> tuple[AnyCamera, Film]:
    """The camera, and a film of its shape."""
    cameras = [(reading.one("cameras", node.camera or 0), node, *rest) for node, *rest in found]
    wanted = options.get("camera")
    chosen = cameras[:1]
    if wanted is not None:
        chosen = [c for c in cameras if wanted in (c[0].name, c[1].name)]
        if not chosen and wanted.isdecimal():
            chosen = cameras[int(wanted) :][:1]
        if not chosen:
            names = ", ".join(json.dumps(c[0].name or c[1].name) for c in cameras) or "none"
            raise reading.error(
                f"there is no camera {json.dumps(wanted)}; expected a number from 0, or one of: "
                f"{names}"
            )
    elif len(cameras) > 1:
        reading.note(f"has {len(cameras)} cameras: the first is taken; others by -D camera=NAME")
    if not chosen:
        reading.note("has no camera: the view is from the front; expected a camera")
        return _front(bounds), Film(width=LONGEST_SIDE, height=LONGEST_SIDE)
    camera, _, index, m = chosen[0]
    eye, forward, up = _axes(reading, index, m)
    place: dict[str, Any] = {"eye": eye, "target": eye + forward, "up": up}
    if (view := camera.perspective) is not None:
        planes = {"near": view.znear, "far": view.zfar}
        fov = math.degrees(view.yfov)
        made: AnyCamera = Perspective(fov=fov, fov_axis="y", **place, **planes)
        return made, _film(view.aspect_ratio or 1.0)
    if (view := camera.orthographic) is None or 0.0 in (view.xmag, view.ymag):
        raise reading.error(
            f"cameras[{found[0][0].camera}]: expected 'perspective', or 'orthographic' with xmag "
            "and ymag other than 0"
        )
    width, height = 2.0 * abs(view.xmag), 2.0 * abs(view.ymag)
    made = Orthographic(width=width, near=view.znear, far=view.zfar, **place)
    return made, _film(width / height)


def _film(aspect: float) -> Film:
    """A film of this width over height."""
    width, height = (
        max(1, round(LONGEST_SIDE * min(1.0, side))) for side in (aspect, 1.0 / aspect)
    )
    return Film(width=width, height=height)


def _front(bounds: FloatArray) -> Perspective:
    """A view of the whole box from +z, a little from above."""
    if not np.isfinite(bounds).all():
        return Perspective()
    centre, radius = bounds.mean(axis=0), 0.5 * float(np.linalg.norm(bounds[1] - bounds[0]))
    direction = np.array([0.0, 0.3, 1.0]) / math.hypot(0.3, 1.0)
    distance = 1.05 * (radius or 1.0) / math.sin(math.radians(22.5))
    eye = _triple(centre + distance * direction)
    return Perspective(eye=eye, target=_triple(centre), fov=45.0)
