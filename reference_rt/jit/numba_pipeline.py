"""How kernels become machine code: linked as they are, then optimised once, as a whole.

Numba optimises every function and makes machine code of it before it is linked into its callers,
which do both again.  Kernels are inlined without exception, so that this work is for nothing: of
the 33 s that a scene of many materials took to compile, two thirds (measured).  Here a kernel stays
as it was lowered until an entry kernel links all that it calls.

Nor are arguments taken apart.  Numba passes every number in a tuple by itself: some 400 for the
tables of a scene, with an instruction for each at both ends of every call.  Inlining removes them
all, but they are to be written, read and removed: a third of the time that was left.
"""

from typing import Any

from llvmlite import binding
from numba import _dynfunc
from numba.core import cgutils, config, typed_passes, types, untyped_passes
from numba.core.analysis import dead_branch_prune
from numba.core.base import BaseContext
from numba.core.codegen import CPUCodegen, JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder, Flags
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.datamodel import DataModelManager, default_manager
from numba.core.datamodel.models import TupleModel, UniTupleModel
from numba.core.typed_passes import NativeLowering
from numba.core.untyped_passes import DeadBranchPrune

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
"""Methods of Numba that are replaced or called below, beside the imports.  A renamed one that is
replaced would still be found here, and never be called."""

for _owner, _method in REPLACED:
    if not hasattr(_owner, _method):
        raise ImportError(f"{_owner.__module__}.{_owner.__name__} has no {_method}")


class _Inlined(JITCodeLibrary):
    """The code of a kernel: as it was lowered, without that of what it calls."""

    def _optimize_functions(self, module: Any) -> None:
        module.data_layout = self._codegen._data_layout

    def finalize(self) -> None:
        for function in self._final_module.functions:
            if function.linkage == binding.Linkage.external and not function.is_declaration:
                function.linkage = "linkonce_odr"  # may go where it is inlined
        self._finalized = True

    def _get_module_for_linking(self) -> Any:
        return self._final_module

    def _called(self, found: dict[Any, None]) -> dict[Any, None]:
        """All that is called from here, added to `found`, each once (a dict keeps the order)."""
        for library in self._linking_libraries:
            if library not in found:
                found[library] = None
                if isinstance(library, _Inlined):
                    library._called(found)
        return found


class _Entry(_Inlined):
    """The code of an entry kernel, with all that it calls."""

    def finalize(self) -> None:
        for library in self._called({}):
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        # Numba's cheap passes, which come before these, are for reference counts; there are none.
        passes, builder = self._codegen._module_pass_manager()
        passes.run(self._final_module, builder)
        self._final_module.verify()
        self._finalize_final_module()

    def _get_module_for_linking(self) -> Any:
        return JITCodeLibrary._get_module_for_linking(self)


def invoke(
    context: Any, builder: Any, function: Any, returns: Any, types: Any, arguments: Any
) -> Any:
    """Write a call of a kernel: as Numba's own, without asking whether it raised anything, which
    takes five blocks; but for indices out of bounds, where these are checked, none does."""
    if config.BOUNDSCHECK:
        status, value = context.call_conv.call_function(
            builder, function, returns, types, arguments
        )
        with cgutils.if_unlikely(builder, status.is_error):
            context.call_conv.return_status_propagate(builder, status)
        return value
    returned = cgutils.alloca_once(builder, function.type.pointee.args[0].pointee)
    raised = builder.function.args[1]
    packed = context.get_arg_packer(types).as_arguments(builder, arguments)
    builder.call(function, [returned, raised, *packed])
    return context.get_returned_value(builder, returns, builder.load(returned))


def _call(called: Any, library: Any) -> Any:
    """What writes a call of a kernel that is to be inlined."""

    def write(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        function = context.declare_function(builder.module, called)
        return invoke(context, builder, function, called.restype, called.argtypes, arguments)

    write.signature = called.argtypes
    write.libs = (library,)
    return write


@register_pass(mutates_CFG=True, analysis_only=False)
class _LowerInlined(NativeLowering):
    """Without an address: nothing but kernels calls the result."""

    _name = "lower_inlined"

    def run_pass(self, state: Any) -> bool:
        state.library = _Inlined(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        super().run_pass(state)
        lowered = state["cr"]
        # Calls find code by an object that stands for it.
        name = lowered.fndesc.qualname
        stands_for_it = _dynfunc.make_function(
            lowered.fndesc.lookup_module(), name, name, 0, lowered.env, (state.library,)
        )
        call = _call(lowered.fndesc, state.library)
        state.targetctx.insert_func_defn([(call, stands_for_it, call.signature)])
        state["cr"] = lowered._replace(cfunc=stands_for_it)
        return True


@register_pass(mutates_CFG=True, analysis_only=False)
class _LowerEntry(NativeLowering):
    _name = "lower_entry"

    def run_pass(self, state: Any) -> bool:
        state.library = _Entry(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return bool(super().run_pass(state))


class _Whole:
    """Mixed into the model of a kind of tuple: an argument, and what is returned, is the tuple
    itself."""

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


class _WholeTuple(_Whole, TupleModel):
    pass


class _WholeUniTuple(_Whole, UniTupleModel):
    pass


_MODELS = DataModelManager().chain(default_manager)
_MODELS.register(types.NamedTuple, _WholeTuple)
_MODELS.register(types.NamedUniTuple, _WholeUniTuple)

_INTERNAL: dict[Any, Any] = {}
"""Numba's own functions that kernels call, compiled for these models."""


class _There:
    """In place of the type of an argument: certainly not that of None."""

    def __init__(self, numba_type: Any) -> None:
        self.literal_type = numba_type  # what Numba's pass compares with None's


@register_pass(mutates_CFG=True, analysis_only=False)
class _Prune(DeadBranchPrune):
    """Remove the branches that `x is None` decides.

    Numba's own leaves `if x is None:` where x is there, and what stands below is compiled for
    nothing, with all that it calls: a scene without a hierarchy's intersection of a few shapes in
    one with a hierarchy.
    """

    _name = "prune"

    def run_pass(self, state: Any) -> bool:
        maybe = (types.NoneType, types.Omitted, types.Optional)
        known = [t if isinstance(t, maybe) else _There(t) for t in state.args]
        dead_branch_prune(state.func_ir, known)
        return True


_LEFT_OUT = (
    NativeLowering,  # others come in their place
    DeadBranchPrune,
    # For what no kernel has: closures, `with`, generators, loops over literals, expressions of
    # whole arrays, references to count.
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


class _Flags(Flags):
    """Numba's options.

    It asks some 30,000 times a scene whether two are the same, to find a kernel that is compiled
    already, and takes all 25 of both apart each time: a tenth of its calls (measured).
    """

    def __hash__(self) -> int:
        return 0  # all kernels have the same, but for a few

    def __eq__(self, other: object) -> bool:
        if isinstance(other, _Flags) and self._values == other._values:
            return True
        return bool(super().__eq__(other))


class _Compiler(CompilerBase):
    """Numba's compiler with another lowering, and tuples as above."""

    lowering: type[NativeLowering]

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.state.flags = _Flags(self.state.flags)
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
    """Of kernels."""

    lowering = _LowerInlined


class EntryCompiler(_Compiler):
    """Of entry kernels."""

    lowering = _LowerEntry
