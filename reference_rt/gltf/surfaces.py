"""Materials, textures and images of a glTF file as ours; and `Reading`, the file and what is said
about it."""

import hashlib
import math
import os
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import platformdirs

from reference_rt.core.image_files import open_image
from reference_rt.gltf.document import Document, Image, Material, TextureInfo, TextureTransform
from reference_rt.materials import (
    AnyMaterial,
    Dielectric,
    Diffuse,
    Emissive,
    GltfPbr,
    Mask,
    NormalMap,
    RoughDielectric,
    ThinDielectric,
    TwoSided,
)
from reference_rt.media import AnyMedium, Homogeneous
from reference_rt.shapes.meshes.files.gltf import GltfFile, inline
from reference_rt.textures import AnyTexture, Bitmap, Product, VertexColours
from reference_rt.textures.image_file import Channel, Encoding
from reference_rt.textures.texture import UvMap
from reference_rt.util.errors import SceneError
from reference_rt.util.files import replacing

Colour = tuple[float, float, float]

WHITE = (1.0, 1.0, 1.0)

VERTICES = "vertex colours"
"""The name of the texture of vertex colours."""

_WRAPS = {33071: "clamp", 33648: "mirror", 10497: "repeat"}
_FILTERS = {9728: "nearest", 9729: "bilinear"}
_SUFFIXES = ((b"\x89PNG", ".png"), (b"\xff\xd8", ".jpg"), (b"RIFF", ".webp"))


@dataclass
class Reading:
    """A file that is being read.  notes: what is read otherwise;  missing: what our scenes lack;
    both with their places, each once."""

    path: Path
    document: Document
    file: GltfFile
    notes: dict[str, None] = field(default_factory=dict)
    missing: dict[str, None] = field(default_factory=dict)

    def note(self, text: str) -> None:
        self.notes[text] = None

    def lack(self, text: str) -> None:
        self.missing[text] = None

    def one(self, kind: str, index: int) -> Any:
        """An object of one of the document's lists, such as "materials"."""
        found = getattr(self.document, kind)
        if index >= len(found):
            raise self.error(f"there is no {kind}[{index}]; expected one of {len(found)}")
        return found[index]

    def error(self, message: str) -> SceneError:
        return SceneError(message, file=str(self.path))


class Surface(NamedTuple):
    """name: of our material;  emits: whether it is a lamp;  is_bright: one of more than 1, which is
    meant to light others;  is_clear: whether opacity is less than 1 anywhere;  tilt: the name of
    its normal map, None for none;  medium: that of the medium behind it, likewise."""

    name: str
    emits: bool
    is_bright: bool
    is_clear: bool
    tilt: str | None
    medium: str | None = None


