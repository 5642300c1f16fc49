"""A boundary without a surface."""

from typing import Any, ClassVar, Literal

from reference_rt.core.model import Examples
from reference_rt.materials.material import Material
from reference_rt.textures import Palette


class NoSurface(Material):
    """No surface: all light goes straight on, shadow rays too.  It bounds a medium, as the edge of
    a cloud does.  Path tracing alone takes it."""

    EXAMPLES: ClassVar[Examples] = ({},)
    type: Literal["none"] = "none"

    @property
    def colour(self) -> tuple[float, float, float]:
        """White: what ray casting shows where there is no surface."""
        return (1.0, 1.0, 1.0)

    @property
    def transmits(self) -> bool:
        return True

    def tabulate(self, palette: Palette) -> Any:
        raise TypeError("what is no surface has no row of a table: it scatters nothing")
