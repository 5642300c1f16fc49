"""Scene -> POV-Ray's scene language: raises NoCounterpartError for what POV-Ray does not compute as
we do.

Contract: texts are made of descriptions, never of tables; maps are of `geometry.affine`, files are
read by `mitsuba.second`.  POV-Ray's maps have rows for columns, its texture follows its object's
map, and the texture of a surface's back is its `interior_texture`.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

import reference_rt as rt
from comparisons import shapes
from comparisons.cameras import type_of as type_of_camera
from comparisons.geometry import affine
from comparisons.geometry.flatten import Copy, Leaf, Member, Tree, copies_of, place_of
from comparisons.geometry.frame import UNIT_ROUNDOFF, Frame
from comparisons.integrators import type_of as type_of_integrator
from comparisons.lights import type_of as type_of_light
from comparisons.lights.constant import ambient_of
from comparisons.materials import type_of as type_of_material
from comparisons.media import refuse_media
from comparisons.povray.inside import region_at, region_of
from comparisons.referee.sizes import ShapeSizes
from comparisons.renderers import NoCounterpartError, Reasons
from comparisons.renderers.vocabulary import PovLook, pov_vector
from comparisons.textures import type_of as type_of_texture
from comparisons.translator.moved import moved
from reference_rt.cameras.film import BoxFilter
from reference_rt.core.arrays import FloatArray
from reference_rt.core.model import name_of
from reference_rt.rendering.scene import Scene
from reference_rt.shapes import Mesh, Triangle

SIZE = 512.0
"""Half the size of a scene, at least and up to twice as much: POV-Ray loses hits closer than 1e-4,
and beyond 1e7."""

RANGE = 4.0 * SIZE
"""Coordinates that `hits` can say are between -RANGE and RANGE."""

VIEW = 1e-3
"""Least distance of the target over the scene's size: POV-Ray's epsilons are nothing beside it."""

MOST_COPIES = 256
"""Most copies of groups: POV-Ray is given each as text."""


def _check_copies(scene: Scene) -> None:
    if sum(copy.instance >= 0 for copy in copies_of(scene)) > MOST_COPIES:
        raise NoCounterpartError(f"more than {MOST_COPIES} copies of groups")


def frame_of(scene: Scene) -> Frame:
    """POV-Ray's coordinates of a scene.  Raises NoCounterpartError."""
    sizes, eye = ShapeSizes(scene), np.array(scene.camera.eye)
    lower, upper = np.minimum(sizes.lower, eye), np.maximum(sizes.upper, eye)
    half = float((upper - lower).max()) / 2.0
    if not 0.0 < half < math.inf:
        raise NoCounterpartError("a scene without size")
    if math.dist(scene.camera.eye, scene.camera.target) < VIEW * half:
        raise NoCounterpartError("a view of less than a thousandth of the scene")
    step = 2.0 ** math.floor(math.log2(half))
    center = np.round((lower + upper) / 2.0 / step) * step
    return Frame(tuple(center.tolist()), SIZE / step)


