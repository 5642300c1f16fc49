"""Reads .pbrt files as pbrt-v4's documentation says (https://pbrt.org/fileformat-v4), and evaluates
their cameras and shapes in NumPy: nothing here but `written` knows the writer."""

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.pbrt import write_pbrt
from reference_rt.rendering.scene import Scene

TOKEN = re.compile(r'\s+|#[^\n]*|("(?:[^"\\\n]|\\.)*"|[\[\]]|[^\s"\[\]#]+)')

NUMBERS = {"Scale": 3, "LookAt": 9, "Translate": 3, "Rotate": 4}
NAMED = {"NamedMaterial", "ObjectBegin", "ObjectInstance"}

ROUGH = "texture|float uroughness, texture|float vroughness, texture|float roughness, "
ROUGH += "bool remaproughness, texture displacement"
MAPPED = "string mapping, float uscale, float vscale, float udelta, float vdelta"
SCREEN = "float lensradius, float focaldistance, float frameaspectratio, float screenwindow"
SCREEN += ", float shutteropen, float shutterclose"
SAMPLED = "integer pixelsamples, integer seed"
RADII = "float xradius, float yradius"
IMAGE = "string filename, string filter, string wrap, float maxanisotropy, float scale, "
IMAGE += "bool invert, string encoding"

ACCEPTED = {
    "Camera perspective": f"{SCREEN}, float fov",
    "Camera orthographic": SCREEN,
    "Sampler independent": SAMPLED,
    "Sampler sobol": f"{SAMPLED}, string randomization",
    "Integrator volpath": "integer maxdepth, string lightsampler, bool regularize",
    "Integrator path": "integer maxdepth, string lightsampler, bool regularize",
    "PixelFilter box": RADII,
    "PixelFilter triangle": RADII,
    "PixelFilter gaussian": f"{RADII}, float sigma",
    "PixelFilter mitchell": f"{RADII}, float B, float C",
    "PixelFilter sinc": f"{RADII}, float tau",
    "Film rgb": "string filename, integer xresolution, integer yresolution, string sensor, "
    "float iso, float whitebalance, bool savefp16, float maxcomponentvalue, float cropwindow, "
    "integer pixelbounds, float diagonal",
    "LightSource point": "rgb I, float scale, float power, point3 from",
    "LightSource spot": "rgb I, float scale, float power, float coneangle, float conedeltaangle, "
    "point3 from, point3 to",
    "LightSource distant": "rgb L, float scale, float illuminance, point3 from, point3 to",
    "LightSource infinite": "rgb L, float scale, float illuminance, string filename, point3 portal",
    "AreaLightSource diffuse": "rgb L, float scale, float power, bool twosided, string filename",
    "MakeNamedMaterial diffuse": "string type, texture|rgb reflectance, texture displacement",
    "MakeNamedMaterial conductor": f"string type, rgb eta, rgb k, rgb reflectance, {ROUGH}",
    "MakeNamedMaterial dielectric": f"string type, float eta, {ROUGH}",
    "MakeNamedMaterial thindielectric": "string type, float eta, texture displacement",
    "MakeNamedMaterial interface": "string type",
    "MakeNamedMedium homogeneous": "string type, rgb sigma_a, rgb sigma_s, rgb Le, float scale, "
    "float Lescale, string preset, float g",
    "MakeNamedMaterial mix": "string type, string materials, texture|float amount",
    "Texture spectrum checkerboard": f"{MAPPED}, rgb tex1, rgb tex2, integer dimension",
    "Texture float checkerboard": f"{MAPPED}, float tex1, float tex2, integer dimension",
    "Texture spectrum imagemap": f"{MAPPED}, {IMAGE}",
    "Texture float imagemap": f"{MAPPED}, {IMAGE}",
    "Shape sphere": "float radius, float zmin, float zmax, float phimax, texture alpha",
    "Shape disk": "float height, float radius, float innerradius, float phimax, texture alpha",
    "Shape cylinder": "float radius, float zmin, float zmax, float phimax, texture alpha",
    "Shape trianglemesh": "integer indices, point3 P, normal N, vector S, point2 uv, texture alpha",
    "Shape plymesh": "string filename, texture alpha, texture displacement, float edgelength",
}
"""What pbrt-v4 looks up of what we may write: its `Create` functions' parameters."""

