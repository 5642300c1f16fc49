"""`@kernel` and `@entry_kernel`, the only ways to compile; `ByClass`, a choice at compile time.

Compiled code is cached on disk (`kernel_cache.py`).

A kernel is plain scalar code on floats, integers, arrays and NamedTuples of these.  With
``NUMBA_DISABLE_JIT=1`` the same source runs as plain Python with bit-identical results.  Kernels
follow these rules for that:

- IEEE arithmetic only: no fastmath, no ``**`` (Python's ``pow`` and LLVM's differ in the last bit);
- no allocation: arrays are arguments, small scratch buffers are `local_floats` and the like;
- integers that wrap are ``np.uint64`` throughout, constants included;
- ``math.sqrt`` of a number that may be negative, and division by a Python float that may be zero,
  are guarded (`reciprocal`): Python raises where the machine returns NaN or infinity.
"""

import gc
import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any, TypeVar

import numba
import numpy as np
import numpy.typing as npt
from numba import njit, types
from numba.extending import intrinsic, overload, register_jitable

from reference_rt.jit import compiler
from reference_rt.jit.kernel_cache import KernelCache, prepare_folder
from reference_rt.jit.numba_codegen import array_at

F = TypeVar("F", bound=Callable[..., Any])

CACHE_FOLDER = prepare_folder()

Signature = Any
"""The types of a kernel's arguments: a tuple, or Numba's signature, which has that of the result
too."""


def kernel(function: F) -> F:
    """Make `function` callable from compiled code, inlined; Python runs it as plain Python.

    IEEE arithmetic in the order written.  Always inlined, because the machine's calling convention
    would pass the scene's tables field by field, some 400 words a call (measured: inlined, a render
    is 1.5 times faster).  `compiler.py` does that without compiling anything twice;
    `compiler.py` chooses between it and Numba's own compiler.
    """
    inlined: F = register_jitable(**compiler.KERNEL)(function)
    return inlined


def overload_kernel(function: Any) -> Callable[[F], F]:
    """`numba.extending.overload` for functions that kernels call: decorates a function that takes
    the arguments' types and returns the kernel for them, or None."""
    decorate: Callable[[F], F] = overload(function, jit_options=compiler.KERNEL, strict=False)
    return decorate


def entry_kernel(function: F) -> F:
    """Compile `function`, which Python calls with arrays, at the first call for each set of
    argument types, and cache the result on disk.  Runs without the GIL."""
    compiled: F = njit(**compiler.ENTRY)(function)
    _cache(compiled, function)
    return compiled


def callee_kernel(function: Callable[..., Any], of: Callable[..., Any], name: str) -> Any:
    """An entry kernel that only compiled code calls, through its function pointer.

    of: the kernel of which `function`, a generated one, is made;  name: what tells it apart from
    others that are made of the same kernel.
    """
    compiled = njit(**compiler.CALLEE)(function)
    _cache(compiled, of, name)
    return compiled


def _cache(compiled: Any, function: Callable[..., Any], name: str = "") -> None:
    if CACHE_FOLDER is not None and not numba.config.DISABLE_JIT:
        with suppress(OSError):  # without a source file
            compiled._cache = KernelCache(function, CACHE_FOLDER, name)
            compiled.compile = _alone(compiled, compiled.compile)


def _alone(compiled: Any, compile_it: Callable[[Signature], Any]) -> Callable[[Signature], Any]:
    """The method `compile` of an entry kernel, but two processes do not compile the same: one waits
    and loads what the other has compiled."""

    def compile_alone(signature: Signature) -> Any:
        if is_compiled(compiled, signature):
            return compile_it(signature)
        with compiled._cache.alone(signature, compiled.targetctx.codegen()):
            return compile_it(signature)

    return compile_alone


def signature_of(*args: Any) -> Signature:
    """Numba's types of arguments.  For a scene's tables this takes more than 1 ms (measured)."""
    return () if numba.config.DISABLE_JIT else tuple(numba.typeof(a) for a in args)


def precompile(compiled: Callable[..., Any], signature: Signature) -> Callable[..., Any]:
    """Compile an entry kernel for arguments of these types, or load it from the cache.

    Returns a function that calls it without checking the arguments' types, which the caller must
    get right: Numba's check of a scene's tables looks at some 400 types in every call (measured:
    34 us a call with it, 2 us without).
    """
    if numba.config.DISABLE_JIT:
        return compiled
    known = compiled.overloads.get(_types_of(signature))  # type: ignore[attr-defined]
    if known is not None:  # Numba's own way to it takes 0.2 ms
        return known.entry_point  # type: ignore[no-any-return]
    with _no_collections():
        ready: Callable[..., Any] = compiled.compile(signature)  # type: ignore[attr-defined]
    return ready


