"""`ByCode`: generates the kernels that choose among all types of shapes, or of materials.

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
"""

import functools
import inspect
import linecache
from collections.abc import Callable, Iterable, Sequence
from typing import Any, TypeVar

from numba import types

from reference_rt.jit.kernel import is_named_tuple, kernel, overload_kernel
from reference_rt.jit.links import STRIDE, Link, Operation, Row, executed, stop, word

F = TypeVar("F", bound=Callable[..., Any])


class ByCode:
    """rows: the code of each type, the field of its table, and the module that has its kernels, in
    the order in which codes are compared."""

    def __init__(self, rows: Iterable[tuple[int, str, Any]]) -> None:
        self._rows = tuple(rows)
        self.operations: dict[str, Operation] = {}

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
            parameters = _parameters(otherwise)
            for _, field, of_row in rows:
                unknown = set(_parameters(of_row)[1:]) - set(parameters[1:])
                if unknown:
                    raise TypeError(
                        f"{of_row.__module__}.{of_row.__name__}, for {field}: parameters {unknown} "
                        f"are none of those of {otherwise.__module__}.{otherwise.__name__}"
                    )

            def lines(present: Sequence[Row]) -> Iterable[str]:
                for number, field, of_row in present:
                    given = [f"{parameters[0]}.{field}", *_parameters(of_row)[1:]]
                    yield f"if {code} == {number}:"
                    yield f"    return {field}({', '.join(given)})"
                yield f"return otherwise({', '.join(parameters)})"

            number = len(self.operations) + 1
            operation = Operation(otherwise, number, rows, otherwise.__module__)
            self.operations[otherwise.__name__] = operation
            body = kernel(otherwise)
            linked = functools.partial(_linked, operation, parameters[0], code, body)
            return _generated(otherwise, parameters, rows, lines, linked, otherwise=body)

        return decorate

    def in_turn(self, step: Callable[..., Any]) -> Callable[..., Any]:
        """f(tables, ..., result): what step(code, table, ..., result) returns for the last table
        that is present, the result of each being passed to the next; no loop, so that the code and
        the type of the table are constants in each step."""
        _, _, *others = _parameters(step)
        given, result = ", ".join(others), others[-1]
        rows = [(number, field, step) for number, field, _ in self._rows]

        def lines(present: Sequence[Row]) -> Iterable[str]:
            for number, field, _ in present:
                yield f"{result} = {field}({number}, tables.{field}, {given})"
            yield f"return {result}"

        return _generated(step, ["tables", *others], rows, lines, None)


def _parameters(function: Callable[..., Any]) -> list[str]:
    return [*inspect.signature(function).parameters]


def _generated(
    function: F,
    parameters: Sequence[str],
    rows: Sequence[Row],
    lines: Callable[[Sequence[Row]], Iterable[str]],
    linked: Callable[[], Callable[..., Any]] | None,
    **names: Any,
) -> F:
    """The kernel that runs, for tables of which some are None, the text `lines` of the others.

    function: of which it has the name, the module and the docstring;  names: what the text uses
    beside the parameters and a kernel for each field.
    """
    written: dict[tuple[str, ...], Callable[..., Any]] = {}

    def write(is_present: Callable[[str], bool]) -> Callable[..., Any]:
        present = [row for row in rows if is_present(row[1])]
        fields = tuple(field for _, field, _ in present)
        if fields not in written:
            name = function.__name__
            text = f"def {name}({', '.join(parameters)}):\n"
            text += "".join(f"    {line}\n" for line in lines(present))
            file = f"<{function.__module__}.{name} for {', '.join(fields) or 'no tables'}>"
            linecache.cache[file] = len(text), None, text.splitlines(keepends=True), file
            known = {"__name__": function.__module__, **names}
            known |= {field: of_row for _, field, of_row in present}
            exec(compile(text, file, "exec"), known)
            written[fields] = known[name]
        return written[fields]

    @functools.wraps(function)
    def choose(tables: Any, *rest: Any) -> Any:
        return write(lambda field: getattr(tables, field) is not None)(tables, *rest)

    @overload_kernel(choose)
    def _compiled(tables: Any, *rest: Any) -> Callable[..., Any] | None:
        if is_named_tuple(tables, Link):
            return None if linked is None else linked()
        type_of = dict(zip(tables.fields, tables.types, strict=True))
        return write(lambda field: not isinstance(type_of[field], types.NoneType))

    return choose  # type: ignore[return-value]


def _linked(operation: Operation, tables: str, code: str, otherwise: Any) -> Callable[..., Any]:
    """The kernel for a link: it calls the operation of the type through its function pointer."""
    given = ", ".join(operation.parameters)
    comma = "," if len(operation.parameters) == 1 else ""
    most = max(operation.rows, default=-1)
    text = f"""def {operation.name}({tables}, {given}):
    code = {code}
    if 0 <= code <= {most}:
        pointer = word({tables}.address, {STRIDE} * code + {operation.number})
        if pointer < 0:
            stop()
        if pointer != 0:
            table = word({tables}.address, {STRIDE} * code)
            return call(pointer, table, ({given}{comma}))
    return otherwise({tables}, {given})
"""
    return executed(
        text, operation, call=operation.caller(), word=word, stop=stop, otherwise=otherwise
    )
