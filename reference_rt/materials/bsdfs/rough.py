"""What rough conductors and rough dielectrics share: the parameters of their microfacets."""

from typing import ClassVar

from reference_rt.materials.material import Material
from reference_rt.materials.microfacet.ggx_and_smith import AlphaParameter, Distribution


class Rough(Material):
    """A boundary of microfacets."""

    smooth: ClassVar[bool] = True
    distribution: Distribution = "ggx"
    alpha: AlphaParameter = (0.1, 0.1)

    @property
    def oriented(self) -> bool:
        return not isinstance(self.alpha, str) and self.alpha[0] != self.alpha[1]
