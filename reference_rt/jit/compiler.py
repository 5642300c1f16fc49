"""Numba's passes for kernels: an entry kernel links all that it calls, then is optimised once.

Numba optimises every function and generates its machine code before it links the function into
its callers, which do both again.  Kernels are always inlined, so this work is wasted: two thirds
of the 33 s that a scene of many materials took to compile (measured).  Here a kernel stays
unoptimised LLVM IR until an entry kernel links it.

Tuples are passed as one LLVM struct.  Numba flattens them into scalar arguments: some 400 for the
tables of a scene, with an instruction for each at both ends of every call.  Inlining would remove
these, but writing, reading and removing them took a third of the remaining time.

It replaces private parts of one release of Numba: pyproject.toml permits no other.
"""

from typing import Any

import numba
from llvmlite import binding
from numba import _dynfunc
from numba.core import cgutils, config, ir, typed_passes, types, untyped_passes
from numba.core.analysis import dead_branch_prune
from numba.core.base import BaseContext
from numba.core.codegen import CPUCodegen, JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.datamodel import DataModelManager, default_manager
from numba.core.datamodel.models import TupleModel, UniTupleModel
from numba.core.ir_utils import get_definition, guard
from numba.core.typed_passes import NativeLowering
from numba.core.untyped_passes import DeadBranchPrune

from reference_rt.jit.numba_codegen import SUPPORTED, call_checked

# Numba's classes have no types that mypy knows.
# mypy: disable-error-code="attr-defined, misc, untyped-decorator"

REPLACED: tuple[tuple[type, str], ...] = (
    (JITCodeLibrary, "_optimize_functions"),
    (JITCodeLibrary, "finalize"),
    (JITCodeLibrary, "_finalize_final_module"),
    (JITCodeLibrary, "_get_module_for_linking"),
    (JITCodeLibrary, "enable_object_caching"),
    (CPUCodegen, "_module_pass_manager"),
    (BaseContext, "subtarget"),
    (BaseContext, "insert_func_defn"),
    (BaseContext, "declare_function"),
    (BaseContext, "get_arg_packer"),
    (BaseContext, "get_returned_value"),
    (CompilerBase, "define_pipelines"),
    (DefaultPassBuilder, "define_nopython_pipeline"),
    (PassManager, "add_pass_after"),
    (TupleModel, "as_argument"),
    (NativeLowering, "run_pass"),
    (DeadBranchPrune, "run_pass"),
)
"""Methods of Numba that are overridden or called below.  Checked at import, because an override of
a method that Numba has renamed would silently never be called."""

for _owner, _method in REPLACED:
    if not hasattr(_owner, _method):
        raise ImportError(
            f"Numba {numba.__version__}: {_owner.__module__}.{_owner.__name__} has no {_method}; "
            f"expected: pip install 'numba=={SUPPORTED}.*'"
        )


class _Inlined(JITCodeLibrary):
    """The LLVM IR of a kernel: unoptimised, and without its callees."""

    def _optimize_functions(self, module: Any) -> None:
        module.data_layout = self._codegen._data_layout

    def finalize(self) -> None:
        for function in self._final_module.functions:
            if function.linkage == binding.Linkage.external and not function.is_declaration:
                function.linkage = "linkonce_odr"  # LLVM may drop it once it is inlined
        self._finalized = True

    def _get_module_for_linking(self) -> Any:
        return self._final_module

    def _called(self, found: dict[Any, None]) -> dict[Any, None]:
        """Adds to `found` all direct and indirect callees, each once (a dict keeps the order)."""
        for library in self._linking_libraries:
            if library not in found:
                found[library] = None
                if isinstance(library, _Inlined):
                    library._called(found)
        return found


class _Entry(_Inlined):
    """The code of an entry kernel, with all its callees."""

    def finalize(self) -> None:
        for library in self._called({}):
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        # Not preceded by Numba's cheap passes: these are for reference counts, and there are none.
        passes, builder = self._codegen._module_pass_manager()
        passes.run(self._final_module, builder)
        self._final_module.verify()
        self._finalize_final_module()

    def _get_module_for_linking(self) -> Any:
        return JITCodeLibrary._get_module_for_linking(self)


