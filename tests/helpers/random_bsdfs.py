"""Random descriptions of BSDFs, each with a direction wo for which it is checked."""

import numpy as np
from leaf_checks import random_direction

from reference_rt.materials.bsdfs.gltf_pbr import GltfPbr
from reference_rt.materials.bsdfs.phong import Phong
from reference_rt.materials.bsdfs.plastic import Plastic
from reference_rt.materials.bsdfs.principled import Principled
from reference_rt.materials.bsdfs.principled_thin import PrincipledThin
from reference_rt.materials.bsdfs.rough_plastic import RoughPlastic

NUMBERS = (
    *("roughness", "metallic", "spec_tint", "anisotropic", "sheen", "sheen_tint"),
    *("clearcoat", "clearcoat_gloss", "spec_trans", "flatness"),
)


def random_phong(n, seed):
    """(description, wo): both forms of highlight, exponents from 0.5 to 1000."""
    rng = np.random.default_rng(seed)
    for k in range(n):
        yield (
            Phong(
                diffuse=rng.uniform(0, 0.3, 3).tolist(),
                specular=rng.uniform(0, 3, 3).tolist(),
                mirror=(rng.uniform(0, 0.5, 3) * (k // 2 % 2)).tolist(),
                exponent=10.0 ** rng.uniform(-0.3, 3),
                half_vector=bool(k % 2),
            ),
            random_direction(rng, k),
        )


def random_plastic(n, seed):
    """(description, wo): every other one rough."""
    rng = np.random.default_rng(seed)
    for k in range(n):
        fields = {
            "reflectance": rng.uniform(0, 1, 3).tolist(),
            "specular": rng.uniform(0.1, 1, 3).tolist(),
            "interior_ior": float(rng.uniform(1.05, 2.5)),
            "nonlinear": bool(k // 2 % 2),
        }
        if k % 2 == 0:
            yield Plastic(**fields), random_direction(rng, k)
            continue
        fields["distribution"] = ("ggx", "beckmann")[k // 4 % 2]
        fields["alpha"] = 10.0 ** rng.uniform(-1.5, 0)
        yield RoughPlastic(**fields), random_direction(rng, k)


def random_principled(n, seed, least=0.2):
    """(description, wo): a third of the numbers 0 and a sixth 1; roughness from `least`; wo from
    behind, too, where light is transmitted."""
    rng = np.random.default_rng(seed)
    for k in range(n):
        fields = {name: float(np.clip(rng.uniform(-0.67, 1.33), 0, 1)) for name in NUMBERS}
        fields["roughness"] = rng.uniform(least, 1)
        fields["anisotropic"] *= 0.8
        fields["clearcoat_gloss"] *= 0.7
        if k % 2 == 0:
            fields["eta"] = float(rng.uniform(1.1, 2.5))
        if k % 11 == 10:
            fields["eta"] = 0.7
        wo = random_direction(rng, k, front=fields["spec_trans"] == 0 or fields["metallic"] == 1)
        yield Principled(base_colour=rng.uniform(0, 1, 3).tolist(), **fields), wo


THIN_NUMBERS = ("anisotropic", "spec_trans", "spec_tint", "sheen", "sheen_tint", "flatness")


def random_thin(n, seed, least=0.2):
    """(description, wo): a third of the numbers 0 and a sixth 1; roughness from `least`; wo from
    both sides."""
    rng = np.random.default_rng(seed)
    for k in range(n):
        fields = {name: float(np.clip(rng.uniform(-0.67, 1.33), 0, 1)) for name in THIN_NUMBERS}
        fields["roughness"] = rng.uniform(least, 1)
        fields["anisotropic"] *= 0.8
        fields["diff_trans"] = 2.0 * float(np.clip(rng.uniform(-0.67, 1.33), 0, 1))
        # Microfacets that transmit are (0.65 eta - 0.35) times as rough.
        fields["eta"] = float(rng.uniform(1.4, 2.5)) if k % 11 != 10 else 0.3
        wo = random_direction(rng, k, front=False)
        yield PrincipledThin(base_colour=rng.uniform(0, 1, 3).tolist(), **fields), wo


GLTF_NUMBERS = ("metallic", "specular")


def random_gltf(n, seed, least=0.1):
    """(description, wo): a third of the numbers 0 and a sixth 1; roughness from `least`."""
    rng = np.random.default_rng(seed)
    for k in range(n):
        fields = {name: float(np.clip(rng.uniform(-0.67, 1.33), 0, 1)) for name in GLTF_NUMBERS}
        fields["roughness"] = rng.uniform(least, 1)
        fields["ior"] = float(rng.uniform(1, 2.5))
        colours = {f: rng.uniform(0, 1, 3).tolist() for f in ("base_color", "specular_color")}
        yield GltfPbr(**fields, **colours), random_direction(rng, k)