@dataclass
class Writing:
    """A scene being written, in POV-Ray's coordinates.  reasons: why POV-Ray is not eligible."""

    scene: Scene
    reasons: Reasons = field(default_factory=Reasons)

    def look(self, name: str | None) -> PovLook:
        """A material.  Raises NoCounterpartError."""
        material = rt.Diffuse() if name is None else self.scene.materials[name]
        if (to_povray := type_of_material(material).to_povray) is None:
            raise NoCounterpartError(f"the material {material.type}")
        return to_povray(material, self)

    def texture(self, leaf: Leaf, m: affine.Affine) -> str:
        """The texture of a leaf's front and back.  Raises NoCounterpartError."""
        look = self.look(leaf.material)
        if look.index is not None:
            finish = "reflection { 0, 1 fresnel on } conserve_energy"
            return f"texture {{ pigment {{ rgbt 1 }} finish {{ {finish} }} }}"
        pigment = self._pigment(look.colour, leaf, m)
        ambient = np.array(look.ambient) * ambient_of(self.scene.lights)
        behind = f"ambient rgb {pov_vector(ambient)}" if ambient.any() else ""
        before = f"{behind} diffuse {look.diffuse!r} "
        if look.highlight is not None:
            word, strength, p = look.highlight
            shine = f"phong_size {p!r}" if word == "phong" else f"roughness {1.0 / p!r}"
            before += f"{word} {strength!r} {shine} "
        if any(look.mirror):
            before += f"reflection {{ rgb {pov_vector(look.mirror)} }}"
        sides = before, before if look.both_sides else behind
        front, back = (f"texture {{ {pigment} finish {{ {side} }} }}" for side in sides)
        return f"{front} interior_{back}"

    def _pigment(self, colour: Any, leaf: Leaf, m: affine.Affine) -> str:
        if not isinstance(colour, str):
            return f"pigment {{ rgb {pov_vector(colour)} }}"
        texture, flat_uv = self.scene.textures[colour], shapes.type_of(leaf.shape).flat_uv
        if (to_povray := type_of_texture(texture).to_povray) is None:
            raise NoCounterpartError(f"the texture {texture.type}")
        if flat_uv is None or texture.uv_set:
            raise NoCounterpartError(f"the shape {name_of(type(leaf.shape))} under a texture")
        return f"pigment {{ {to_povray(texture)} {matrix(affine.compose(flat_uv, m))} }}"


def matrix(m: affine.Affine) -> str:
    """A map after all others."""
    return f"matrix {pov_vector(m.T.ravel())}"


# ---- the picture ---------------------------------------------------------------------------------


def picture(scene: Scene) -> str:
    """The text of a scene whose picture has the radiance of pixels' centres.  Raises
    NoCounterpartError with all reasons."""
    _check_copies(scene)
    writing = Writing(moved(scene, frame_of(scene)))
    scene, settings = writing.scene, ""
    lines: list[str] = []
    with writing.reasons.collected():
        refuse_media(scene)
    with writing.reasons.collected():
        if (to_povray := type_of_integrator(scene.integrator).to_povray) is None:
            raise NoCounterpartError(f"the integrator {scene.integrator.type}")
        settings = to_povray(scene.integrator)
    with writing.reasons.collected():
        lines.append(camera(scene))
    for light in scene.lights:
        with writing.reasons.collected():
            known = type_of_light(light)
            if known.to_povray is None:
                raise NoCounterpartError(f"the light {light.type}")
            lines.append(known.to_povray(light))
    glass: list[int] = []
    members = [(copy, member) for copy in copies_of(scene) for member in copy.members]
    for k, (copy, member) in enumerate(members):
        with writing.reasons.collected():
            index = _index_of(member, writing)
            text = _of_member(member, copy, scene, writing.texture)
            if index is not None:
                glass.append(k)
                text = f"{text.removesuffix('}')} interior {{ ior {index!r} }} no_shadow }}"
                opaque = _of_member(member, copy, scene, lambda leaf, m: _BLACK)
                lines.append(f"{opaque.removesuffix('}')} no_image no_reflection }}")
            lines.append(text)
    with writing.reasons.collected():
        _check_glass(scene, members, glass)
    writing.reasons.check()
    return _text(f"{settings} ambient_light rgb 1", lines)


def obstacles(scene: Scene) -> list[str]:
    """Why POV-Ray does not vote on a scene's picture, rendered with a box filter, and on its first
    hits; [] if it votes on both."""
    film = scene.film.model_copy(update={"filter": BoxFilter(), "layers": ()})
    found = []
    try:
        picture(scene.changed(film=film))
    except NoCounterpartError as error:
        found += [f"picture: {reason}" for reason in str(error).split("; ")]
    try:
        found += [f"first hits: {reason}" for reason in hits(scene).left_out]
    except NoCounterpartError as error:
        found += [f"first hits: {reason}" for reason in str(error).split("; ")]
    return found


def _text(settings: str, lines: Sequence[str]) -> str:
    head = (
        "#version 3.7;",
        f"global_settings {{ assumed_gamma 1 {settings} }}",
        "#default { finish { ambient 0 diffuse 0 } }",
    )
    return "\n".join((*head, *lines)) + "\n"