class Surfaces:
    """The materials of a file as ours.  `textures`, `materials` and `media` are those of the
    scene."""

    def __init__(self, reading: Reading) -> None:
        self.reading = reading
        self.textures: dict[str, AnyTexture] = {}
        self.materials: dict[str, AnyMaterial] = {}
        self.media: dict[str, AnyMedium] = {}
        self._made: dict[tuple[int | None, bool], Surface] = {}
        self._named: dict[str, str] = {}
        self._files: dict[int, str] = {}

    def uv_sets(self, index: int | None) -> list[int]:
        """The numbers of the texture coordinates that a material uses, the mesh's own first."""
        found = _infos(self._material(index))
        return [*dict.fromkeys(info.uv_set for info in found)]

    def _material(self, index: int | None) -> Material:
        if index is None:
            return Material(name="default")
        found: Material = self.reading.one("materials", index)
        return found

    def surface(self, index: int | None, coloured: bool) -> Surface:
        """A material, None for the default one;  coloured: for a primitive with vertex colours."""
        key = index, coloured
        if key not in self._made:
            self._made[key] = self._make(index, coloured)
        return self._made[key]

    def _make(self, index: int | None, coloured: bool) -> Surface:
        material = self._material(index)
        where = f"materials[{index}]"
        sets = self.uv_sets(index)

        def image(info: TextureInfo | None, **fields: Any) -> str | None:
            if info is None:
                return None
            return self.bitmap(info, uv_set=sets.index(info.uv_set), **fields)

        def number(info: TextureInfo | None, factor: float, channel: Channel) -> float | str:
            name = image(info, channel=channel, scale=factor) if factor > 0.0 else None
            return factor if name is None else name

        pbr, more = material.pbr_metallic_roughness, material.extensions
        if more.transmission.transmission_factor > 0.0:
            glass = self._glass(material, where, coloured)
            if glass is not None:
                # Glass has no other side than its own.
                one_sided = material.model_copy(update={"double_sided": False})
                found = self._nested(one_sided, index, glass, 1.0, ([], (0.0, 0.0, 0.0)), image)
                return found._replace(medium=self._medium(material, found.name))
        parts = [image(pbr.base_color_texture, encoding="srgb"), self._vertices(coloured)]
        factor = pbr.base_color_factor[:3]
        opacity = _opacity(material, image, number)
        if more.unlit is None:
            colour = self.product(parts, factor)
            leaf: AnyMaterial = GltfPbr(
                base_color=colour,
                metallic=number(pbr.metallic_roughness_texture, pbr.metallic_factor, "blue"),
                roughness=number(pbr.metallic_roughness_texture, pbr.roughness_factor, "green"),
                ior=more.ior.ior,
                specular=number(
                    more.specular.specular_texture, more.specular.specular_factor, "alpha"
                ),
                specular_color=self.product(
                    [image(more.specular.specular_color_texture, encoding="srgb")],
                    more.specular.specular_color_factor,
                ),
            )
            parts = [image(material.emissive_texture, encoding="srgb")]
            strength = more.emissive_strength.emissive_strength
            factor = [x * strength for x in material.emissive_factor]
        else:
            leaf = Diffuse(reflectance=(0.0, 0.0, 0.0))
            self.reading.note(
                f"{where} is unlit: it emits its colour, which lights other surfaces, too"
            )
        if material.occlusion_texture is not None:
            self.reading.note("occlusion textures are ignored: the shapes themselves occlude light")
        return self._nested(material, index, leaf, opacity, (parts, factor), image)

    def _glass(self, material: Material, where: str, coloured: bool) -> AnyMaterial | None:
        """The glass of a material that transmits all light; None, and a word, for others.

        KHR_materials_transmission and KHR_materials_volume: with a thickness the surface is the
        boundary of a body, which light enters by refraction, else a thin sheet.
        """
        pbr, more = material.pbr_metallic_roughness, material.extensions
        ior, alpha = more.ior.ior, pbr.roughness_factor * pbr.roughness_factor
        is_thin = more.volume.thickness_factor == 0.0
        reasons = {
            "less than all light": more.transmission.transmission_factor < 1.0,
            "light by a texture": more.transmission.transmission_texture is not None,
            "tinted light": pbr.base_color_factor[:3] != [1.0] * 3
            or pbr.base_color_texture is not None
            or coloured,
            "light beside a metal": pbr.metallic_factor > 0.0,
            "light with a roughness by a texture": pbr.metallic_roughness_texture is not None,
            "light that it emits": max(material.emissive_factor) > 0.0,
            "light by a specular factor": more.specular.specular_factor != 1.0
            or more.specular.specular_color_factor != [1.0] * 3,
            "light with opacity": material.alpha_mode != "OPAQUE",
            "light through a thin and rough sheet": is_thin and alpha > 0.0,
            "light with an index of at most 1": ior <= 1.0,
        }
        for what, is_so in reasons.items():
            if is_so:
                self.reading.lack(f"{where} transmits {what}; expected clear white glass")
                return None
        if is_thin:
            return ThinDielectric(interior_ior=ior)
        if alpha == 0.0:
            return Dielectric(interior_ior=ior, exterior_ior=1.0)
        return RoughDielectric(interior_ior=ior, exterior_ior=1.0, alpha=(alpha, alpha))

    def _medium(self, material: Material, name: str) -> str | None:
        """The name of the medium in a glass: what is left after the attenuation's distance is its
        colour; None where nothing is lost."""
        volume = material.extensions.volume
        distance, colour = volume.attenuation_distance, volume.attenuation_color
        if volume.thickness_factor == 0.0 or distance is None or min(colour) == 1.0:
            return None
        # Of black nothing is left: exp(-700) is as near to that as float64's numbers.
        sigma = [min(-math.log(c), 700.0) if c > 0.0 else 700.0 for c in colour]
        r, g, b = (s / distance for s in sigma)
        self.media[name] = Homogeneous(sigma_t=(r, g, b), albedo=(0.0, 0.0, 0.0))
        return name

    def _nested(
        self,
        material: Material,
        index: int | None,
        leaf: AnyMaterial,
        opacity: float | str,
        emission: tuple[list[str | None], Sequence[float]],
        image: Callable[..., str | None],
    ) -> Surface:
        """The material around a leaf: both sides, then the tilted normal, which FACE_VIEWER turns
        as a whole, then the mask, then what it emits."""
        name = _unused(material.name or f"material {index}", self.materials)
        wrappers: list[Callable[[str], AnyMaterial]] = []
        parts, factor = emission
        emits = max(factor) > 0.0
        if material.double_sided:
            wrappers.append(lambda base: TwoSided(base=base))
            if emits:
                self.reading.note(
                    f"materials[{index}] emits, and has two sides: it emits from its front only"
                )
        tilt = material.normal_texture
        if tilt is not None and (normals := image(tilt)) is not None:
            wrappers.append(
                lambda base: NormalMap(base=base, normals=normals, scale=tilt.scale, follow_v=True)
            )
        if opacity != 1.0:
            wrappers.append(lambda base: Mask(base=base, opacity=opacity))
        if emits:
            if isinstance(opacity, str):
                parts = [*parts, opacity]
            else:
                factor = [x * opacity for x in factor]
            radiance = self.product(parts, factor)
            wrappers.append(lambda base: Emissive(radiance=radiance, base=base))
        made, tilted = leaf, None
        for k, wrap in enumerate(wrappers):
            inner = _unused(f"{name} ({made.type}{k or ''})", self.materials)
            self.materials[inner] = made
            tilted = inner if isinstance(made, NormalMap) else tilted
            made = wrap(inner)
        self.materials[name] = made
        tilted = name if isinstance(made, NormalMap) else tilted
        return Surface(name, emits, max(factor) > 1.0, opacity != 1.0, tilted)

    def follow_v(self, names: Iterable[str]) -> None:
        """Let only these normal maps follow v: without mirrored coordinates it makes no difference,
        and other renderers have nothing like it."""
        for name, material in self.materials.items():
            if isinstance(material, NormalMap) and name not in names:
                self.materials[name] = material.model_copy(update={"follow_v": False})

    # ---- textures -------------------------------------------------------------------------------

    def _vertices(self, coloured: bool) -> str | None:
        if not coloured:
            return None
        self.textures[VERTICES] = VertexColours(without=WHITE)
        return VERTICES

    def product(self, parts: Iterable[str | None], factor: Sequence[float]) -> Colour | str:
        """The product of textures, None for none, and a colour: a colour, or a texture's name."""
        of = tuple(part for part in parts if part is not None)
        r, g, b = factor
        if not of or max(factor) == 0.0:
            return r, g, b
        if len(of) == 1 and (r, g, b) == WHITE:
            return of[0]
        return self._texture(" x ".join(of), Product(of=of, factor=(r, g, b)))

    def _texture(self, name: str, texture: AnyTexture) -> str:
        """The name of a texture, which is there once."""
        key = texture.model_dump_json()
        if key not in self._named:
            self._named[key] = _unused(name, self.textures)
            self.textures[self._named[key]] = texture
        return self._named[key]

    def bitmap(
        self,
        info: TextureInfo,
        channel: Channel = "all",
        encoding: Encoding = "raw",
        scale: float = 1.0,
        cutoff: float | None = None,
        uv_set: int = 0,
    ) -> str | None:
        """The name of an image as a texture; None for none: without a source, or for the opacity of
        an opaque image.  uv_set: its place among the sets of texture coordinates of our mesh."""
        reading = self.reading
        texture = reading.one("textures", info.index)
        webp = texture.extensions.webp
        source = texture.source if webp is None else webp.source
        if source is None:
            reading.lack(f"textures[{info.index}] has no source; expected an image")
            return None
        file = self.image_file(source)
        if channel == "alpha":
            with suppress(ValueError, OSError):  # reading it as a texture tells
                if not open_image(self.reading.path.parent / file).has_opacity:
                    return None
        image: Image = reading.one("images", source)
        name = image.name or f"image {source}"
        fields: dict[str, Any] = {}
        if texture.sampler is not None:
            sampler = reading.one("samplers", texture.sampler)
            along_u, along_v = _WRAPS[sampler.wrap_s], _WRAPS[sampler.wrap_t]
            fields["wrap"] = along_u if along_u == along_v else (along_u, along_v)
            fields["filter"] = _FILTERS[sampler.mag_filter]
        if info.extensions.transform is not None:
            fields["uv"] = _uv_map(info.extensions.transform)
        if uv_set:
            fields["uv_set"] = uv_set
        return self._texture(
            name if channel == "all" else f"{name}, {channel}",
            Bitmap(
                file=file, channel=channel, encoding=encoding, scale=scale, cutoff=cutoff, **fields
            ),
        )

    def image_file(self, index: int) -> str:
        """The name of the file that has an image: of one within this file, a file in the cache."""
        if index not in self._files:
            image: Image = self.reading.one("images", index)
            name = f"images[{index}]"
            data = None
            if image.uri is None:
                if image.buffer_view is None:
                    raise self.reading.error(f"{name} has no data; expected 'uri' or 'bufferView'")
                data = self.reading.file.view(image.buffer_view)
            else:
                data = inline(image.uri)
            if data is not None:
                self._files[index] = str(_cached(data))
            else:
                assert image.uri is not None
                path = self.reading.file.located(image.uri, name)
                self._files[index] = str(path.relative_to(self.reading.path.parent.resolve()))
        return self._files[index]


