"""`ByCode`: generates the kernels that choose among all types of shapes, or of materials; and
`tables_of`, which numbers the types.

A scene has one table for each type of shape: `Shapes` has the fields spheres, boxes, ..., and None
in place of the table of a type that the scene lacks.  A hit names a table by an integer code.  From
the code to the kernel of the type it is the same if-chain for every kernel, so the chains are
generated: one for each combination of tables that are present.  For example,

    @by_code("uv", code="hit.kind")
    def uv(shapes: Shapes, ray: Ray, hit: Hit) -> tuple[float, float]:
        return 0.0, 0.0

becomes, for scenes of spheres and boxes,

    def uv(shapes, ray, hit):
        if hit.kind == 0:
            return spheres(shapes.spheres, ray, hit)  # sphere.uv
        if hit.kind == 2:
            return boxes(shapes.boxes, ray, hit)  # box.uv
        return otherwise(shapes, ray, hit)  # the function as it was decorated

Compiled code and plain Python run this text, and tracebacks show it.

For a link to tables (`links.py`) the text depends on no scene.  A list has, for each code, the
address of the table and the function pointers of the operations, 32 words (`STRIDE`) in all, of
which `uv` has number 3:

    def uv(shapes, ray, hit):
        code = hit.kind
        if 0 <= code <= 8:  # the last code of all types that have `uv`
            pointer = word_at(shapes.address, 32 * code + 3)
            if pointer < 0:  # the table is there, but `Linker` was not asked for this operation
                stop()
            if pointer != 0:
                return call(pointer, word_at(shapes.address, 32 * code + 0), (ray, hit, ))
        return otherwise(shapes, ray, hit)
"""

import functools
from collections.abc import Callable, Iterable, Sequence
from types import ModuleType
from typing import Annotated, Any, NamedTuple, TypeVar, get_args, get_origin, get_type_hints

from numba import types

from reference_rt.jit.kernel import is_named_tuple, kernel, overload_kernel
from reference_rt.jit.links import Group, Link, Operation, Row, stop
from reference_rt.jit.numba_codegen import define, parameters_of

F = TypeVar("F", bound=Callable[..., Any])


class Table(NamedTuple):
    """A type of table.  code: its number;  field: of the NamedTuple of all tables;  table: the
    class;  module: what has its kernels as attributes."""

    code: int
    field: str
    table: Any
    module: Any


def tables_of(of_all: type) -> tuple[Table, ...]:
    """The tables in a NamedTuple of all tables of a kind, whose fields of tables are annotated as
    Annotated[Spheres | None, sphere]: the table, None where there is none, and its kernels.  Their
    order is that of the codes, from 0 on."""
    hints = get_type_hints(of_all, include_extras=True).items()
    fields = [(field, *get_args(hint)) for field, hint in hints if get_origin(hint) is Annotated]
    return tuple(
        Table(code, field, get_args(table)[0], module)
        for code, (field, table, module) in enumerate(fields)
    )


def described_in(module: ModuleType, union: Any) -> type:
    """The description in a module, of those in a union."""
    (found,) = (cls for cls in get_args(union) if cls.__module__ == module.__name__)
    return found  # type: ignore[no-any-return]


