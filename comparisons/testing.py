"""Is a material of yours right, or a sampler?  Checks of functions of NumPy arrays, of any program:
see `comparisons.gate.material`.

    from comparisons.testing import check_material
"""

from comparisons.gate.material import Check as Check
from comparisons.gate.material import check_material as check_material
from comparisons.gate.material import chi_square as chi_square
from comparisons.gate.material import furnace as furnace
from comparisons.gate.material import reciprocity as reciprocity
from comparisons.gate.material import weights as weights

__all__ = ["Check", "check_material", "chi_square", "furnace", "reciprocity", "weights"]
