"""The JSON of a glTF 2.0 file as far as scenes use it: types, ranges and defaults, checked by
pydantic.  Accessors, views and buffers are checked where they are read, in `shapes.meshes.files`.

Keys that are not named here are ignored, as the specification asks for.
"""

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field
from pydantic.alias_generators import to_camel

from reference_rt.shapes.meshes.files.gltf_compression import DRACO, MESHOPT

Index = Annotated[int, Field(ge=0)]
Unit = Annotated[float, Field(ge=0, le=1)]
NotNegative = Annotated[float, Field(ge=0)]
Above0 = Annotated[float, Field(gt=0)]
Pair = Annotated[list[float], Field(min_length=2, max_length=2)]
UnitColour = Annotated[list[Unit], Field(min_length=3, max_length=3)]


class Part(BaseModel):
    """Any object of the JSON."""

    model_config = ConfigDict(
        alias_generator=to_camel, extra="ignore", frozen=True, strict=True, allow_inf_nan=False
    )


# ---- textures ------------------------------------------------------------------------------------


class TextureTransform(Part):
    offset: Pair = [0.0, 0.0]
    rotation: float = 0.0
    scale: Pair = [1.0, 1.0]
    tex_coord: Index | None = None


class InfoExtensions(Part):
    transform: TextureTransform | None = Field(None, alias="KHR_texture_transform")


class TextureInfo(Part):
    index: Index
    tex_coord: Index = 0
    scale: float = 1.0  # of normal maps alone
    extensions: InfoExtensions = InfoExtensions()

    @property
    def uv_set(self) -> int:
        """The number of the texture coordinates that are used."""
        transform = self.extensions.transform
        own = None if transform is None else transform.tex_coord
        return self.tex_coord if own is None else own


class WebpSource(Part):
    source: Index


class TextureExtensions(Part):
    webp: WebpSource | None = Field(None, alias="EXT_texture_webp")


class Texture(Part):
    sampler: Index | None = None
    source: Index | None = None
    extensions: TextureExtensions = TextureExtensions()


class Sampler(Part):
    mag_filter: Literal[9728, 9729] = 9729
    wrap_s: Literal[33071, 33648, 10497] = 10497
    wrap_t: Literal[33071, 33648, 10497] = 10497


class Image(Part):
    name: str = ""
    uri: str | None = None
    buffer_view: Index | None = None


# ---- materials -----------------------------------------------------------------------------------


class MetallicRoughness(Part):
    base_color_factor: Annotated[list[Unit], Field(min_length=4, max_length=4)] = [1.0] * 4
    base_color_texture: TextureInfo | None = None
    metallic_factor: Unit = 1.0
    roughness_factor: Unit = 1.0
    metallic_roughness_texture: TextureInfo | None = None


class EmissiveStrength(Part):
    emissive_strength: NotNegative = 1.0


class Ior(Part):
    ior: NotNegative = 1.5


class Specular(Part):
    specular_factor: Unit = 1.0
    specular_texture: TextureInfo | None = None
    specular_color_factor: UnitColour = [1.0] * 3
    specular_color_texture: TextureInfo | None = None


class Transmission(Part):
    transmission_factor: Unit = 0.0
    transmission_texture: TextureInfo | None = None


class Volume(Part):
    thickness_factor: NotNegative = 0.0
    attenuation_distance: Annotated[float, Field(gt=0)] | None = None
    attenuation_color: UnitColour = [1.0] * 3


class MaterialExtensions(Part):
    emissive_strength: EmissiveStrength = Field(
        EmissiveStrength(), alias="KHR_materials_emissive_strength"
    )
    ior: Ior = Field(Ior(), alias="KHR_materials_ior")
    specular: Specular = Field(Specular(), alias="KHR_materials_specular")
    transmission: Transmission = Field(Transmission(), alias="KHR_materials_transmission")
    unlit: dict[str, Any] | None = Field(None, alias="KHR_materials_unlit")
    volume: Volume = Field(Volume(), alias="KHR_materials_volume")


