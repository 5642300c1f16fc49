"""How long kernels take to compile."""

import re
from typing import Any

from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.jit.kernel import is_named_tuple
from reference_rt.jit.parallel_compile import Call

_COSTS = {
    "trace_block": 4.0,  # of specialised kernels only
    "render_tile": 1.6,
    "closest_hits": 1.3,
    "any_hits": 0.9,
    "closest_hit": 0.8,
    "occluded": 0.6,
    "first_hits_tile": 0.4,
    "aov_tile": 0.4,
}
_COST = 0.13
_COST_SPECIALISED = 8.0


def cost(call: Call) -> float:
    """About how many seconds it takes to compile a kernel (measured: means; others take _COST),
    for the order and for progress bars."""
    compiled, signature = call
    arguments = signature if isinstance(signature, tuple) else signature.args
    if any(is_named_tuple(of, SceneTables) for of in arguments):
        return _COST_SPECIALISED
    return _COSTS.get(operation_of(compiled), _COST)


def operation_of(compiled: Any) -> str:
    """The name of a kernel's operation, or of a kernel that is none; without the code of the type
    that kernels of operations end with."""
    return re.sub(r"_\d+$", "", compiled.__name__)
