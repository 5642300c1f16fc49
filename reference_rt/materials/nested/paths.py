"""The paths through the material graph, from a material made of others to its BSDF leaves.

A path has steps, each of which multiplies the leaf's weight or replaces its frame.  The tables and
kernels are in `nested/flattened.py`.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

from reference_rt.materials.bsdfs.phong import Phong
from reference_rt.materials.material import Emissive, Material
from reference_rt.materials.nested.tilted import Bump, NormalMap
from reference_rt.materials.nested.wrappers import Blend, Mask, TwoSided, Wrapper
from reference_rt.materials.none import NoSurface
from reference_rt.textures import Palette

# Codes of steps.  WEIGHT, ONE_MINUS_WEIGHT: times w, 1 - w, for a number w of `weights`;
# FRONT_ONLY, BACK_ONLY: times 0 when seen from the other side; FACE_VIEWER: the frame flipped to
# the viewer's side; BUMP, NORMAL_MAP: the frame tilted.
WEIGHT, ONE_MINUS_WEIGHT, FRONT_ONLY, BACK_ONLY, FACE_VIEWER, BUMP, NORMAL_MAP = range(7)

MOST_LEAVES = 64
"""The most leaves of a material: a blend of blends doubles them at each level."""


class Step(NamedTuple):
    """A step of a path: its code and the parameter as described, None for none."""

    code: int
    parameter: Any


class MaterialPath(NamedTuple):
    """A path: its steps and the name of its leaf, None for the clear part of a mask."""

    steps: tuple[Step, ...]
    leaf: str | None

    @property
    def turns(self) -> bool:
        """Whether the leaf may be visible from behind too."""
        return any(step.code in (FACE_VIEWER, BACK_ONLY) for step in self.steps)


def material_paths(name: str, materials: Mapping[str, Material]) -> list[MaterialPath]:
    """The paths from a material to its leaves.  Raises ValueError (what is wrong, what was
    expected)."""
    return _material_paths(name, materials, ())


def _material_paths(
    name: str, materials: Mapping[str, Material], above: tuple[str, ...]
) -> list[MaterialPath]:
    if name in above:
        raise ValueError(f"contains itself: {' -> '.join([*above, name])}; expected no circle")
    above = (*above, name)
    if len(above) > MOST_LEAVES:
        raise ValueError(f"is nested too deeply; expected at most {MOST_LEAVES} materials")
    material = materials[name]

    def below(base: str, *steps: Step) -> list[MaterialPath]:
        return [
            MaterialPath((*steps, *path.steps), path.leaf)
            for path in _material_paths(base, materials, above)
        ]

    found = [MaterialPath((), name)]
    if isinstance(material, Mask):
        clear = MaterialPath((Step(ONE_MINUS_WEIGHT, material.opacity),), None)
        found = [*below(material.base, Step(WEIGHT, material.opacity)), clear]
    elif isinstance(material, Blend):
        rest, take = (
            Step(ONE_MINUS_WEIGHT, material.weight),
            Step(WEIGHT, material.weight),
        )
        found = [*below(material.first, rest), *below(material.second, take)]
    elif isinstance(material, TwoSided):
        found = below(
            material.base, Step(FACE_VIEWER if material.back is None else FRONT_ONLY, None)
        )
        _check_one_sided(material.base, found, materials)
        if material.back is not None:
            behind = below(material.back, Step(BACK_ONLY, None), Step(FACE_VIEWER, None))
            _check_one_sided(material.back, behind, materials)
            found += behind
    elif isinstance(material, Bump | NormalMap):
        code = BUMP if isinstance(material, Bump) else NORMAL_MAP
        found = below(material.base, Step(code, material))
        if any(sum(s.code in (BUMP, NORMAL_MAP) for s in path.steps) > 1 for path in found):
            raise ValueError(f"'{material.base}' is tilted already; expected one map at most")
    if len(found) > MOST_LEAVES:
        raise ValueError(f"'{name}' has {len(found)} layers; expected at most {MOST_LEAVES}")
    return found


def _check_one_sided(
    name: str, found: list[MaterialPath], materials: Mapping[str, Material]
) -> None:
    if any(transmits(path, materials) for path in found):
        raise ValueError(
            f"'{name}' lets light pass; expected materials with one side to make two of"
        )


def transmits(path: MaterialPath, materials: Mapping[str, Material]) -> bool:
    """Whether the leaf lets light pass."""
    return path.leaf is None or materials[path.leaf].transmits


class Traits(NamedTuple):
    """Of a material: the columns of `Materials` of these names."""

    smooth: bool
    uses_u_lobe: bool
    behind: bool
    oriented: bool


def traits(paths: list[MaterialPath], materials: Mapping[str, Material]) -> Traits:
    """What the material with these paths is like."""
    leaves = [materials[path.leaf] for path in paths if path.leaf is not None]
    tilted = any(step.code in (BUMP, NORMAL_MAP) for path in paths for step in path.steps)
    return Traits(
        any(leaf.smooth for leaf in leaves),
        len(paths) > 1 or any(leaf.uses_u_lobe for leaf in leaves),
        any(transmits(path, materials) or path.turns for path in paths),
        tilted or any(leaf.oriented for leaf in leaves),
    )


def check_energy(
    paths: list[MaterialPath], materials: Mapping[str, Material], palette: Palette
) -> None:
    """Raise ValueError for a Phong material that reflects more light than arrives, which path
    tracing cannot render."""
    for path in paths:
        leaf = materials[path.leaf] if path.leaf is not None else None
        if isinstance(leaf, Phong) and leaf.energy_bound(palette) > 1.0:
            raise ValueError(
                f"creates energy: up to {leaf.energy_bound(palette):.4g} of the light comes back; "
                "expected at most 1 for path tracing, or the integrator 'whitted'"
            )


def scattering_of(name: str, materials: Mapping[str, Material]) -> str | None:
    """The name of the material with the BSDF: an emissive one's base; None without a base, and for
    what is no surface."""
    material = materials[name]
    if isinstance(material, NoSurface):
        return None
    return material.base if isinstance(material, Emissive) else name


def colour_of(name: str, materials: Mapping[str, Material]) -> tuple[float, float, float] | str:
    """The colour of a material as it is shown; of a nested one, that of its first base."""
    material = materials[name]
    while isinstance(material, Wrapper):
        material = materials[getattr(material, material.bases[0])]
    return material.colour