@contextmanager
def _no_collections() -> Iterator[None]:
    """Without Python's garbage collections.  Numba's compiler makes many objects that last until a
    kernel is compiled, and searching them takes 15 % of the time (measured: 5.2 s to 4.4 s)."""
    if not gc.isenabled():
        yield
        return
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


def is_compiled(compiled: Callable[..., Any], signature: Signature) -> bool:
    """Whether an entry kernel is compiled for these types, in this process or in the cache."""
    if numba.config.DISABLE_JIT:
        return True
    known = compiled.overloads  # type: ignore[attr-defined]
    return _types_of(signature) in known or is_cached(compiled, signature)


def _types_of(signature: Signature) -> tuple[Any, ...]:
    """The types of the arguments alone."""
    return signature if isinstance(signature, tuple) else tuple(signature.args)


def is_cached(compiled: Callable[..., Any], signature: Signature) -> bool:
    """Whether the cache has an entry kernel for these types."""
    cache, codegen = compiled._cache, compiled.targetctx.codegen()  # type: ignore[attr-defined]
    return isinstance(cache, KernelCache) and cache.has(signature, codegen)


def is_compiling(compiled: Callable[..., Any], signature: Signature) -> bool:
    """Whether another process compiles an entry kernel for these types just now."""
    cache, codegen = compiled._cache, compiled.targetctx.codegen()  # type: ignore[attr-defined]
    return isinstance(cache, KernelCache) and cache.is_compiling(signature, codegen)


def is_named_tuple(numba_type: Any, cls: type) -> bool:
    """Whether a Numba type is the type of the NamedTuple `cls`."""
    return isinstance(numba_type, types.BaseNamedTuple) and numba_type.instance_class is cls


class ByClass:
    """A function that calls the kernel registered for the class of its first argument.

    For what is the same in a whole render: camera, sampler, filter, integrator; a table, or None in
    its place.  The first argument is a NamedTuple or None.  Its class is known when the caller is
    compiled, so the choice costs nothing at run time.  Example: `reference_rt.cameras`.  For a
    choice by a number that varies from hit to hit see `by_code.py`.
    """

    def __init__(self, name: str) -> None:
        self.kernels: dict[type, Callable[..., Any]] = {}

        def choose(first: Any, *rest: Any) -> Any:
            return self.kernels[type(first)](first, *rest)

        choose.__name__ = name
        self.function: Callable[..., Any] = choose

        @overload_kernel(choose)
        def _compiled(first: Any, *rest: Any) -> Callable[..., Any] | None:
            for cls, function in self.kernels.items():
                if is_named_tuple(first, cls) or (
                    cls is type(None) and isinstance(first, types.NoneType)
                ):
                    return function
            return None

    def register(self, cls: type, function: Callable[..., Any]) -> None:
        """Call `function` if the first argument is a `cls`; `cls` is type(None) for None."""
        self.kernels[cls] = function


def by_class(name: str, kernels: Mapping[type, Callable[..., Any]]) -> Any:
    """The function of a `ByClass` with these kernels, by the class of the first argument."""
    choice = ByClass(name)
    for cls, function in kernels.items():
        choice.register(cls, function)
    return choice.function


def _local_array(dtype: Any) -> Any:
    """An intrinsic that returns an uninitialised 1-D array on the machine's stack.

    The array is freed when the calling kernel returns.  In a loop, each pass would take more stack.
    """

    @intrinsic  # type: ignore[untyped-decorator]
    def allocate(typing_context: Any, n: Any) -> Any:
        array_type = types.Array(dtype, 1, "C")

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            item = context.get_data_type(dtype)
            data = builder.alloca(item, size=arguments[0])
            data.align = 64  # a cache line: loads of vectors that straddle two take longer
            return array_at(context, builder, array_type, data, [arguments[0]])

        return array_type(types.intp), generate

    return allocate


if numba.config.DISABLE_JIT:

    def local_floats(n: int) -> npt.NDArray[np.float64]:
        """Scratch for `n` floats, freed when the calling kernel returns; not for use in loops.
        Zeros: a row that nothing was stored in is read as an integer, too, and then not used;
        Python refuses to make one of the NaN that fresh memory may hold."""
        return np.zeros(n)

    def local_integers(n: int) -> npt.NDArray[np.int64]:
        """Scratch for `n` integers, likewise."""
        return np.empty(n, np.int64)

    def local_uint32(n: int) -> npt.NDArray[np.uint32]:
        """Scratch for `n` unsigned 32-bit integers, likewise."""
        return np.empty(n, np.uint32)

else:
    local_floats = _local_array(types.float64)
    local_integers = _local_array(types.int64)
    local_uint32 = _local_array(types.uint32)


@kernel
def reciprocal(x: float) -> float:
    """1/x by IEEE's rules, 1/±0 = ±inf, also in plain Python."""
    if x == 0.0:
        return math.copysign(math.inf, x)
    return 1.0 / x
