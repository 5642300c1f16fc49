"""Compilation with Numba: the decorators, the compiler pipeline, the kernel cache, SIMD.

- `kernel.py`: `@kernel` and `@entry_kernel`, the only decorators that compile; `ByClass`.
- `by_code.py`: `ByCode`, which generates the kernels that choose among shapes, materials, ...
- `compiler.py`, `numba_pipeline.py`: our pipeline, and the fallback to Numba's own.
- `kernel_cache.py`: compiled kernels on disk.
- `function_pointer.py`, `parallel_compile.py`: kernels that are compiled separately, in parallel.
- `simd.py`, `simd_kernels.py`: functions that become vector instructions.

With NUMBA_DISABLE_JIT=1 all kernels run as plain Python, with the same bits.  `kernel.py` says what
rules they must follow for that.  Nothing here knows about scenes.
"""
