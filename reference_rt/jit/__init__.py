"""Compilation with Numba: the decorators, the compiler pipeline, the kernel cache, SIMD.

- `kernel.py`: `@kernel` and `@entry_kernel`, the only decorators that compile; `ByClass`, a choice
  by the class of a table.
- `by_code.py`: `ByCode`, a choice by a number among shapes, materials, ..., as generated kernels.
- `links.py`: `Link`, through which a kernel reaches tables and operations without being compiled
  for their types; `Linkable`, operations on one table; Numba's types of their annotations.
- `compiler.py`: our pipeline of Numba's passes.
- `numba_codegen.py`: what code generation takes from inside Numba (docs/numba.md), and kernels from
  generated text.
- `kernel_cache.py`: compiled kernels on disk.
- `parallel_compile.py`: kernels compiled in several processes.
- `simd.py`: functions that become vector instructions.

With NUMBA_DISABLE_JIT=1 all kernels run as plain Python, with the same bits.  `kernel.py` says what
rules they must follow for that.  Nothing here knows about scenes.
"""
