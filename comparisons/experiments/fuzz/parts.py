"""Random parts of a scene: materials, shapes, lights, cameras, placed so that they are seen."""

import warnings
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.experiments.fuzz.data import Data, text_of
from comparisons.experiments.fuzz.fields import Draw, Names, rounded, values
from comparisons.experiments.fuzz.meshes import mesh
from comparisons.experiments.fuzz.schema import types
from reference_rt.core.model import Description
from reference_rt.materials import Emissive, Wrapper
from reference_rt.rendering.scene import Scene
from reference_rt.scene.build import build_tables
from reference_rt.shapes.instances import Instance
from reference_rt.shapes.shape import Shape, Solid, TabulationContext
from reference_rt.util.errors import SceneError, SceneWarning

TRIES = 12
"""Times that a part is drawn again which its own checks refuse."""

REACH = 2.0
"""Half the size of the room that shapes are put into, in scene units."""


class RefusedError(Exception):
    """No part was found that the schema allows."""


# ---- materials ----------------------------------------------------------------------------------


def material(
    draw: Draw, kind: str, named: Data, names: Names, textures: Data, folder: Path
) -> Data:
    """A material of a type, made of those in `named` if it is made of others.

    Raises RefusedError.
    """
    cls = types("material")[kind]
    scatters = [name for name, other in named.items() if other["type"] != "emissive"]
    for _ in range(TRIES):
        found = values(cls, draw, names)
        if issubclass(cls, Wrapper):
            for field in cls.bases:
                if scatters and (cls.model_fields[field].is_required() or draw.chance(0.5)):
                    found[field] = draw.pick(scatters)
        elif issubclass(cls, Emissive) and scatters and draw.chance(0.6):
            found["base"] = draw.pick(scatters)
        scene = {"materials": {**named, "new": found}, "textures": textures}
        if is_valid(scene | {"shapes": [{"type": "sphere", "material": "new"}]}, folder):
            return found
    raise RefusedError(kind)


