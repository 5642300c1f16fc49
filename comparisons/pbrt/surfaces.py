"""The words of pbrt-v4's file format, and materials and textures in them."""

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from comparisons.geometry import affine
from comparisons.mitsuba.files import Files, Losses, UnwritableError
from reference_rt import materials
from reference_rt.core.arrays import FloatArray
from reference_rt.core.exr import write_exr
from reference_rt.core.vec3 import Vec3, luminance
from reference_rt.textures import Bitmap, Checker

Params = dict[str, Any]
"""By type and name, such as "rgb L": a bool, a number, a string, or several of them."""


def words(
    directive: str, *names: str, params: Params | None = None, numbers: Iterable[float] = ()
) -> str:
    """A directive with its names or numbers, and its parameters."""
    found = [directive, *map(_word, (*names, *numbers))]
    for key, value in (params or {}).items():
        several = value if isinstance(value, tuple | list) else (value,)
        found += [f'"{key}"', "[", *map(_word, several), "]"]
    return " ".join(found)


def _word(value: Any) -> str:
    match value:
        case bool():
            return str(value).lower()
        case str():
            escaped = value.replace("\\", "\\\\").replace('"', '\\"')
            return f'"{escaped}"'
    return repr(value)


@dataclass
class Writing(Losses):
    """A scene being written.  lines: of textures and materials;  names: those that are taken, by
    the part that has each;  oriented: the names of materials that need texture coordinates;
    one_sided: materials that are black from behind."""

    files: Files
    target: str = field(default="pbrt-v4", kw_only=True)
    lines: list[str] = field(default_factory=list)
    names: dict[tuple[str, ...], str] = field(default_factory=dict)
    oriented: set[str] = field(default_factory=set)
    one_sided: set[str] = field(default_factory=set)

    def name_for(self, *part: str) -> str:
        """A name for a part of the scene that is not taken: its last word without characters that
        need escapes."""
        plain = name = re.sub(r"[^\w .+-]", "_", part[-1]) or "_"
        number = 1
        while name in self.names.values():
            number += 1
            name = f"{plain}_{number}"
        self.names[part] = name
        return name

    # ---- materials ------------------------------------------------------------------------------

    def surface(self, name: str | None) -> tuple[str, tuple[float, ...] | None]:
        """The name of a shape's material in the file, and the radiance that its front emits."""
        material = None if name is None else self.scene.materials[name]
        if not isinstance(material, materials.Emissive):
            return self.material(name), None
        base = self.black() if material.base is None else self.material(material.base)
        if isinstance(material.radiance, str):
            with self.collected("materials", str(name)):
                raise UnwritableError("a textured radiance")
            return base, (0.0, 0.0, 0.0)
        return base, material.radiance

    def material(self, name: str | None, both_sides: bool = False) -> str:
        """The name of a material in the file, which it is written to when it is first used."""
        material = materials.Diffuse() if name is None else self.scene.materials[name]
        path = ("materials", "default" if name is None else name)
        if isinstance(material, materials.TwoSided):
            if material.back not in (None, material.base):
                with self.collected(*path):
                    raise UnwritableError("another material behind than in front")
            return self.material(material.base, True)
        if isinstance(material, ONE_SIDED) and not both_sides:
            self.one_sided.add(path[1])
        if path not in self.names:
            params = BLACK
            with self.collected(*path):
                params = self._params(material, both_sides)
            self.define(params, *path)
        return self.names[path]

    def define(self, params: Params, *part: str) -> str:
        """Write a material; its name."""
        name = self.name_for(*part)
        oriented = any(k.startswith("texture ") or k in ALONG for k in params)
        if oriented or self.oriented.intersection(params.get("string materials", ())):
            self.oriented.add(name)
        self.lines.append(words("MakeNamedMaterial", name, params=params))
        return name

    def black(self) -> str:
        return self.names.get(("", "black")) or self.define(BLACK, "", "black")

    def _params(self, material: Any, both_sides: bool) -> Params:
        """pbrt's parameters of a material.  Blends are pbrt's random choices at each point, by the
        weight: the mean is the same."""
        match material:
            case materials.Diffuse():
                colour = self.parameter("rgb", "reflectance", material.reflectance)
                return {"string type": "diffuse", **colour}
            case materials.Mirror():
                metal = {"rgb eta": (1.0, 1.0, 1.0), "rgb k": (MIRROR, MIRROR, MIRROR)}
                return self._metal(metal, material)
            case materials.Conductor():
                return self._metal({"rgb eta": material.eta, "rgb k": material.k}, material)
            case materials.RoughConductor():
                metal = {"rgb eta": material.eta, "rgb k": material.k}
                return self._metal({**metal, **self._roughness(material)}, material)
            case materials.Dielectric():
                return {"string type": "dielectric", **_index(material)}
            case materials.ThinDielectric():
                return {"string type": "thindielectric", **_index(material)}
            case materials.RoughDielectric():
                rough = self._roughness(material)
                return {"string type": "dielectric", **_index(material), **rough}
            case materials.Blend():
                pair = (material.first, material.second)
                names = tuple(self.material(name, both_sides) for name in pair)
                amount = self.parameter("float", "amount", material.weight)
                return {"string type": "mix", "string materials": names, **amount}
        raise UnwritableError(f"a material '{material.type}'")

    def _metal(self, params: Params, material: Any) -> Params:
        """A metal times its reflectance, as a mixture with black."""
        metal, share = {"string type": "conductor", **params}, material.reflectance
        if isinstance(share, str) or len(set(share)) > 1:
            raise UnwritableError("a metal or mirror times a colour or a texture")
        if share[0] == 1.0:
            return metal
        pair = (self.black(), self.define(metal, "", f"{material.type} whole"))
        return {"string type": "mix", "string materials": pair, "float amount": share[0]}

    def _roughness(self, material: Any) -> Params:
        if material.distribution != "ggx":
            raise UnwritableError(f"microfacets '{material.distribution}'")
        self.note("pbrt's masking of microfacets is height-correlated: brighter at grazing angles")
        if material.oriented:
            found = dict(zip(ALONG, material.alpha, strict=True))
        else:
            alpha = material.alpha if isinstance(material.alpha, str) else material.alpha[0]
            found = self.parameter("float", "roughness", alpha)
        return {**found, "bool remaproughness": False}

    # ---- textures -------------------------------------------------------------------------------

    def parameter(self, kind: str, key: str, value: Any) -> Params:
        """A parameter that is a value or the name of a texture.  kind: "rgb" or "float"."""
        if isinstance(value, str):
            return {f"texture {key}": self.texture(value, kind)}
        return {f"{kind} {key}": value}

    def texture(self, name: str, kind: str) -> str:
        """The name of a texture in the file.  kind: "rgb", or "float" for its luminance."""
        part = ("textures", kind, name)
        if part not in self.names:
            plugin, params = "constant", Params()
            with self.collected("textures", name):
                plugin, params = self._texture(name, kind)
            names = (self.name_for(*part), "spectrum" if kind == "rgb" else kind, plugin)
            self.lines.append(words("Texture", *names, params=params))
        return self.names[part]

    def _texture(self, name: str, kind: str) -> tuple[str, Params]:
        """pbrt's name and parameters of a texture."""
        texture = self.scene.textures[name]
        match texture:
            case Checker():  # pbrt's fields have side 1, ours 1/2
                pair: tuple[Any, ...] = (texture.first, texture.second)
                if kind == "float":
                    pair = tuple(float(luminance(Vec3(*colour))) for colour in pair)
                colours = {f"{kind} tex{k}": value for k, value in enumerate(pair, 1)}
                return "checkerboard", {**_uv(texture, 2.0), **colours}
            case Bitmap(cutoff=None) if texture.wraps in (("repeat",) * 2, ("clamp",) * 2):
                read = partial(texture.read, self.scene.folder)
                texels = np.asarray(self.read(read, "textures", name).linear)
                if kind == "float":  # pbrt takes the mean of the channels
                    grey = np.asarray(luminance(Vec3(*np.moveaxis(texels, -1, 0))))
                    texels = np.repeat(grey[..., None], 3, axis=-1)
                look = {
                    "string filename": self.image("texture", texels),
                    "string filter": {"bilinear": "bilinear", "nearest": "point"}[texture.filter],
                    "string wrap": texture.wraps[0],
                }
                return "imagemap", {**_uv(texture, 1.0), **look}
            case Bitmap():
                raise UnwritableError("a bitmap with 'wrap: mirror', two wraps or a cutoff")
        raise UnwritableError(f"a texture '{texture.type}'")

    def image(self, stem: str, texels: FloatArray) -> str:
        """The name of an image file of linear values (h, w, 3)."""
        planes = dict(zip("RGB", np.moveaxis(texels, -1, 0), strict=True))
        return self.files.write(f"{stem}.exr", lambda file: write_exr(file, planes, {}))


BLACK = {"string type": "diffuse", "rgb reflectance": (0.0, 0.0, 0.0)}

ONE_SIDED = (
    materials.Diffuse,
    materials.Mirror,
    materials.Conductor,
    materials.RoughConductor,
)
"""Materials that are black from behind, and not so in pbrt."""

ALONG = ("float uroughness", "float vroughness")

MIRROR = 1e4
"""Extinction of the metal that stands for a mirror, which pbrt lacks: its index is 1, so that it
loses 4 / MIRROR² of the light, and not more than that over the cosine at grazing angles."""


def _index(material: Any) -> Params:
    for name in ("reflectance", "transmittance"):
        if getattr(material, name) != (1.0, 1.0, 1.0):
            raise UnwritableError(f"a {name} other than 1")
    return {"float eta": material.interior_ior / material.exterior_ior}


def _uv(texture: Any, factor: float) -> Params:
    (a, b, c), (d, e, f), _ = (factor * affine.of_uv(texture.uv)).tolist()
    if b != 0.0 or d != 0.0:
        raise UnwritableError("a uv map that turns or shears")
    return {"float uscale": a, "float vscale": e, "float udelta": c, "float vdelta": f}
