"""Hypotheses about a scene that a renderer reads wrongly: a roughness squared once more, a texture
upside down, the angle of view of the other axis.

The scene is rendered with each such change, and the picture is what the candidate should show. Of
a scene with noise the change is known from pictures with the same random numbers.
"""

import math
import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.compare.diagnosis.hypothesis import Hypothesis
from comparisons.compare.diagnosis.misfit import REST
from comparisons.compare.path_length import Lengths
from reference_rt.cameras import Orthographic
from reference_rt.cameras.view_rectangle import CentralCamera
from reference_rt.core.arrays import FloatArray
from reference_rt.integrators import Light, Whitted
from reference_rt.lights import Ambient, Directional, Projector
from reference_rt.materials import GltfPbr, NormalMap, Phong
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Grid
from reference_rt.textures import Bitmap, Checker
from reference_rt.textures.image_file import linear
from reference_rt.util.errors import SceneError, SceneWarning
from reference_rt.util.files import temporary_folder

F0 = (0.0, 0.5, 2.0, 4.0)
"""Factors of a dielectric's reflectance seen head-on: without it, and by usual mistakes of 2."""

SAMPLES, PARTS = 1 << 19, 8
"""Camera samples of a picture with noise, and so many pictures, whose spread is the noise of a
change: less than a second."""

_Update = dict[str, Any]
_OfField = Callable[[Any], _Update]


def _of(field: str, change: Callable[[float], float]) -> _OfField:
    """Changes the numbers of a field, if there is one; a texture stays as it is."""

    def update(part: Any) -> _Update:
        value = getattr(part, field, None)
        if isinstance(value, tuple):
            return {field: tuple(x if isinstance(x, str) else change(x) for x in value)}
        return {} if value is None or isinstance(value, str) else {field: change(value)}

    return update


def _colour(change: Callable[[Any], Any]) -> _OfField:
    def update(part: Any) -> _Update:
        for field in ("base_color", "reflectance"):
            value = getattr(part, field, None)
            if value is not None and not isinstance(value, str):
                return {field: change(value)}
        return {}

    return update


def _decoded(c: Any) -> tuple[float, ...]:
    return tuple(np.broadcast_to(linear(np.asarray(c, dtype=np.float64)), 3).tolist())


def _f0(factor: float) -> _OfField:
    """The index of refraction that has so many times the reflectance head-on."""

    def update(part: Any) -> _Update:
        if not isinstance(part, GltfPbr):
            return {}
        root = min(factor**0.5 * abs((1.0 - part.ior) / (1.0 + part.ior)), 0.999)
        return {"ior": (1.0 + root) / (1.0 - root)}

    return update


def _of_bitmap(change: _OfField) -> _OfField:
    return lambda texture: change(texture) if isinstance(texture, Bitmap) else {}


def _placed(change: Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]) -> _OfField:
    """Changes the texture coordinates: u and v as (factor of u, factor of v, offset)."""

    def update(texture: Any) -> _Update:
        if not hasattr(texture, "uv"):
            return {}
        rows = change(*texture.uv.coefficients().reshape(2, 3))
        return {"uv": type(texture.uv)(matrix=tuple(tuple(row.tolist()) for row in rows))}

    return update


_ONE = np.array([0.0, 0.0, 1.0])
_EXCHANGED = [1, 0, 2]


def _recoded(raw: bool) -> _OfField:
    """Raw textures are decoded, or others are not."""
    other = {"encoding": "srgb" if raw else "raw"}
    return lambda texture: other if (texture.encoding == "raw") == raw else {}


def _filtered(texture: Any) -> _Update:
    return {"filter": "nearest" if texture.filter == "bilinear" else "bilinear"}


MATERIALS: dict[str, _OfField] = {
    "roughness is squared once too often": _of("roughness", lambda r: r * r),
    "roughness is not squared": _of("roughness", lambda r: r**0.5),
    "alpha is squared": _of("alpha", lambda alpha: alpha * alpha),
    "alpha is the square root": _of("alpha", lambda alpha: alpha**0.5),
    "metals are taken for dielectrics": _of("metallic", lambda metallic: 0.0),
    "dielectrics are taken for metals": _of("metallic", lambda metallic: 1.0),
    "colours of materials are decoded from sRGB": _colour(_decoded),
    "indices of refraction are inverted": lambda material: (
        {"interior_ior": material.exterior_ior, "exterior_ior": material.interior_ior}
        if hasattr(material, "interior_ior")
        else {}
    ),
    **{f"reflectance head-on (F0) is {factor:g} times as large": _f0(factor) for factor in F0},
}