def invoke(
    context: Any, builder: Any, function: Any, returns: Any, types: Any, arguments: Any
) -> Any:
    """Emit a call of a kernel, as Numba does, but without the five basic blocks that check whether
    it raised an exception.  Kernels raise none, except with NUMBA_BOUNDSCHECK=1 an IndexError."""
    if config.BOUNDSCHECK:
        return call_checked(context, builder, function, returns, types, arguments)
    returned = cgutils.alloca_once(builder, function.type.pointee.args[0].pointee)
    raised = builder.function.args[1]
    packed = context.get_arg_packer(types).as_arguments(builder, arguments)
    builder.call(function, [returned, raised, *packed])
    return context.get_returned_value(builder, returns, builder.load(returned))


def _call(called: Any, library: Any) -> Any:
    """A function that emits a call of a kernel that will be inlined."""

    def write(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        function = context.declare_function(builder.module, called)
        return invoke(context, builder, function, called.restype, called.argtypes, arguments)

    write.signature = called.argtypes
    write.libs = (library,)
    return write


@register_pass(mutates_CFG=True, analysis_only=False)
class _LowerInlined(NativeLowering):
    """Lower a kernel, without machine code or a function pointer: only kernels call it."""

    _name = "lower_inlined"

    def run_pass(self, state: Any) -> bool:
        state.library = _Inlined(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        super().run_pass(state)
        lowered = state["cr"]
        # Numba's key for the code of a callee is a function object: this one is never called.
        name = lowered.fndesc.qualname
        stands_for_it = _dynfunc.make_function(
            lowered.fndesc.lookup_module(), name, name, 0, lowered.env, (state.library,)
        )
        call = _call(lowered.fndesc, state.library)
        state.targetctx.insert_func_defn([(call, stands_for_it, call.signature)])
        state["cr"] = lowered._replace(cfunc=stands_for_it)
        return False  # else Numba computes how long variables live once more


@register_pass(mutates_CFG=True, analysis_only=False)
class _LowerEntry(NativeLowering):
    _name = "lower_entry"

    def run_pass(self, state: Any) -> bool:
        state.library = _Entry(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        super().run_pass(state)
        return False


class _AsStruct:
    """Mixin for the data model of a kind of tuple: as an argument and as a return value, it is one
    LLVM struct."""

    def get_argument_type(self) -> Any:
        return self.get_value_type()

    def as_argument(self, builder: Any, value: Any) -> Any:
        return value

    def from_argument(self, builder: Any, value: Any) -> Any:
        return value

    def get_return_type(self) -> Any:
        return self.get_value_type()

    def as_return(self, builder: Any, value: Any) -> Any:
        return value

    def from_return(self, builder: Any, value: Any) -> Any:
        return value


class _StructTuple(_AsStruct, TupleModel):
    pass


class _StructUniTuple(_AsStruct, UniTupleModel):
    pass


_MODELS = DataModelManager().chain(default_manager)
_MODELS.register(types.NamedTuple, _StructTuple)
_MODELS.register(types.NamedUniTuple, _StructUniTuple)

_INTERNAL: dict[Any, Any] = {}
"""Numba's cache of its own functions that kernels call, here compiled for these data models."""


class _NotNone:
    """Marks the type of an argument, for Numba's dead-branch pass, as not that of None."""

    def __init__(self, numba_type: Any) -> None:
        self.literal_type = numba_type  # which that pass compares with the type of None


@register_pass(mutates_CFG=True, analysis_only=False)
class _Prune(DeadBranchPrune):
    """Remove the dead branches of `if x is None`, for arguments x.

    Numba's own pass removes the branch for an x that is present only if x is None.  It keeps the
    branch for None if x is present, which is then compiled with all its callees: for example the
    intersection of scenes without a hierarchy, in a scene that has one.
    """

    _name = "prune"

    def run_pass(self, state: Any) -> bool:
        maybe = (types.NoneType, types.Omitted, types.Optional)
        types_of = [*state.args]
        definitions = state.func_ir._definitions
        fields = {}
        for block in state.func_ir.blocks.values():
            for statement in block.body:
                if isinstance(statement, ir.Assign):
                    found = _type_of_field(state.func_ir, types_of, statement.value)
                    if found is not None:
                        name = statement.target.name
                        fields[name] = definitions[name]
                        stand_in = ir.Arg(name, len(types_of), statement.loc)
                        definitions[name] = [stand_in] * len(fields[name])
                        types_of.append(found)
        known = [t if isinstance(t, maybe) else _NotNone(t) for t in types_of]
        dead_branch_prune(state.func_ir, known)
        definitions.update(fields)
        return True


def _type_of_field(func_ir: Any, arguments: Any, value: Any) -> Any:
    """The type of `x.a.b` for an argument x that is a NamedTuple; None for any other value."""
    if not isinstance(value, ir.Expr) or value.op != "getattr":
        return None
    owner = guard(get_definition, func_ir, value.value)
    if isinstance(owner, ir.Arg):
        owner_type = arguments[owner.index] if owner.index < len(arguments) else None
    else:
        owner_type = _type_of_field(func_ir, arguments, owner)
    if not isinstance(owner_type, types.BaseNamedTuple) or value.attr not in owner_type.fields:
        return None
    return owner_type.types[owner_type.fields.index(value.attr)]


_LEFT_OUT = (
    NativeLowering,  # replaced by _LowerInlined or _LowerEntry, and DeadBranchPrune by _Prune
    DeadBranchPrune,
    # For features that no kernel uses: closures, `with`, generators, loops over literals,
    # whole-array expressions, reference counts.
    typed_passes.InlineOverloads,
    typed_passes.NopythonRewrites,
    typed_passes.NoPythonSupportedFeatureValidation,
    typed_passes.DumpParforDiagnostics,
    typed_passes.IRLegalization,
    untyped_passes.FindLiterallyCalls,
    untyped_passes.InlineClosureLikes,
    untyped_passes.InlineInlinables,
    untyped_passes.LiteralPropagationSubPipelinePass,
    untyped_passes.LiteralUnroll,
    untyped_passes.MakeFunctionToJitFunction,
    untyped_passes.RewriteDynamicRaises,
    untyped_passes.WithLifting,
)


class _Compiler(CompilerBase):
    """Numba's compiler with the passes and the data models above."""

    lowering: type[NativeLowering]

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.state.targetctx = self.state.targetctx.subtarget(
            data_model_manager=_MODELS, cached_internal_func=_INTERNAL
        )

    def define_pipelines(self) -> list[Any]:
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.add_pass_after(self.lowering, NativeLowering)
        passes.add_pass_after(_Prune, untyped_passes.RewriteSemanticConstants)
        passes.passes = [p for p in passes.passes if p[0] not in _LEFT_OUT]
        passes.finalize()
        return [passes]


class InlinedCompiler(_Compiler):
    """For kernels."""

    lowering = _LowerInlined


class EntryCompiler(_Compiler):
    """For entry kernels."""

    lowering = _LowerEntry


# Without _nrt=False every call atomically counts references to every array of the scene, for which
# threads contend (measured: the Cornell box renders 5 times slower).
_OPTIONS = {"error_model": "numpy", "_nrt": False}

KERNEL: dict[str, Any] = _OPTIONS | {
    "no_cfunc_wrapper": True,  # it is never called from C
    "forceinline": True,
    "pipeline_class": InlinedCompiler,
}
"""Options of `numba.njit` for kernels, which are inlined."""

ENTRY: dict[str, Any] = _OPTIONS | {"nogil": True, "pipeline_class": EntryCompiler}
"""The same for entry kernels."""

CALLEE: dict[str, Any] = _OPTIONS | {
    # Without the wrappers that Python and C would call (measured: a small one compiles in 12 ms
    # instead of 25).
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "pipeline_class": EntryCompiler,
}
"""The same for those entry kernels that only compiled code calls."""