def camera(scene: Scene) -> str:
    """The camera, given by what it sees: POV-Ray keeps directions that it is given."""
    of, film = type_of_camera(scene.camera), scene.film
    if not isinstance(film.filter, BoxFilter):
        raise NoCounterpartError(f"the filter {film.filter.type}")
    if of.lens(scene.camera) is not None:
        raise NoCounterpartError(f"the camera {scene.camera.type}, with an aperture")
    if scene.camera.near or scene.camera.far:
        raise NoCounterpartError("a camera with near or far plane")
    eye, target = np.array(scene.camera.eye), np.array(scene.camera.target)
    ahead = (target - eye) / math.dist(eye, target)
    right = np.cross(ahead, scene.camera.up)
    right /= np.linalg.norm(right)
    up = np.cross(right, ahead)
    if of.is_upside_down:
        right, up = -right, -up
    l, r, b, t = of.edges(scene.camera, film)
    middle = 0.5 * ((l + r) * right + (b + t) * up)
    kind = "orthographic" if of.is_parallel else "perspective"
    location, direction = (eye + middle, ahead) if of.is_parallel else (eye, ahead + middle)
    sides = f"right {pov_vector((r - l) * right)} up {pov_vector((t - b) * up)}"
    place = f"location {pov_vector(location)} direction {pov_vector(direction)}"
    return f"camera {{ {kind} {place} {sides} }}"


Texture = Callable[[Leaf, affine.Affine], str]
"""Of a leaf under a map to POV-Ray's coordinates.  Raises NoCounterpartError."""


def _of_member(member: Member, copy: Copy, scene: Scene, texture: Texture) -> str:
    """The object of a member.  Raises NoCounterpartError."""

    def of_tree(tree: Tree | int) -> str:
        if isinstance(tree, int):
            return of_leaf(member.leaves[tree])
        parts = [of_tree(part) for part in tree.of]
        if len(parts) == 1:
            return parts[0]
        word = "merge" if tree.operation == "union" else tree.operation
        return f"{word} {{ {' '.join(parts)} }}"

    def of_leaf(leaf: Leaf) -> str:
        known, name = shapes.type_of(leaf.shape), name_of(type(leaf.shape))
        if known.to_povray is None:
            raise NoCounterpartError(f"the shape {name}")
        m = affine.map_in(leaf.shape, place_of(scene, leaf, copy.outer))
        text, place = known.to_povray(leaf.shape, scene.folder)
        return f"{text} {matrix(affine.compose(place, m))} {texture(leaf, m)} }}"

    return of_tree(0 if member.tree is None else member.tree)


# ---- glass ---------------------------------------------------------------------------------------


def _index_of(member: Member, writing: Writing) -> float | None:
    """The index of a member of glass."""
    looks = [writing.look(leaf.material) for leaf in member.leaves]
    for leaf, look in zip(member.leaves, looks, strict=True):
        material = "" if leaf.material is None else writing.scene.materials[leaf.material].type
        if isinstance(leaf.shape, Mesh | Triangle):
            if leaf.shape.type == "mesh" and _is_smooth(leaf, writing.scene):
                raise NoCounterpartError("a mesh with normals at its vertices")
            if look.index is not None:
                raise NoCounterpartError("glass on a mesh, which may not be closed")
        elif look.index is not None and not shapes.type_of(leaf.shape).encloses(leaf.shape):
            raise NoCounterpartError(f"{material} on an open shape")
    indices = {look.index for look in looks}
    if len(indices) > 1:
        raise NoCounterpartError("a solid of glass and of other materials")
    return indices.pop()


def _is_smooth(leaf: Leaf, scene: Scene) -> bool:
    to_cycles = shapes.type_of(leaf.shape).to_cycles
    return to_cycles is not None and to_cycles(leaf.shape, scene.folder).normals is not None


_BLACK = "texture { pigment { rgb 0 } }"
"""Of what casts the shadow of glass: POV-Ray's own lets light pass."""


def _check_glass(
    scene: Scene, members: Sequence[tuple[Copy, Member]], glass: Sequence[int]
) -> None:
    """POV-Ray does not divide radiance by the square of the index behind glass: that cancels where
    nothing is in glass."""
    if not glass:
        return
    sizes = ShapeSizes(scene)
    regions = [region_of(member, copy, sizes) for copy, member in members]
    points = [scene.camera.eye]
    points += [at(light) for light in scene.lights if (at := type_of_light(light).at) is not None]
    places = [region_at(np.array(p)) for p in points]
    for k in glass:
        others = [*regions[:k], *regions[k + 1 :], *places]
        if any(regions[k].meets(other) for other in others):
            raise NoCounterpartError("something that may be in glass, or touch it")