class ByCode(Group):
    """rows: the code of each type, the field of its table, and the module that has its kernels, in
    the order in which codes are compared."""

    def __init__(self, rows: Iterable[tuple[int, str, Any]]) -> None:
        super().__init__()
        self._rows = tuple(rows)

    def __call__(
        self, name: str | Callable[[Any], Callable[..., Any] | None], code: str = "kind"
    ) -> Callable[[F], F]:
        """Decorates f(tables, ...), to choose among the kernels `name` of the modules.

        name: or a function from a module to its kernel, None if it has none;  code: an expression
        of f's parameters.  A kernel is called with its table and those of f's parameters that it
        names.  The body of f is for all other codes: those of absent tables, of modules without
        the kernel, and of no type.  Raises TypeError for a kernel with a parameter that f lacks.
        """
        found = [
            (number, field, name(m) if callable(name) else getattr(m, name, None))
            for number, field, m in self._rows
        ]
        rows = [Row(number, field, of_row) for number, field, of_row in found if of_row is not None]

        def decorate(otherwise: F) -> F:
            tables, *others = parameters_of(otherwise)
            for _, field, of_row in rows:
                unknown = set(parameters_of(of_row)[1:]) - set(others)
                if unknown:
                    raise TypeError(
                        f"{of_row.__module__}.{of_row.__name__}, for {field}: parameters {unknown} "
                        f"are none of those of {otherwise.__module__}.{otherwise.__name__}"
                    )

            def lines(present: Sequence[Row]) -> Iterable[str]:
                for number, field, of_row in present:
                    given = [f"{tables}.{field}", *parameters_of(of_row)[1:]]
                    yield f"if {code} == {number}:"
                    yield f"    return {field}({', '.join(given)})"
                yield f"return otherwise({', '.join([tables, *others])})"

            operation, body = self._add(otherwise, rows), kernel(otherwise)
            linked = functools.partial(operation.through_link, tables, code, body)
            chosen = _chosen(otherwise, [tables, *others], rows, lines, linked, otherwise=body)
            Operation.of[chosen] = operation
            return chosen

        return decorate

    def in_turn(self, step: Callable[..., Any]) -> Callable[..., Any]:
        """f(tables, ..., result): what step(code, table, ..., result) returns for the last table
        that is present, the result of each being passed to the next; no loop, so that the code and
        the type of the table are constants in each step.  Given a link, it stops the process:
        Numba's own compiler compiles calls that are never made."""
        _, _, *others = parameters_of(step)
        given, result = ", ".join(others), others[-1]
        rows = [Row(number, field, step) for number, field, _ in self._rows]

        def lines(present: Sequence[Row]) -> Iterable[str]:
            for number, field, _ in present:
                yield f"{result} = {field}({number}, tables.{field}, {given})"
            yield f"return {result}"

        def linked() -> Callable[..., Any]:
            name = step.__name__
            text = f"def {name}(tables, {given}):\n    stop()\n    return {result}\n"
            return define(text, step.__module__, name, "for a link", {"stop": stop})

        return _chosen(step, ["tables", *others], rows, lines, linked)


def _chosen(
    function: F,
    parameters: Sequence[str],
    rows: Sequence[Row],
    lines: Callable[[Sequence[Row]], Iterable[str]],
    linked: Callable[[], Callable[..., Any]],
    **names: Any,
) -> F:
    """The kernel that runs, for tables of which some are None, the text `lines` of the others; for
    a link, what `linked` returns.

    function: of which it has the name, the module and the docstring;  names: what the text uses
    beside the parameters and a kernel for each field.
    """
    written: dict[tuple[str, ...], Callable[..., Any]] = {}

    def write(is_present: Callable[[str], bool]) -> Callable[..., Any]:
        present = [row for row in rows if is_present(row.field)]
        fields = tuple(row.field for row in present)
        if fields not in written:
            module, name = function.__module__, function.__name__
            text = f"def {name}({', '.join(parameters)}):\n"
            text += "".join(f"    {line}\n" for line in lines(present))
            known = names | {row.field: row.kernel for row in present}
            label = f"for {', '.join(fields) or 'no tables'}"
            written[fields] = define(text, module, name, label, known)
        return written[fields]

    @functools.wraps(function)
    def choose(tables: Any, *rest: Any) -> Any:
        return write(lambda field: getattr(tables, field) is not None)(tables, *rest)

    @overload_kernel(choose)
    def _compiled(tables: Any, *rest: Any) -> Callable[..., Any]:
        if is_named_tuple(tables, Link):
            return linked()
        type_of = dict(zip(tables.fields, tables.types, strict=True))
        return write(lambda field: not isinstance(type_of[field], types.NoneType))

    return choose  # type: ignore[return-value]