BEFORE = {"Camera", "Sampler", "Integrator", "PixelFilter", "Film", "Option"}
"""Only before `WorldBegin`."""

ANYWHERE = {"Scale", "LookAt", "Transform", "Translate", "Rotate", "WorldBegin"}
ANYWHERE |= {"MakeNamedMedium", "MediumInterface"}

VALUES = {"float": float, "integer": int, "rgb": float, "point3": float, "point2": float}
VALUES |= {"normal": float, "string": str, "texture": str, "bool": bool}
COUNTS = {"rgb": 3, "point3": 3, "point2": 2, "normal": 3}

ALBEDOS = {"rgb reflectance", "rgb tex1", "rgb tex2"}


@dataclass
class Shape:
    """object: the shape's own coordinates to the world's, or the group's;  outer: from there to the
    world."""

    plugin: str
    params: dict[str, Any]
    object: np.ndarray
    reversed: bool
    material: str
    light: dict[str, Any] | None
    outer: np.ndarray = field(default_factory=lambda: np.eye(4))
    media: tuple[str, str] = ("", "")


@dataclass
class File:
    options: dict[str, tuple[str, dict[str, Any]]] = field(default_factory=dict)
    camera_from_world: np.ndarray = field(default_factory=lambda: np.eye(4))
    materials: dict[str, dict[str, Any]] = field(default_factory=dict)
    media: dict[str, dict[str, Any]] = field(default_factory=dict)
    camera_medium: str = ""
    textures: dict[str, tuple[str, dict[str, Any]]] = field(default_factory=dict)
    lights: list[tuple[str, dict[str, Any]]] = field(default_factory=list)
    shapes: list[Shape] = field(default_factory=list)


def tokens(text: str) -> list[str]:
    found, at = [], 0
    while at < len(text):
        match = TOKEN.match(text, at)
        assert match, text[at : at + 40]
        at = match.end()
        if match[1]:
            found.append(match[1])
    return found


def unquoted(token: str) -> str:
    assert token[0] == token[-1] == '"', token
    return re.sub(r"\\(.)", r"\1", token[1:-1])


class _Reader:
    def __init__(self, path: Path) -> None:
        self.path, self.left = path, tokens(path.read_text(encoding="utf-8"))[::-1]

    def strings(self, n: int) -> list[str]:
        return [unquoted(self.left.pop()) for _ in range(n)]

    def numbers(self, n: int) -> np.ndarray:
        return np.array([float(self.left.pop()) for _ in range(n)])

    def params(self) -> dict[str, Any]:
        found: dict[str, Any] = {}
        while self.left and self.left[-1].startswith('"'):
            key = unquoted(self.left.pop())
            kind, _name = key.split(" ")
            values = []
            assert self.left.pop() == "["
            while (token := self.left.pop()) != "]":
                values.append(self.value(VALUES[kind], token))
            assert key not in found
            assert values
            assert len(values) % COUNTS.get(kind, 1) == 0, key
            if kind == "rgb":
                assert len(values) == 3
                assert min(values) >= 0.0
                assert key not in ALBEDOS or max(values) <= 1.0
            found[key] = values
        return found

    @staticmethod
    def value(kind: type, token: str) -> Any:
        if kind is str:
            return unquoted(token)
        if kind is bool:
            return {"true": True, "false": False}[token]
        value = kind(token)
        assert np.isfinite(value)
        assert kind is float or abs(value) < 2**31
        return value


def checked(kind: str, params: dict[str, Any]) -> dict[str, Any]:
    accepted = set()
    for one in ACCEPTED[kind].split(", "):
        *types, last = one.split("|")
        accepted |= {last, *(f"{t} {last.split()[1]}" for t in types)}
    assert set(params) <= accepted, (kind, set(params) - accepted)
    return params


