"""F8: the roots of quadratics and quartics."""