def _cached(data: bytes) -> Path:
    """A file of the cache with this content."""
    root = os.environ.get("REFERENCE_RT_CACHE") or platformdirs.user_cache_dir("reference_rt")
    suffix = next((suffix for start, suffix in _SUFFIXES if data.startswith(start)), "")
    path = Path(root) / "images" / f"{hashlib.sha256(data).hexdigest()[:32]}{suffix}"
    if not (path.is_file() and path.read_bytes() == data):  # a cache is not trusted
        with replacing(path) as temporary:
            temporary.write_bytes(data)
    return path.resolve()


def _infos(material: Material) -> Iterable[TextureInfo]:
    """The textures of a material that are used.  The first one's coordinates are the mesh's: of a
    normal map, whose tangents they are."""
    pbr, specular = material.pbr_metallic_roughness, material.extensions.specular
    found = [pbr.base_color_texture]
    if material.extensions.unlit is None:
        found = [material.normal_texture, *found]
        found += [pbr.metallic_roughness_texture, material.emissive_texture]
        found += [specular.specular_texture, specular.specular_color_texture]
    return (info for info in found if info is not None)


def _opacity(
    material: Material,
    image: Callable[..., str | None],
    number: Callable[[TextureInfo | None, float, Channel], float | str],
) -> float | str:
    """The opacity of a material: a number, or a texture's name."""
    pbr = material.pbr_metallic_roughness
    alpha, cutoff = pbr.base_color_factor[3], material.alpha_cutoff
    if material.alpha_mode == "BLEND":
        return number(pbr.base_color_texture, alpha, "alpha")
    if material.alpha_mode == "OPAQUE" or cutoff == 0.0:
        return 1.0
    if alpha < cutoff:
        return 0.0
    name = image(pbr.base_color_texture, channel="alpha", scale=alpha, cutoff=cutoff)
    return 1.0 if name is None else name


def _uv_map(transform: TextureTransform) -> UvMap:
    """KHR_texture_transform, whose v counts from the top, for ours, which counts from the bottom.

    It turns uv counter-clockwise as an image shows them, v down, as the extension's text and its
    model TextureTransformTest say; its GLSL, read by columns, turns them the other way.
    """
    (a, b), (du, dv), turn = transform.scale, transform.offset, transform.rotation
    c, s = math.cos(turn), math.sin(turn)
    theirs = np.array([[a * c, b * s, du], [-a * s, b * c, dv], [0.0, 0.0, 1.0]])
    flip = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 1.0], [0.0, 0.0, 1.0]])
    ours = flip @ theirs @ flip
    if np.array_equal(ours, np.eye(3)):
        return UvMap()
    return UvMap(matrix=ours[:2].tolist())


def _unused(name: str, taken: dict[str, Any]) -> str:
    """The name, or one after it, that is not taken."""
    found, number = name, 1
    while found in taken:
        number += 1
        found = f"{name} {number}"
    return found