def is_valid(scene: Data, folder: Path) -> bool:
    """Whether a scene can be read and rendered."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SceneWarning)
            build_tables(Scene.parse(text_of(scene), "part.yaml", folder))
    except SceneError:
        return False
    return True


# ---- shapes -------------------------------------------------------------------------------------


def shape(draw: Draw, kind: str, names: Names, folder: Path, solid: bool = False) -> Data:
    """A shape of a type of about unit size about the origin, without transform.  solid: an operand
    of set operations.  Raises RefusedError."""
    cls = types("shape")[kind]
    for _ in range(TRIES):
        if issubclass(cls, Solid):
            found: Data = {"type": kind, "of": _operands(draw, names, folder, 0)}
        elif kind == "mesh" and (solid or draw.chance(0.8)):
            found = mesh(draw, closed=solid)
        else:
            found = _file_mesh(values(cls, draw, names))
        if solid and "capped" in cls.model_fields:
            found["capped"] = True
        if _tabulates(cls, found, folder):
            return found
    raise RefusedError(kind)


def _file_mesh(found: Data) -> Data:
    """A mesh is of a file or of arrays; random arrays make none."""
    if "file" not in found:
        return found
    kept = ("type", "file", "smooth" if "smooth" in found else "face_normals")
    return {key: value for key, value in found.items() if key in kept}


def _tabulates(cls: type, found: Data, folder: Path) -> bool:
    try:
        described = cls.model_validate(found)  # type: ignore[attr-defined]
        if isinstance(described, Shape) and not isinstance(described, Solid | Instance):
            described.tabulate(TabulationContext(folder=folder))
    except (SceneError, ValueError):
        return False
    return True


@cache
def operand_types() -> tuple[str, ...]:
    """The types that set operations take, set operations included."""
    return tuple(kind for kind, cls in types("shape").items() if _takes_part(kind, cls))


def _takes_part(kind: str, cls: type[Description]) -> bool:
    """Whether a solid can be made of an example of the type."""
    capped = {"capped": True} if "capped" in cls.model_fields else {}
    solids = ({"type": "union", "of": [{**one, **capped, "type": kind}]} for one in cls.EXAMPLES)
    return issubclass(cls, Solid) or any(is_valid({"shapes": [s]}, Path()) for s in solids)


def _operands(draw: Draw, names: Names, folder: Path, depth: int) -> list[Data]:
    """Two or three operands that overlap, set operations among them down to three levels."""
    found = []
    for k in range(int(draw.rng.integers(2, 4))):
        kind = draw.pick(operand_types())
        is_solid = issubclass(types("shape")[kind], Solid)
        if is_solid and (depth > 1 or draw.chance(0.6)):
            kind = draw.pick(("sphere", "box", "cylinder"))
            is_solid = False
        if is_solid:
            one: Data = {"type": kind, "of": _operands(draw, names, folder, depth + 1)}
        else:
            one = shape(draw, kind, names, folder, solid=True)
        if k > 0 or draw.chance(0.5):
            one["transform"] = placement(draw, 0.5, 0.9)
        found.append(one)
    return found


# ---- where they are -----------------------------------------------------------------------------


def placement(draw: Draw, reach: float, size: float) -> list[Data]:
    """Steps of a transform: any affine map that scales by about `size` and moves by `reach`."""
    steps: list[Data] = []
    if draw.chance(0.5):
        steps.append({"scale": draw.between(0.5 * size, size)})
    elif draw.chance(0.7):
        scale = [draw.between(0.4 * size, 1.2 * size) for _ in range(3)]
        if draw.extreme and draw.chance(0.3):
            scale[int(draw.rng.integers(3))] = draw.log(1e-5, 1e-2)
        if draw.chance(0.25):
            scale[int(draw.rng.integers(3))] *= -1.0
        steps.append({"scale": scale})
    else:
        linear = np.eye(3) * size + 0.35 * size * draw.rng.normal(size=(3, 3))
        if abs(np.linalg.det(linear)) < 0.15 * size**3:
            linear = np.eye(3) * size
        rows = [[rounded(x) for x in row] + [draw.between(-0.2, 0.2)] for row in linear.tolist()]
        steps.append({"matrix": rows})
    if draw.chance(0.6):
        degrees = draw.pick((90.0, 180.0, draw.between(-180.0, 180.0), draw.between(-180, 180)))
        steps.append({"rotate": {"axis": _axis(draw), "degrees": degrees}})
    if draw.chance(0.9):
        steps.append({"translate": draw.vector(reach)})
    return steps


def _axis(draw: Draw) -> list[float]:
    if draw.chance(0.3):
        axis = [0.0, 0.0, 0.0]
        axis[int(draw.rng.integers(3))] = 1.0
        return axis
    found = draw.vector()
    return found if any(found) else [0.0, 0.0, 1.0]


def facing(draw: Draw, place: Any, target: Any, size: float) -> list[Data]:
    """A matrix that puts a shape at `place`, its z axis towards `target`, sheared by chance."""
    w = np.subtract(target, place)
    w = w / np.linalg.norm(w)
    u = np.cross(w, np.eye(3)[int(np.argmin(np.abs(w)))])
    u = u / np.linalg.norm(u)
    columns = np.column_stack([u, np.cross(w, u), w])
    columns = columns * size * draw.rng.uniform(0.5, 1.5, 3)
    if draw.chance(0.3):
        columns = columns @ (np.eye(3) + np.triu(draw.rng.uniform(-0.5, 0.5, (3, 3)), 1))
    rows = np.column_stack([columns, place]).tolist()
    return [{"matrix": [[rounded(x) for x in row] for row in rows]}]


def direction(draw: Draw, upwards: float = -1.0) -> Any:
    """A unit vector whose y is `upwards` at least."""
    while True:
        v = draw.rng.normal(size=3)
        v = v / np.linalg.norm(v)
        if v[1] >= upwards:
            return v


# ---- cameras and lights -------------------------------------------------------------------------


def camera(draw: Draw, kind: str, width: int, height: int) -> Data:
    """A camera of a type that looks at the middle."""
    cls = types("camera")[kind]
    far = draw.between(4.5, 8.0)
    eye = [rounded(x) for x in (far * direction(draw, 0.0)).tolist()]
    found = values(cls, draw, Names())
    for field in (
        "fov",
        "fov_axis",
        "view",
        "distance",
        "width",
        "near",
        "far",
        "hole_radius",
        "exposure",
    ):
        found.pop(field, None)
    found |= {"eye": eye, "target": draw.vector(0.3)}
    found["up"] = [0.0, 1.0, 0.0] if draw.chance(0.7) else draw.vector()
    fields = cls.model_fields
    half = 2.6  # of what is seen, at the target
    if "view" in fields and draw.chance(0.25):
        off = 0.0 if "aperture_radius" in fields else draw.between(-0.2, 0.2)
        x, y = half, half * height / width
        if "fov" in fields:
            x, y, off = x / far, y / far, off / far
        found["view"] = [off - x, off + x, -y, y]
    elif "width" in fields:
        found["width"] = draw.between(4.0, 6.0)
    elif "fov" in fields:
        found["fov"] = draw.between(38.0, 60.0)
        if draw.chance(0.3):
            found["fov_axis"] = draw.pick(("x", "y", "diagonal", "smaller", "larger"))
    if "film_width" in fields:
        found |= {"film_width": draw.between(0.8, 1.2), "film_distance": 1.0}
        found |= {"hole_radius": draw.between(0.005, 0.05)} if draw.chance(0.5) else {}
    if "aperture_radius" in fields:
        found |= {"aperture_radius": draw.between(0.02, 0.3), "focus_distance": rounded(far)}
    if draw.chance(0.2):  # planes through what is seen
        found["near"], found["far"] = rounded(far - draw.between(0.0, 2.0)), rounded(far + 1.0)
    try:
        cls.model_validate(found)
    except SceneError:
        found["up"] = [0.3, 1.0, 0.2]
    return found


def medium(draw: Draw, kinds: list[str]) -> Data:
    """A medium;  kinds: of its phase function, if it is not to be drawn."""
    sigma_t = draw.log(1e-3, 30.0) if draw.extreme else draw.log(0.1, 2.0)
    found: Data = {"type": "homogeneous", "sigma_t": sigma_t}
    if draw.chance(0.6):
        found["sigma_t"] = [rounded(sigma_t * draw.log(0.3, 3.0)) for _ in range(3)]
    found["albedo"] = draw.pick((0.0, 1.0, draw.between(0.0, 1.0)))
    if draw.chance(0.5):
        found["albedo"] = [draw.between(0.0, 1.0) for _ in range(3)]
    if draw.chance(0.2):
        found["scale"] = draw.log(0.3, 3.0)
    kind = kinds[0] if kinds else draw.pick([*types("phase"), None])
    return found if kind is None else found | {"phase": _phase(draw, kind)}


def _phase(draw: Draw, kind: str) -> Data:
    if kind == "blend":
        first, second = (_phase(draw, draw.pick(("isotropic", "hg", "rayleigh"))) for _ in range(2))
        return {"type": kind, "first": first, "second": second, "weight": draw.between(0.0, 1.0)}
    if kind != "hg":
        return {"type": kind}
    g = draw.pick((-0.99, 0.99)) if draw.extreme and draw.chance(0.3) else draw.between(-0.9, 0.9)
    return {"type": kind, "g": g}


def light(draw: Draw, kind: str, names: Names) -> Data:
    """A light of a type, outside of the shapes, that shines on the middle."""
    cls = types("light")[kind]
    found = values(cls, draw, names)
    place = [rounded(x) for x in (draw.between(3.5, 6.0) * direction(draw, 0.0)).tolist()]
    for field in ("position", "origin"):
        if field in cls.model_fields:
            found[field] = place
    if "target" in cls.model_fields:
        found["target"] = draw.vector(0.5)
    if "direction" in cls.model_fields:
        found["direction"] = [-x for x in place]
    if "transform" in cls.model_fields and draw.chance(0.7):
        found["transform"] = [{"rotate": {"axis": _axis(draw), "degrees": draw.between(-180, 180)}}]
    return found
