"""Thin principled materials."""

from comparisons.materials.material import Errors, Gltf, MaterialType
from comparisons.materials.principled import BASE, errors_of_shares, numbers
from comparisons.mitsuba.plugin_table import NUMBER, PluginTable, Row
from comparisons.renderers.vocabulary import Look
from reference_rt.materials import PrincipledThin

TABLE = PluginTable(
    "principledthin",
    (
        BASE,
        Row("eta", "eta", NUMBER, 1.5),
        *numbers("roughness", "anisotropic", "spec_trans", "spec_tint", "sheen", "sheen_tint"),
        *numbers("flatness", "diff_trans"),
    ),
    # How lobes are sampled does not change the picture.
    tuple(
        f"{lobe}_{way}_sampling_rate"
        for lobe in ("specular", "diffuse")
        for way in ("reflectance", "transmittance")
    ),
)

PRINCIPLED_THIN = MaterialType(
    description=PrincipledThin,
    table=TABLE,
    to_mitsuba=TABLE.write,
    from_mitsuba={"principledthin": TABLE.reader(PrincipledThin)},
    note=None,
    errors=Errors(errors_of_shares, lambda material: 0.0),
    to_cycles=None,
    to_gltf=Gltf(
        lambda material, name, writing: Look(material.base_colour, roughness=material.roughness),
        nearly="base colour and roughness alone",
    ),
    to_pbrt=None,
)