NORMALISED: dict[str, Callable[[float], float]] = {
    "(p + 2) / 2": lambda p: (p + 2.0) / 2.0,
    "(p + 8) / 8": lambda p: (p + 8.0) / 8.0,
    "(p + 2) / (2 pi)": lambda p: (p + 2.0) / (2.0 * math.pi),
    "(p + 8) / (8 pi)": lambda p: (p + 8.0) / (8.0 * math.pi),
}
"""Factors that make a highlight of the exponent p hold the same light as others."""


def _normalised(factor: Callable[[float], float]) -> _OfField:
    return lambda part: _of("specular", lambda s: s * factor(part.exponent))(part)


PHONG: dict[str, _OfField] = {
    "half vectors and mirrored directions are exchanged": lambda phong: {
        "half_vector": not phong.half_vector
    },
    **{
        f"the highlight's exponent is {factor:g} times as large": _of("exponent", factor.__mul__)
        for factor in (0.25, 0.5, 2.0, 4.0)
    },
    **{
        f"the highlight is multiplied by {name}": _normalised(of) for name, of in NORMALISED.items()
    },
    "without highlights": _of("specular", lambda s: 0.0),
    "without mirrored light": _of("mirror", lambda s: 0.0),
}
"""Of the textbook's local shading."""


def _of_phong(change: _OfField) -> _OfField:
    return lambda material: change(material) if isinstance(material, Phong) else {}


MATERIALS |= {name: _of_phong(change) for name, change in PHONG.items()}

BRIGHTER = {"pi times": math.pi, "1/pi of": 1.0 / math.pi}


def _brighter(factor: float) -> _OfField:
    """Lights without extent."""

    def update(light: Any) -> _Update:
        for field in ("intensity", "irradiance"):
            if hasattr(light, field) and not isinstance(light, Projector):
                return _of(field, lambda x: x * factor)(light)
        return {}

    return update


LIGHTS: dict[str, _OfField] = {
    "ambient light is counted twice": lambda light: (
        _of("radiance", lambda x: 2.0 * x)(light) if isinstance(light, Ambient) else {}
    ),
    **{
        f"lights without extent are {name} what they should be": _brighter(factor)
        for name, factor in BRIGHTER.items()
    },
}


def _of_whitted(scene: Scene) -> Iterator[tuple[str, _Update]]:
    """Light that is left out, and how often rays are reflected."""
    lit = [light for light in scene.lights if not isinstance(light, Ambient)]
    if len(lit) < len(scene.lights):
        yield "without ambient light", {"lights": lit}
    own = scene.integrator
    if not isinstance(own, Whitted):
        return
    most = own.max_depth
    for depth, name in (
        (most - 1, "one reflection fewer"),
        (most + 1, "one reflection more"),
        (0, "without reflections and refractions"),
    ):
        if depth >= 0 and depth != most:
            yield name, {"integrator": own.model_copy(update={"max_depth": depth})}


TEXTURES: dict[str, _OfField] = {
    "textures are upside down": _placed(lambda u, v: (u, _ONE - v)),
    "textures are mirrored": _placed(lambda u, v: (_ONE - u, v)),
    "u and v of textures are exchanged": _placed(lambda u, v: (v, u)),
    "u and v of surfaces are exchanged": _placed(lambda u, v: (u[_EXCHANGED], v[_EXCHANGED])),
    "sRGB textures are taken for linear": _of_bitmap(_recoded(raw=False)),
    "linear textures are taken for sRGB": _of_bitmap(_recoded(raw=True)),
    "textures are filtered otherwise": _of_bitmap(_filtered),
}


def misreadings(scene: Scene, threads: int | None = None) -> Lengths | None:
    """Hypotheses about a scene; None of light that particles carry, whose pictures with the same
    random numbers do not belong together."""
    evidence = "so does our picture of the scene change if it is read so"
    if isinstance(scene.integrator, Light):
        return None
    has_noise = not isinstance(scene.resolved_sampler, Grid)

    def changed(place: Path) -> Iterator[tuple[str, Scene]]:
        for name, parts in _changes(scene, place, with_cameras=not has_noise):
            with suppress(SceneError):  # what is read so may be no scene
                yield name, scene.changed(**parts)

    def hypotheses(reference: FloatArray) -> Iterator[Hypothesis]:
        found: list[tuple[str, FloatArray, FloatArray | None]] = []
        right = np.zeros(0)
        with temporary_folder() as place:
            for name, other in changed(place):
                right = right if len(right) else _pictures(scene, threads)
                changes = _pictures(other, threads) - right
                change = changes.mean(axis=0)
                if change.shape == reference.shape and change.any():
                    noise = changes.var(axis=0, ddof=1) / PARTS if has_noise else None
                    found.append((name, change, noise))
        while found:
            name, change, noise = found[0]
            same = [one for one in found if _alike(one[1], change)]
            names = ", or ".join(one[0] for one in same)
            found = [one for one in found if not _alike(one[1], change)]
            yield Hypothesis(name, names, evidence, reference + change, 0, REST, noise=noise)

    return hypotheses