class Material(Part):
    name: str = ""
    pbr_metallic_roughness: MetallicRoughness = MetallicRoughness()
    normal_texture: TextureInfo | None = None
    occlusion_texture: dict[str, Any] | None = None
    emissive_texture: TextureInfo | None = None
    emissive_factor: UnitColour = [0.0] * 3
    alpha_mode: Literal["OPAQUE", "MASK", "BLEND"] = "OPAQUE"
    alpha_cutoff: NotNegative = 0.5
    double_sided: bool = False
    extensions: MaterialExtensions = MaterialExtensions()


# ---- scenes --------------------------------------------------------------------------------------


class PerspectiveView(Part):
    aspect_ratio: Above0 | None = None
    yfov: Annotated[float, Field(gt=0, lt=3.141592653589793)]
    znear: Above0
    zfar: Above0 | None = None


class OrthographicView(Part):
    xmag: float
    ymag: float
    znear: NotNegative
    zfar: Above0


class Camera(Part):
    name: str = ""
    perspective: PerspectiveView | None = None
    orthographic: OrthographicView | None = None


class Cone(Part):
    inner_cone_angle: NotNegative = 0.0
    outer_cone_angle: Annotated[float, Field(gt=0, le=1.5707963267948966)] = 0.7853981633974483


class Light(Part):
    name: str = ""
    type: Literal["point", "spot", "directional"]
    color: UnitColour = [1.0] * 3
    intensity: NotNegative = 1.0
    range: Above0 | None = None
    spot: Cone = Cone()


class Primitive(Part):
    attributes: dict[str, Index]
    material: Index | None = None
    mode: Annotated[int, Field(ge=0, le=6)] = 4
    targets: list[Any] = []


class Mesh(Part):
    name: str = ""
    primitives: Annotated[list[Primitive], Field(min_length=1)]


class LightOfNode(Part):
    light: Index


class Instancing(Part):
    attributes: dict[str, Index]


class NodeExtensions(Part):
    light: LightOfNode | None = Field(None, alias="KHR_lights_punctual")
    instancing: Instancing | None = Field(None, alias="EXT_mesh_gpu_instancing")


class Node(Part):
    name: str = ""
    mesh: Index | None = None
    camera: Index | None = None
    skin: Index | None = None
    extensions: NodeExtensions = NodeExtensions()


class Lights(Part):
    lights: list[Light] = []


class RootExtensions(Part):
    lights: Lights = Field(Lights(), alias="KHR_lights_punctual")


def _version(text: str) -> str:
    if text.partition(".")[0] != "2":
        raise ValueError("expected version 2.0 of glTF")
    return text


class Asset(Part):
    version: Annotated[str, AfterValidator(_version)]


class Document(Part):
    """The whole JSON."""

    asset: Asset
    scene: Index | None = None
    scenes: list[dict[str, Any]] = []
    nodes: list[Node] = []
    meshes: list[Mesh] = []
    cameras: list[Camera] = []
    materials: list[Material] = []
    textures: list[Texture] = []
    images: list[Image] = []
    samplers: list[Sampler] = []
    animations: list[Any] = []
    extensions: RootExtensions = RootExtensions()
    extensions_used: list[str] = []
    extensions_required: list[str] = []


READ = frozenset(
    (
        DRACO,
        *MESHOPT,
        "EXT_mesh_gpu_instancing",
        "EXT_texture_webp",
        "KHR_lights_punctual",
        "KHR_materials_emissive_strength",
        "KHR_materials_ior",
        "KHR_materials_specular",
        "KHR_materials_transmission",
        "KHR_materials_unlit",
        "KHR_materials_volume",
        "KHR_mesh_quantization",
        "KHR_texture_transform",
    )
)
"""The extensions that are read."""

HARMLESS = frozenset(
    (
        "EXT_mesh_features",
        "EXT_structural_metadata",
        "KHR_animation_pointer",
        "KHR_materials_variants",
        "KHR_xmp_json_ld",
    )
)
"""Extensions without which the file's own picture is the same."""
