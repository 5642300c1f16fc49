"""Error-free transformations: the rounding error of a difference and of a product, exactly."""

from typing import Any

from reference_rt.core.vec3 import Vec3
from reference_rt.jit.kernel import kernel
from reference_rt.jit.simd import product_error


@kernel
def difference_error(a: Any, b: Any, difference: Any) -> Any:
    """a - b - difference, exactly, for difference = fl(a - b) (Knuth 1969, "The Art of Computer
    Programming" 2, 4.2.2)."""
    minus_b = difference - a
    return (a - (difference - minus_b)) - (b + minus_b)


@kernel
def _along(o: Any, d: Any, c: Any, t: Any) -> Any:
    """o + t d - c of one coordinate."""
    off, step = o - c, d * t
    return (off + step) + (difference_error(o, c, off) + product_error(d, t, step))


@kernel
def along_from(o: Vec3, d: Vec3, c: Vec3, t: float) -> Vec3:
    """o + t d - c, as if it were rounded only once or twice, at the end.

    For c near the line and o far away (D) the error of the plain sum is u D, more than the size of
    a small shape around c.  Here it is 2 u times the result, and 2 u² D: the rounding errors of the
    difference and of the product are added, and where their sum is small it does not round
    (Sterbenz).
    """
    return Vec3(_along(o.x, d.x, c.x, t), _along(o.y, d.y, c.y, t), _along(o.z, d.z, c.z, t))


__all__ = ["along_from", "difference_error", "product_error"]