ALIKE = 0.01
"""Of a change, what two may differ by that are one: a checker upside down is one mirrored, but for
rounding at edges."""


def _alike(one: FloatArray, other: FloatArray) -> bool:
    return float(np.abs(one - other).sum()) <= ALIKE * float(np.abs(other).sum())


def _pictures(scene: Scene, threads: int | None) -> FloatArray:
    """PARTS pictures, the same seeds for all scenes; without noise one."""
    if isinstance(scene.resolved_sampler, Grid):
        return render(scene, threads=threads).colour[np.newaxis]
    pixels = scene.film.width * scene.film.height
    spp = 1 << max(0, (SAMPLES // PARTS // pixels).bit_length() - 1)
    own = scene.resolved_sampler
    samplers = [own.model_copy(update={"spp": spp, "seed": 1 + k}) for k in range(PARTS)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SceneWarning)  # what is read wrongly may be dark
        found = [render(scene.changed(sampler=s), threads=threads).colour for s in samplers]
    return np.stack(found)


def _changes(scene: Scene, place: Path, with_cameras: bool) -> Iterator[tuple[str, _Update]]:
    """What is read wrongly, and the parts of the scene that result;  place: for images;
    with_cameras: also what moves a picture, which needs no scene in noise."""
    if with_cameras:
        yield from _cameras(scene)
    others = [
        light.model_copy(update={"direction": tuple(-x for x in light.direction)})
        if isinstance(light, Directional)
        else light
        for light in scene.lights
    ]
    if others != list(scene.lights):
        yield "directions of light are reversed", {"lights": others}
    yield from _of_whitted(scene)
    for name, change in LIGHTS.items():
        others = [light.model_copy(update=change(light)) for light in scene.lights]
        if others != list(scene.lights):
            yield name, {"lights": others}
    for parts, changes in (("materials", MATERIALS), ("textures", TEXTURES)):
        of: dict[str, Any] = getattr(scene, parts)
        for name, change in changes.items():
            others_of = {key: part.model_copy(update=change(part)) for key, part in of.items()}
            if others_of != of:
                yield name, {parts: others_of}
    checkers = {
        key: texture.model_copy(update={c: _decoded(getattr(texture, c)) for c in CHECKED})
        for key, texture in scene.textures.items()
        if isinstance(texture, Checker)
    }
    if checkers:
        change = MATERIALS["colours of materials are decoded from sRGB"]
        of = {key: part.model_copy(update=change(part)) for key, part in scene.materials.items()}
        parts_of = {"materials": of, "textures": {**scene.textures, **checkers}}
        yield "colours of materials and textures are decoded from sRGB", parts_of
    maps = {m.normals for m in scene.materials.values() if isinstance(m, NormalMap)}
    if maps:
        plain = {
            k: scene.materials[m.base] if isinstance(m, NormalMap) else m
            for k, m in scene.materials.items()
        }
        yield "normal maps are ignored", {"materials": plain}
    turned = dict(scene.textures)
    for number, k in enumerate(sorted(maps)):  # a name is not always that of a file
        if isinstance(texture := turned[k], Bitmap):
            values = texture.read(scene.folder).linear.copy()
            values[..., 1] = 1.0 - values[..., 1]
            file = place / f"{number}.npy"
            np.save(file, values)
            update = {"file": str(file), "encoding": "raw", "scale": 1.0}
            turned[k] = texture.model_copy(update=update)
    if turned != scene.textures:
        yield "green of normal maps is flipped", {"textures": turned}


CHECKED = ("first", "second")
"""The colours of a checker."""


def _cameras(scene: Scene) -> Iterator[tuple[str, _Update]]:
    camera, film = scene.camera, scene.film
    if not isinstance(camera, CentralCamera | Orthographic):
        return
    l, r, b, t = camera.rectangle(film.width, film.height)

    def seen(view: Any) -> _Update:
        given = {name: getattr(camera, name) for name in camera.model_fields_set}
        others = ("fov", "fov_axis", "width", "view", "distance")
        kept = {k: v for k, v in given.items() if k not in others}
        return {"camera": type(camera)(**kept, view=view)}

    if film.width != film.height:
        for factor in (film.width / film.height, film.height / film.width):
            name = "the angle of view is taken for that of the other axis"
            yield name, seen(tuple(factor * x for x in (l, r, b, t)))
    dx, dy = 0.5 * (r - l) / film.width, 0.5 * (t - b) / film.height
    for across in (-dx, 0.0, dx):
        for up in (-dy, 0.0, dy):
            if across or up:
                name = "pixels are half a pixel off"
                yield name, seen((l + across, r + across, b + up, t + up))
