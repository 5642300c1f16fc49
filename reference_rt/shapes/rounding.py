"""What rounding takes away, exactly."""

from reference_rt.kernel import kernel


@kernel
def product_error(x: float, y: float, product: float) -> float:
    """x y - product, exactly, for product = fl(x y) (Dekker 1971, Veltkamp's splitting)."""
    x_high = x * 134217729.0  # 2^27 + 1
    x_high = x_high - (x_high - x)
    y_high = y * 134217729.0
    y_high = y_high - (y_high - y)
    x_low, y_low = x - x_high, y - y_high
    return ((x_high * y_high - product) + x_high * y_low + x_low * y_high) + x_low * y_low
