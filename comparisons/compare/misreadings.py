"""Hypotheses about a scene that a renderer reads wrongly: a roughness squared once more, a texture
upside down, the angle of view of the other axis.

A scene without noise is rendered with each such change, and the picture is what the candidate
should show.
"""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.compare.diagnosis.hypothesis import Hypothesis
from comparisons.compare.diagnosis.misfit import REST
from comparisons.compare.path_length import Lengths
from reference_rt.cameras import Orthographic
from reference_rt.cameras.view_rectangle import CentralCamera
from reference_rt.lights import Directional
from reference_rt.materials import GltfPbr, NormalMap
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Grid
from reference_rt.textures import Bitmap
from reference_rt.textures.image_file import linear
from reference_rt.util.files import temporary_folder

F0 = (0.0, 0.5, 2.0, 4.0)
"""Factors of a dielectric's reflectance seen head-on: without it, and by usual mistakes of 2."""

_Update = dict[str, Any]
_OfField = Callable[[Any], _Update]


def _of(field: str, change: Callable[[Any], Any]) -> _OfField:
    """Changes a field, if there is one that is a number or a colour."""

    def update(part: Any) -> _Update:
        value = getattr(part, field, None)
        return {} if value is None or isinstance(value, str) else {field: change(value)}

    return update


def _colour(change: Callable[[Any], Any]) -> _OfField:
    def update(part: Any) -> _Update:
        found = (_of(f, change)(part) for f in ("base_color", "reflectance"))
        return next(filter(None, found), {})

    return update


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


def _flipped(texture: Any) -> _Update:
    (a, b, c), (d, e, f) = texture.uv.coefficients().reshape(2, 3).tolist()
    return {"uv": type(texture.uv)(matrix=((a, b, c), (-d, -e, 1.0 - f)))}


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
    "colours of materials are decoded from sRGB": _colour(
        lambda c: tuple(np.broadcast_to(linear(np.asarray(c, dtype=np.float64)), 3).tolist())
    ),
    **{f"reflectance head-on (F0) is {factor:g} times as large": _f0(factor) for factor in F0},
}

TEXTURES: dict[str, _OfField] = {
    "textures are upside down": _of_bitmap(_flipped),
    "sRGB textures are taken for linear": _of_bitmap(_recoded(raw=False)),
    "linear textures are taken for sRGB": _of_bitmap(_recoded(raw=True)),
    "textures are filtered otherwise": _of_bitmap(_filtered),
}


def misreadings(scene: Scene, threads: int | None = None) -> Lengths | None:
    """Hypotheses about a scene; None unless its pictures have no noise."""
    if not isinstance(scene.resolved_sampler, Grid):
        return None

    def hypotheses(reference: Any) -> Iterator[Hypothesis]:
        with temporary_folder() as place:
            for name, parts in _changes(scene, place):
                picture = render(scene.changed(**parts), threads=threads).colour
                if picture.shape == reference.shape and not np.array_equal(picture, reference):
                    evidence = "so does our picture of the scene change if it is read so"
                    yield Hypothesis(name, name, evidence, picture, 0, REST)

    return hypotheses


def _changes(scene: Scene, place: Path) -> Iterator[tuple[str, _Update]]:
    """What is read wrongly, and the parts of the scene that result;  place: for images."""
    yield from _cameras(scene)
    others = [
        light.model_copy(update={"direction": tuple(-x for x in light.direction)})
        if isinstance(light, Directional)
        else light
        for light in scene.lights
    ]
    if others != list(scene.lights):
        yield "directions of light are reversed", {"lights": others}
    for parts, changes in (("materials", MATERIALS), ("textures", TEXTURES)):
        of: dict[str, Any] = getattr(scene, parts)
        for name, change in changes.items():
            others_of = {key: part.model_copy(update=change(part)) for key, part in of.items()}
            if others_of != of:
                yield name, {parts: others_of}
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