def read(path: Path) -> File:
    """The file, whose every directive and parameter is one of pbrt-v4's, and whose names were made
    before they are used."""
    reader, file = _Reader(path), File()
    world, stack, groups, group = False, [], {}, None
    at, turned, material, light, sides = np.eye(4), False, "", None, ("", "")
    while reader.left:
        word = reader.left.pop()
        assert word in ANYWHERE or (word in BEFORE) != world, word
        if word in NUMBERS:
            at = at @ _map(word, reader.numbers(NUMBERS[word]))
        elif word == "Transform":
            assert reader.left.pop() == "["
            at = reader.numbers(16).reshape(4, 4).T
            assert reader.left.pop() == "]"
        elif word == "Option":
            name, value = reader.strings(1)[0], reader.left.pop()
            assert (name, value) == ("disabletexturefiltering", "true")
        elif word == "WorldBegin":
            assert not world
            world, at, sides = True, np.eye(4), ("", "")
        elif word == "MediumInterface":
            sides = tuple(reader.strings(2))
            assert all(name in file.media for name in sides if name)
        elif word == "MakeNamedMedium":
            (name,) = reader.strings(1)
            assert name not in file.media
            params = reader.params()
            file.media[name] = checked(f"{word} {params['string type'][0]}", params)
        elif word == "AttributeBegin":
            stack.append((at, turned, material, light, sides))
        elif word == "AttributeEnd":
            at, turned, material, light, sides = stack.pop()
        elif word == "ReverseOrientation":
            turned = not turned
        elif word == "ObjectEnd":
            group = None
        elif word in NAMED:
            (name,) = reader.strings(1)
            if word == "ObjectBegin":
                assert name not in groups
                assert group is None
                group = groups.setdefault(name, [])
            elif word == "ObjectInstance":
                assert group is None
                copies = [Shape(**{**vars(shape), "outer": at}) for shape in groups[name]]
                assert copies
                assert not any(shape.light for shape in copies)
                file.shapes += copies
            else:
                assert name in file.materials
                material = name
        elif word == "MakeNamedMaterial":
            (name,) = reader.strings(1)
            params = reader.params()
            assert name not in file.materials
            checked(f"{word} {params['string type'][0]}", params)
            assert set(params.get("string materials", [])) <= set(file.materials)
            assert len(params.get("string materials", "ab")) == 2
            _uses(file, params)
            file.materials[name] = params
        elif word == "Texture":
            name, kind, plugin = reader.strings(3)
            assert name not in file.textures
            file.textures[name] = plugin, checked(f"{word} {kind} {plugin}", reader.params())
        else:
            (plugin,) = reader.strings(1)
            params = checked(f"{word} {plugin}", reader.params())
            if word == "Shape":
                shape = Shape(plugin, params, at, turned, material, light, media=sides)
                assert material
                (file.shapes if group is None else group).append(shape)
            elif word == "LightSource":
                file.lights.append((plugin, params))
            elif word == "AreaLightSource":
                light = params
            else:
                assert word not in file.options
                file.options[word] = plugin, params
                if word == "Camera":
                    file.camera_from_world, file.camera_medium = at, sides[1]
    assert world
    assert not stack
    assert group is None
    assert set(file.options) == {"Camera", "Sampler", "Integrator", "PixelFilter", "Film"}
    for params in [params for _, params in [*file.lights, *file.textures.values()]]:
        for name in params.get("string filename", []):
            assert (path.parent / name).is_file()
    return file


def _uses(file: File, params: dict[str, Any]) -> None:
    for key, values in params.items():
        assert not key.startswith("texture ") or values[0] in file.textures


def _map(word: str, x: np.ndarray) -> np.ndarray:
    found = np.eye(4)
    if word == "Scale":
        return np.diag([*x, 1.0])
    assert word == "LookAt"
    eye, target, up = x.reshape(3, 3)
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(up / np.linalg.norm(up), forward)
    right /= np.linalg.norm(right)
    found[:3] = np.column_stack([right, np.cross(forward, right), forward, eye])
    return np.linalg.inv(found)


def scene_of(folder: Path | None = None, **parts) -> Scene:
    """A scene of these parts, whose files are in `folder`."""
    found = Scene.model_validate({"shapes": [], **parts})
    found._folder = folder or Path()
    return found


def written(scene: Scene, folder: Path) -> File:
    """The scene as it is written to `out.pbrt` of the folder."""
    write_pbrt(scene, folder / "out.pbrt")
    return read(folder / "out.pbrt")


# ---- cameras -------------------------------------------------------------------------------------


