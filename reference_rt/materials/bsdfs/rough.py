"""What rough conductors and rough dielectrics share: the parameters of their microfacets."""

from typing import ClassVar

from reference_rt.materials.material import Material
from reference_rt.materials.microfacet.ggx_and_smith import AlphaParameter, Distribution


class Rough(Material):
    """A boundary of microfacets."""

    smooth: ClassVar[bool] = True
    distribution: Distribution = "ggx"
    """The distribution of microfacet normals: GGX (Trowbridge-Reitz) or Beckmann."""
    alpha: AlphaParameter = (0.1, 0.1)
    """Roughness: the root mean square slope for `beckmann`.  A number, two [along u, along v], or a
    texture; above 0, at most 10.  Below 1e-4 it counts as 1e-4."""

    @property
    def oriented(self) -> bool:
        return not isinstance(self.alpha, str) and self.alpha[0] != self.alpha[1]
