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
            return of_spheres(shapes.spheres, ray, hit)  # sphere.uv
        if hit.kind == 2:
            return of_boxes(shapes.boxes, ray, hit)  # box.uv
        return otherwise(shapes, ray, hit)  # the function as it was decorated

Compiled code and plain Python run this text, and tracebacks show it.  Given the table of one type
in place of all tables, the kernel of that type is called.  So one text serves all types in a loop
over a block of paths:

    @by_code.stage()
    def surfaces(table: Any, kind: int, rays: RayBlock, ...) -> None:
        for j in range(n):
            if hits.codes[j] == kind:
                put_point(points, j, surface(table, ray_of(rays, j), hit_of(hits, j)))

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
from collections.abc import Callable, Collection, Iterable, Sequence
from types import ModuleType
from typing import Annotated, Any, NamedTuple, TypeVar, get_args, get_origin, get_type_hints

from numba import types

from reference_rt.jit.kernel import is_named_tuple, kernel, overload_kernel
from reference_rt.jit.links import Group, Link, Operation, Row
from reference_rt.jit.numba_codegen import define, parameters_of

F = TypeVar("F", bound=Callable[..., Any])


class Table(NamedTuple):
    """A type of table.  code: its number;  field: of the NamedTuple of all tables;  table: its
    class, the first of those that it may have;  module: what has its kernels as attributes."""

    code: int
    field: str
    table: Any
    module: Any


def tables_of(of_all: type) -> tuple[Table, ...]:
    """The tables in a NamedTuple of all tables of a kind, whose fields of tables are annotated as
    Annotated[Spheres | None, sphere]: the table, None where there is none, and its kernels.  Their
    order is that of the codes, from 0 on."""
    return tuple(
        Table(code, field, classes[0], module)
        for code, (field, classes, module) in enumerate(_fields_of(of_all))
    )


def _fields_of(of_all: type) -> list[tuple[str, tuple[type, ...], Any]]:
    """(field, the classes that its table may have, module)."""
    hints = get_type_hints(of_all, include_extras=True).items()
    fields = [(field, *get_args(hint)) for field, hint in hints if get_origin(hint) is Annotated]
    return [(field, get_args(table)[:-1], module) for field, table, module in fields]


def described_in(module: ModuleType, union: Any) -> type:
    """The description in a module, of those in a union."""
    (found,) = (cls for cls in get_args(union) if cls.__module__ == module.__name__)
    return found  # type: ignore[no-any-return]


class ByCode(Group):
    """Of the tables in a NamedTuple of all tables of a kind (see `tables_of`)."""

    def __init__(self, of_all: type) -> None:
        super().__init__()
        self._rows = tables_of(of_all)
        self._field_of = {cls: field for field, some, _ in _fields_of(of_all) for cls in some}

    def tables(self, of_all: Any) -> dict[int, Any]:
        """The tables that are there, by code."""
        found = {row.code: getattr(of_all, row.field) for row in self._rows}
        return {code: table for code, table in found.items() if table is not None}

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
            for number, field, _, m in self._rows
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
                    yield f"    return of_{field}({', '.join(given)})"
                yield f"return otherwise({', '.join([tables, *others])})"

            operation, body = self._add(otherwise, rows), kernel(otherwise)
            linked = functools.partial(operation.through_link, tables, code, body)
            chosen = self._chosen(otherwise, [tables, *others], rows, lines, linked, body)
            Operation.of[chosen] = operation
            return chosen

        return decorate

    def stage(self, own: str = "", only: Collection[int] | None = None) -> Callable[[F], F]:
        """Decorates f(table, kind, ...), a loop over a block of paths, which is called with the
        table of one type after another, and does nothing for an absent table.

        own: the name of a kernel that takes its place in modules that have one;  only: the codes of
        the types that have a kernel at all.
        """

        def decorate(function: F) -> F:
            parameters, body = ", ".join(parameters_of(function)), kernel(function)
            module, name = function.__module__, function.__name__
            text = f"def {name}({parameters}):\n    return\n"
            nothing = define(text, module, name, "for no table", {})
            left_out = [
                row.module for row in self._rows if only is not None and row.code not in only
            ]

            def of_type(module: Any) -> Any:
                has_none = any(module is other for other in left_out)
                return None if has_none else getattr(module, own, body)

            otherwise: Any = functools.wraps(function)(nothing)
            found: F = self(of_type)(otherwise)
            return found

        return decorate

    def _chosen(
        self,
        function: F,
        parameters: Sequence[str],
        rows: Sequence[Row],
        lines: Callable[[Sequence[Row]], Iterable[str]],
        linked: Callable[[], Callable[..., Any]],
        otherwise: Callable[..., Any],
    ) -> F:
        """The kernel that runs, for tables of which some are None, the text `lines` of the others;
        for a link, what `linked` returns; for one table, the kernel of its type.

        function: of which it has the name, the module and the docstring;  otherwise: the same as a
        kernel.
        """
        written: dict[Any, Callable[..., Any]] = {}
        field_of = self._field_of

        def write(key: Any, label: str, text: Iterable[str], known: Any) -> Callable[..., Any]:
            if key not in written:
                module, name = function.__module__, function.__name__
                whole = f"def {name}({', '.join(parameters)}):\n"
                whole += "".join(f"    {line}\n" for line in text)
                known = {"otherwise": otherwise, **known}
                written[key] = define(whole, module, name, label, known)
            return written[key]

        def of_all(is_present: Callable[[str], bool]) -> Callable[..., Any]:
            present = [row for row in rows if is_present(row.field)]
            fields = tuple(row.field for row in present)
            label = f"for {', '.join(fields) or 'no tables'}"
            return write(
                fields, label, lines(present), {f"of_{row.field}": row.kernel for row in present}
            )

        def of_one(cls: type) -> Callable[..., Any]:
            for row in rows:
                if row.field == field_of[cls]:
                    given = ", ".join([parameters[0], *parameters_of(row.kernel)[1:]])
                    text = [f"return of_{row.field}({given})"]
                    known = {f"of_{row.field}": row.kernel}
                    return write(cls, f"for a table of {row.field}", text, known)
            return otherwise

        @functools.wraps(function)
        def choose(tables: Any, *rest: Any) -> Any:
            if type(tables) in field_of:
                return of_one(type(tables))(tables, *rest)
            return of_all(lambda field: getattr(tables, field) is not None)(tables, *rest)

        @overload_kernel(choose)
        def _compiled(tables: Any, *rest: Any) -> Callable[..., Any]:
            if is_named_tuple(tables, Link):
                return linked()
            if tables.instance_class in field_of:
                return of_one(tables.instance_class)
            type_of = dict(zip(tables.fields, tables.types, strict=True))
            return of_all(lambda field: not isinstance(type_of[field], types.NoneType))

        return choose  # type: ignore[return-value]