def camera_rays(file: File, film: np.ndarray, lens: Any = None) -> tuple[np.ndarray, np.ndarray]:
    """Origins and unit directions (n, 3) in the world of film points (n, 2) from 0 to 1, from the
    top left corner.  lens: points (n, 2) of the lens in the camera's x and y, instead of its
    middle."""
    plugin, params = file.options["Camera"]
    l, r, b, t = params["float screenwindow"]
    screen = np.column_stack([l + (r - l) * film[:, 0], t + (b - t) * film[:, 1]])
    ahead = np.broadcast_to([0.0, 0.0, 1.0], (len(film), 3))
    if plugin == "orthographic":
        o, d = np.column_stack([screen, np.zeros(len(film))]), ahead
    else:
        tangent = np.tan(np.radians(params["float fov"][0]) / 2.0)
        o, d = np.zeros((len(film), 3)), np.column_stack([screen * tangent, ahead[:, 2]])
        if lens is not None:
            focus = d * params["float focaldistance"][0]
            o = np.column_stack([lens, np.zeros(len(film))])
            d = focus - o
    to_world = np.linalg.inv(file.camera_from_world)
    d = d @ to_world[:3, :3].T
    return o @ to_world[:3, :3].T + to_world[:3, 3], d / np.linalg.norm(d, axis=1, keepdims=True)


# ---- shapes --------------------------------------------------------------------------------------


@dataclass
class Hits:
    t: np.ndarray
    n: np.ndarray
    uv: np.ndarray
    shape: np.ndarray


def intersect(file: File, folder: Path, o: np.ndarray, d: np.ndarray) -> Hits:
    """The nearest hits of rays (n, 3), with pbrt's normals and texture coordinates."""
    n = len(o)
    best = Hits(np.full(n, np.inf), np.zeros((n, 3)), np.zeros((n, 2)), np.full(n, -1))
    for k, shape in enumerate(file.shapes):
        m = shape.outer @ shape.object
        inverse = np.linalg.inv(m)
        oo, dd = o @ inverse[:3, :3].T + inverse[:3, 3], d @ inverse[:3, :3].T
        t, normal, uv = _SHAPES[shape.plugin](shape.params, oo, dd, folder)
        if shape.reversed ^ (np.linalg.det(shape.object[:3, :3]) < 0.0):
            normal = -normal
        normal = normal @ inverse[:3, :3]
        normal /= np.linalg.norm(normal, axis=1, keepdims=True) + 1e-300
        near = t < best.t
        best.t[near], best.n[near], best.uv[near] = t[near], normal[near], uv[near]
        best.shape[near] = k
    return best