# ---- first hits ----------------------------------------------------------------------------------


class Hits(NamedTuple):
    """text: a scene of FRAMES frames, see `hits`;  shapes: the indices of those in it;  frame:
    POV-Ray's coordinates, and rounding (shapes,): of each there;  left_out: of other shapes, the
    reason and how many."""

    text: str
    shapes: tuple[int, ...]
    rounding: FloatArray
    frame: Frame
    left_out: dict[str, int]


FRAMES = 4

DIGITS = (1.0, 2.0**12, 2.0**24)
"""Of a coordinate, as a fraction of 2 RANGE from -RANGE, the three channels of a picture hold the
fractional parts of these multiples."""


def hits(scene: Scene) -> Hits:
    """The text whose first three frames show the coordinates x, y, z of first hits, see DIGITS, and
    whose fourth those of the front's normals to the axes, 1 - angle / pi: black from behind.

    Raises NoCounterpartError.
    """
    _check_copies(scene)
    left_out: dict[str, int] = {}
    kept = []
    for k, shape in enumerate(scene.shapes):
        try:
            one = scene.changed(shapes=(shape,))
            for copy in copies_of(one):
                for member in copy.members:
                    _of_member(member, copy, one, lambda leaf, m: "")
        except NoCounterpartError as error:
            left_out[str(error)] = left_out.get(str(error), 0) + 1
        else:
            kept.append(k)
    if not kept:
        raise NoCounterpartError("; ".join(left_out))
    film = scene.film.model_copy(update={"filter": BoxFilter(), "layers": ()})
    some = scene.changed(shapes=tuple(scene.shapes[k] for k in kept), film=film)
    frame = frame_of(some)
    there = moved(some, frame)
    rounding = np.full(len(kept), 2.0 * RANGE * 2.0**-40)
    for copy in copies_of(there):
        leaves = (leaf for member in copy.members for leaf in member.leaves)
        if any(isinstance(leaf.shape, Mesh | Triangle) for leaf in leaves):
            rounding[copy.shape] += 2.0 * SIZE * UNIT_ROUNDOFF  # POV-Ray's vertices are float32
    lines = [camera(there), _SHOWN]
    lines += [
        _of_member(member, copy, there, lambda leaf, m: _BOTH)
        for copy in copies_of(there)
        for member in copy.members
    ]
    return Hits(_text("max_trace_level 1", lines), tuple(kept), rounding, frame, left_out)


def _averaged(patterns: Sequence[str]) -> str:
    """Three patterns of values 0 to 1 as the channels of a pigment."""
    maps = (
        f"[1 {pattern} color_map {{ [0 rgb 0][1 rgb {pov_vector(3.0 * row)}] }}]"
        for pattern, row in zip(patterns, np.eye(3), strict=True)
    )
    return f"pigment {{ average pigment_map {{ {' '.join(maps)} }} }} finish {{ emission 1 }}"


def _digits(axis: str) -> str:
    return _averaged(
        [f"function {{ ({axis} + {RANGE!r}) / {2.0 * RANGE!r} * {k!r} }}" for k in DIGITS]
    )


_SLOPES = _averaged([f"slope {{ {axis} }}" for axis in "xyz"])
"""POV-Ray's slope pattern of an axis is 1 - acos(n · axis) / pi (measured)."""

_SHOWN = "\n".join(
    (
        "#switch (frame_number)",
        *(
            f"#case ({k}) #declare Front = texture {{ {_digits(axis)} }} #break"
            for k, axis in enumerate("xyz", 1)
        ),
        f"#else #declare Front = texture {{ {_SLOPES} }}",
        "#end",
        f"#if (frame_number < {FRAMES}) #declare Back = Front;",
        f"#else #declare Back = {_BLACK}",
        "#end",
    )
)

_BOTH = "texture { Front } interior_texture { Back }"
