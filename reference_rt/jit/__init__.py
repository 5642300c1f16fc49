"""The compiler: which functions Numba compiles, how, and where compiled kernels are cached."""