def _nearest(candidates: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """The smallest positive t of pairs (t, whether it counts)."""
    ts = [np.where(good & (t > 1e-9), t, np.inf) for t, good in candidates]
    return np.min(ts, axis=0)


def _roots(a: Any, b: Any, c: Any) -> tuple[np.ndarray, np.ndarray]:
    with np.errstate(invalid="ignore", divide="ignore"):
        root = np.sqrt(b * b - 4.0 * a * c)
        return (-b - root) / (2.0 * a), (-b + root) / (2.0 * a)


def _turn(p: np.ndarray) -> np.ndarray:
    return (np.arctan2(p[:, 1], p[:, 0]) / (2.0 * np.pi)) % 1.0


def _at(o: np.ndarray, d: np.ndarray, t: np.ndarray) -> np.ndarray:
    return o + d * np.where(np.isfinite(t), t, 0.0)[:, None]


def _sphere(params: Any, o: Any, d: Any, folder: Path) -> Any:
    (r,) = params["float radius"]
    a, b, c = (d * d).sum(1), 2.0 * (o * d).sum(1), (o * o).sum(1) - r * r
    t = _nearest([(t, np.isfinite(t)) for t in _roots(a, b, c)])
    p = _at(o, d, t)
    theta = np.arccos(np.clip(p[:, 2] / r, -1.0, 1.0))
    return t, p / r, np.column_stack([_turn(p), (theta - np.pi) / (0.0 - np.pi)])


def _disk(params: Any, o: Any, d: Any, folder: Path) -> Any:
    (r,), (h,) = params["float radius"], params.get("float height", [0.0])
    with np.errstate(invalid="ignore", divide="ignore"):
        t = (h - o[:, 2]) / d[:, 2]
        p = _at(o, d, t)
        away = np.hypot(p[:, 0], p[:, 1])
        t = _nearest([(t, np.isfinite(t) & (away <= r))])
    normal = np.broadcast_to([0.0, 0.0, 1.0], o.shape)
    return t, normal, np.column_stack([_turn(p), (r - away) / r])


def _cylinder(params: Any, o: Any, d: Any, folder: Path) -> Any:
    (r,), (low,), (high,) = (params[f"float {k}"] for k in ("radius", "zmin", "zmax"))
    oo, dd = o[:, :2], d[:, :2]
    roots = _roots((dd * dd).sum(1), 2.0 * (oo * dd).sum(1), (oo * oo).sum(1) - r * r)
    inside = [(low <= _at(o, d, t)[:, 2]) & (_at(o, d, t)[:, 2] <= high) for t in roots]
    t = _nearest([(t, np.isfinite(t) & good) for t, good in zip(roots, inside, strict=True)])
    p = _at(o, d, t)
    normal = np.column_stack([p[:, :2] / r, np.zeros(len(p))])
    return t, normal, np.column_stack([_turn(p), (p[:, 2] - low) / (high - low)])


def _trianglemesh(params: Any, o: Any, d: Any, folder: Path) -> Any:
    faces = np.reshape(params["integer indices"], (-1, 3))
    points = np.reshape(params["point3 P"], (-1, 3))
    normals = np.reshape(params["normal N"], (-1, 3)) if "normal N" in params else None
    uv = np.reshape(params["point2 uv"], (-1, 2)) if "point2 uv" in params else None
    return _triangles(points, faces, normals, uv, o, d)


def _plymesh(params: Any, o: Any, d: Any, folder: Path) -> Any:
    """A binary .ply file of doubles, of properties that pbrt looks for."""
    head, _, body = (folder / params["string filename"][0]).read_bytes().partition(b"end_header\n")
    lines = [line.split() for line in head.decode().splitlines()]
    assert lines[1] == ["format", "binary_little_endian", "1.0"]
    counts = {line[1]: int(line[2]) for line in lines if line[0] == "element"}
    names = [line[2] for line in lines if line[:2] == ["property", "double"]]
    assert set(names) <= {"x", "y", "z", "nx", "ny", "nz", "u", "v"}
    assert lines[-1] == ["property", "list", "uchar", "int", "vertex_indices"]
    table = np.frombuffer(body, "<f8", counts["vertex"] * len(names)).reshape(-1, len(names))
    corners = [("n", "u1"), ("of", "<i4", 3)]
    faces = np.frombuffer(body, corners, counts["face"], table.nbytes)
    assert np.all(faces["n"] == 3)

    def columns(*wanted: str) -> Any:
        return table[:, [names.index(k) for k in wanted]] if wanted[0] in names else None

    shading = columns("nx", "ny", "nz"), columns("u", "v")
    return _triangles(columns("x", "y", "z"), faces["of"], *shading, o, d)


def _triangles(points: Any, faces: Any, normals: Any, uv: Any, o: Any, d: Any) -> Any:
    """Möller and Trumbore's test of every ray with every triangle."""
    best, which = np.full(len(o), np.inf), np.zeros(len(o), np.int64)
    weights = np.zeros((len(o), 3))
    a, b, c = (points[faces[:, k]] for k in range(3))
    middle = points.mean(axis=0)
    from_axis = np.linalg.norm(np.cross(middle - o, d), axis=1) / np.linalg.norm(d, axis=1)
    for k in np.flatnonzero(from_axis <= np.linalg.norm(points - middle, axis=1).max()):
        p = np.cross(d[k], c - a)
        with np.errstate(invalid="ignore", divide="ignore"):
            scale = 1.0 / (p * (b - a)).sum(1)
            away = o[k] - a
            v = (away * p).sum(1) * scale
            q = np.cross(away, b - a)
            w = (q @ d[k]) * scale
            t = (q * (c - a)).sum(1) * scale
            inside = (v >= 0.0) & (w >= 0.0) & (v + w <= 1.0) & (t > 1e-9)
        t = np.where(inside, t, np.inf)
        i = int(np.argmin(t))
        best[k], which[k], weights[k] = t[i], i, (1.0 - v[i] - w[i], v[i], w[i])
    normal = np.cross(b - a, c - a)[which]
    corners = faces[which]
    if normals is not None:  # pbrt turns a triangle's to the side of its vertices'
        smooth = (weights[:, :, None] * normals[corners]).sum(1)
        normal *= np.sign((normal * smooth).sum(1, keepdims=True))
    default = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
    at = default if uv is None else uv[corners]
    return best, normal, (weights[:, :, None] * at).sum(1)


_SHAPES = {
    "sphere": _sphere,
    "disk": _disk,
    "cylinder": _cylinder,
    "trianglemesh": _trianglemesh,
    "plymesh": _plymesh,
}
