"""The base of everything in a scene file: the frozen model `Description` and the field types.

Scene files contain plain data.  Python code may pass arrays: NumPy's, and those of any library
whose objects have the method `__array__`.
"""

import ast
import hashlib
import inspect
import json
import math
import os
import re
import sys
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from itertools import pairwise
from textwrap import fill
from types import ModuleType
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    ClassVar,
    Literal,
    Self,
    cast,
    get_args,
    get_origin,
    get_type_hints,
)

import numpy as np
import numpy.typing as npt
from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    PlainSerializer,
    PlainValidator,
    SerializationInfo,
    Strict,
    ValidationError,
    WithJsonSchema,
)
from pydantic.fields import FieldInfo

from reference_rt.core.diagnosis import scene_error
from reference_rt.util.errors import SceneError, is_help

AS_DIGEST = {"arrays": "digest"}
"""The context of `model_dump_json` that writes an array as a digest of its content: descriptions
are compared without writing millions of numbers."""


def plain(value: Any) -> Any:
    """`value` with arrays and NumPy scalars replaced by Python's numbers and lists, and paths by
    strings, at any depth in lists, tuples and dictionaries.

    Arrays of anything but numbers, booleans and strings stay as they are: strict validation then
    reports them with their keys.
    """
    convert = _converter(type(value))  # type: ignore[arg-type]
    return value if convert is None else convert(value)


@cache
def _converter(kind: type) -> Callable[[Any], Any] | None:
    """The function that makes values of a type plain; None for types that need no conversion."""
    if kind is list or kind is tuple:
        return lambda value: kind([plain(item) for item in value])
    if kind is dict:
        return lambda value: {key: plain(item) for key, item in value.items()}
    if issubclass(kind, os.PathLike):
        return os.fspath
    if issubclass(kind, np.ndarray | np.generic):
        return _listed
    if hasattr(kind, "__array__"):
        return lambda value: _listed(np.asarray(value))
    return None


def _listed(array: Any) -> Any:
    if array.dtype.kind not in "biufU":
        return array
    if array.dtype.kind == "f" and array.dtype.itemsize > 8:  # longdouble has no Python number
        array = array.astype(np.float64)
    return array.tolist()


def _rows(width: int, integers: bool, or_more: bool = False) -> Callable[[Any], npt.NDArray[Any]]:
    """or_more: whether rows may have a multiple of `width` numbers."""
    kinds, dtype = ("iu", np.int64) if integers else ("iuf", np.float64)
    numbers = "integers" if integers else "finite numbers"
    columns = f"{width} k" if or_more else str(width)
    expected = f"expected an (n, {columns}) array, or a list of n rows, of {numbers}"

    def check(value: Any) -> npt.NDArray[Any]:
        try:
            found = value if isinstance(value, np.ndarray) else np.asarray(value)
        except (ValueError, TypeError):  # rows of different lengths
            raise ValueError(expected) from None
        is_wide = found.ndim == 2 and (
            found.shape[1] == width or (or_more and found.shape[1] > 0 == found.shape[1] % width)
        )
        if not is_wide or found.dtype.kind not in kinds:
            raise ValueError(f"{expected}, got {found.dtype} of shape {found.shape}")
        if isinstance(found, np.ma.MaskedArray) and np.ma.is_masked(found):
            raise ValueError(f"{expected}, got a masked array")
        array = np.array(found, dtype, order="C", subok=False)
        finite = np.isfinite(array).all(axis=1)
        if not finite.all():
            raise ValueError(f"{expected}; row {int(np.argmin(finite))} is not finite")
        array.flags.writeable = False
        return array

    return check


def _written(array: npt.NDArray[Any], info: SerializationInfo) -> Any:
    if info.context == AS_DIGEST:
        content = hashlib.sha256(array.tobytes()).hexdigest()
        return f"{array.dtype} {array.shape} {content}"
    return array.tolist()


def _schema(width: int, item: str, or_more: bool = False) -> WithJsonSchema:
    row = {"type": "array", "items": {"type": item}, "minItems": width}
    row |= {} if or_more else {"maxItems": width}
    return WithJsonSchema({"type": "array", "items": row})


_AS_LISTS = PlainSerializer(_written, when_used="json")

Floats2 = Annotated[
    npt.NDArray[np.float64], PlainValidator(_rows(2, False)), _AS_LISTS, _schema(2, "number")
]
"""(n, 2) finite float64, copied and read-only; lists in scene files."""

Floats2s = Annotated[
    npt.NDArray[np.float64],
    PlainValidator(_rows(2, False, or_more=True)),
    _AS_LISTS,
    _schema(2, "number", or_more=True),
]
"""(n, 2 k) finite float64 for any k > 0, as `Floats2`."""

Floats3 = Annotated[
    npt.NDArray[np.float64], PlainValidator(_rows(3, False)), _AS_LISTS, _schema(3, "number")
]
"""(n, 3) finite float64, as `Floats2`."""

Integers3 = Annotated[
    npt.NDArray[np.int64], PlainValidator(_rows(3, True)), _AS_LISTS, _schema(3, "integer")
]
"""(n, 3) int64, as `Floats2`."""


# ---- what each field of a description means: the docstrings below the fields, at run time --------
#
# Pydantic's `use_attribute_docstrings` parses the sources of all descriptions at import, which
# would be 0.13 s of every start.  Here a source file is parsed when its first description is asked
# for.


def field_texts(cls: type[BaseModel]) -> dict[str, str]:
    """The meaning of each field, by its name; of a field that a class inherits, the class's own
    docstring if it has one.

    A field `type` that allows one word needs no docstring.  Fields without a text, and those of
    classes without a source file, are left out.
    """
    found = {}
    for name, field in cls.__pydantic_fields__.items():
        if name == "type" and get_origin(field.annotation) is Literal:
            found[name] = f"The name of this type: `{get_args(field.annotation)[0]}`."
    for base in reversed(cls.__mro__):
        texts = _docstrings(base.__module__).get(base.__qualname__, {})
        found |= {name: text for name, text in texts.items() if name in cls.__pydantic_fields__}
    return found


class DescribedFields:
    """The attribute `model_fields` of descriptions: pydantic's fields with `description` set."""

    def __get__(self, instance: Any, owner: type[BaseModel]) -> Mapping[str, FieldInfo]:
        fields = owner.__pydantic_fields__
        if any(field.description is None for field in fields.values()):
            for name, text in field_texts(owner).items():
                fields[name].description = text
        return fields


@cache
def _docstrings(module: str) -> dict[str, dict[str, str]]:
    """Of all classes of a module, by qualified name: the docstring below each annotated field."""
    try:
        tree = ast.parse(inspect.getsource(sys.modules[module]))
    except (OSError, TypeError, KeyError, SyntaxError):  # built in, or typed at a prompt
        return {}
    return dict(_classes(tree, ""))


def _classes(tree: ast.AST, prefix: str) -> Iterator[tuple[str, dict[str, str]]]:
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.ClassDef):
            yield prefix + node.name, _fields(node)
            yield from _classes(node, f"{prefix}{node.name}.")
        elif isinstance(node, ast.FunctionDef):
            yield from _classes(node, f"{prefix}{node.name}.<locals>.")


def _fields(cls: ast.ClassDef) -> dict[str, str]:
    return {
        line.target.id: inspect.cleandoc(below.value.value)
        for line, below in pairwise(cls.body)
        if isinstance(line, ast.AnnAssign)
        and isinstance(line.target, ast.Name)
        and isinstance(below, ast.Expr)
        and isinstance(below.value, ast.Constant)
        and isinstance(below.value.value, str)
    }


if TYPE_CHECKING:
    from pydantic._internal._model_construction import ModelMetaclass
else:
    ModelMetaclass = type(BaseModel)


class _Helped(ModelMetaclass):
    """What `help` shows of a description: its fields and what they mean, and the names of its
    methods, in place of the hundred methods and attributes of pydantic."""

    @property
    def __doc__(self) -> str:  # type: ignore[override]
        text = inspect.cleandoc(vars(self).get("__doc__") or "")
        if "__pydantic_fields__" not in vars(self):
            return text  # while the class is made
        fields = vars(self)["__pydantic_fields__"]
        parts = [
            f"{name}: {' '.join(meaning.split())}"
            for name, meaning in field_texts(cast(type[BaseModel], self)).items()
            if name != "type"
        ]
        if "type" not in fields:  # the methods of others are for the tables
            own = {n: None for base in self.__mro__ if base is not Description for n in vars(base)}
            hidden = {*dir(BaseModel), *fields}
            methods = [n for n in own if n[0] != "_" and n not in hidden]
            parts += [f"methods: {', '.join(methods)}"] if methods else []
        return "\n".join([text, "", *(fill(p, 98, subsequent_indent="    ") for p in parts)])

    @property
    def __signature__(self) -> inspect.Signature:
        """Names and defaults; the types, those of pydantic, would take a page."""
        empty, fields = inspect.Parameter.empty, cast(type[BaseModel], self).__pydantic_fields__
        defaults = {
            name: empty if field.is_required() else field.get_default(call_default_factory=True)
            for name, field in fields.items()
        }
        kind = inspect.Parameter.KEYWORD_ONLY
        return inspect.Signature(
            [inspect.Parameter(name, kind, default=one) for name, one in defaults.items()]
        )

    @__signature__.setter
    def __signature__(self, own: object) -> None:
        """Pydantic sets one."""

    def __dir__(self) -> Any:
        return [] if is_help() else super().__dir__()


Examples = tuple[dict[str, Any], ...]


class Description(BaseModel, metaclass=_Helped):
    """A frozen part of a scene.  Unknown keys, wrong types, NaN and infinity are errors.

    In Python, arrays, NumPy scalars and paths may replace lists, numbers and strings.  Every error
    is a `SceneError`, whose `path` leads from this description to the wrong value.
    """

    model_config: ClassVar[ConfigDict] = ConfigDict(
        frozen=True, extra="forbid", strict=True, allow_inf_nan=False
    )
    EXAMPLES: ClassVar[Examples] = ({},)
    """The fields of a few descriptions that cover the options of a type.  What they name is in
    `reference_rt.scene.examples`."""
    array_fields: ClassVar[frozenset[str]] = frozenset()
    """Names of the fields that take arrays without conversion to lists."""

    def __init__(self, /, **fields: Any) -> None:
        as_arrays = type(self).array_fields
        self._checked(
            {name: v if name in as_arrays else _plain(v) for name, v in fields.items()},
            instance=self,
        )

    # Without this, pydantic would call `__init__` for every part of a scene file.  Files contain
    # plain data, which need no conversion: it would be slow for scenes of 100,000 shapes.
    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]

    @classmethod
    def _checked(cls, data: Any, instance: Self | None = None) -> Self:
        """A description from plain data.  Raises SceneError with the keys of the wrong value."""
        try:
            found: Self = cls.__pydantic_validator__.validate_python(data, self_instance=instance)
        except ValidationError as error:
            raise scene_error(cls, error, data) from None
        return found

    @classmethod
    def model_validate(cls, obj: Any, **options: Any) -> Self:
        """A description from a dictionary.  Raises SceneError, as the constructor does."""
        data = _plain(obj)
        try:
            return super().model_validate(data, **options)
        except ValidationError as error:
            raise scene_error(cls, error, data) from None

    @classmethod
    def model_validate_json(cls, json_data: str | bytes | bytearray, **options: Any) -> Self:
        """A description from JSON text.  Raises SceneError, as the constructor does."""
        try:
            data = json.loads(json_data)
        except ValueError as error:
            raise SceneError(f"malformed JSON: {error}") from None
        return cls.model_validate(data, **options)

    if not TYPE_CHECKING:  # type checkers know that fields are frozen
        model_fields: ClassVar[Any] = DescribedFields()

        def __setattr__(self, name: str, value: Any) -> None:
            try:
                super().__setattr__(name, value)
            except ValidationError:
                raise _frozen(self, name) from None

        def __delattr__(self, name: str) -> None:
            try:
                super().__delattr__(name)
            except ValidationError:
                raise _frozen(self, name) from None

    @classmethod
    def __get_pydantic_json_schema__(
        cls, core_schema: Any, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """The JSON Schema, with the docstrings below the fields as their descriptions."""
        schema = handler(core_schema)
        handler.resolve_ref_schema(schema)["description"] = inspect.cleandoc(
            vars(cls).get("__doc__") or ""
        )
        properties = handler.resolve_ref_schema(schema).get("properties", {})
        for field, text in field_texts(cls).items():
            if field in properties:
                properties[field]["description"] = text
        return schema


def _plain(value: Any) -> Any:
    try:
        return plain(value)
    except RecursionError:
        raise SceneError("nested too deeply; expected fewer levels") from None


def _frozen(description: Description, name: str) -> SceneError:
    kind = type(description).__name__
    return SceneError(f"a {kind} is frozen; expected a new {kind} with another '{name}'", (name,))


def _three_numbers(value: Any) -> Any:
    is_number = [isinstance(x, int | float) and not isinstance(x, bool) for x in _items(value)]
    if len(is_number) != 3 or not all(is_number):
        raise ValueError("expected three numbers [x, y, z]")
    try:
        return tuple(float(x) for x in value)
    except OverflowError:
        raise ValueError("expected finite numbers") from None


_HEX = re.compile("#[0-9a-fA-F]{6}")


def as_linear(value: Any) -> str:
    """Of a colour as web pages write it, "#aabbcc": ", here [r, g, b]"; else nothing."""
    if not isinstance(value, str) or not _HEX.fullmatch(value):
        return ""
    encoded = [int(value[k : k + 2], 16) / 255.0 for k in (1, 3, 5)]
    rgb = [x / 12.92 if x <= 0.04045 else ((x + 0.055) / 1.055) ** 2.4 for x in encoded]
    return f", here [{', '.join(f'{x:.3g}' for x in rgb)}]"


def colour(value: Any) -> Any:
    """Linear sRGB of at least 0 from one number or three.  Raises ValueError."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        value = (value, value, value)
    try:
        rgb = _three_numbers(value)
    except ValueError:
        message = f"expected one number or three [r, g, b] (linear sRGB){as_linear(value)}"
        raise ValueError(message) from None
    if not all(x >= 0.0 for x in rgb):  # also refuses NaN
        raise ValueError("expected numbers of at least 0")
    return rgb


def reflectance(value: Any) -> Any:
    """The same, of at most 1."""
    rgb = colour(value)
    if max(rgb) > 1.0:
        raise ValueError("expected numbers from 0 to 1: more would create energy")
    return rgb


def _unit_free_direction(value: Any) -> Any:
    v = _three_numbers(value)
    if not 0.0 < math.hypot(*v) < math.inf:
        raise ValueError("expected a direction, which is not zero and of a finite length")
    return v


def _items(value: Any) -> list[Any]:
    return list(value) if isinstance(value, list | tuple) else []


_Triple = Annotated[tuple[float, float, float], Strict(False)]
_VECTOR = {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3}


def colour_schema(maximum: float | None) -> dict[str, Any]:
    """The JSON Schema of a colour of at most `maximum`."""
    number: dict[str, Any] = {"type": "number", "minimum": 0}
    if maximum is not None:
        number["maximum"] = maximum
    return {"anyOf": [number, {**_VECTOR, "items": number}]}


Vector = Annotated[_Triple, BeforeValidator(_three_numbers), WithJsonSchema(_VECTOR)]
"""[x, y, z] in scene units."""

Direction = Annotated[_Triple, BeforeValidator(_unit_free_direction), WithJsonSchema(_VECTOR)]
"""[x, y, z], not zero, of any length."""

Colour = Annotated[_Triple, BeforeValidator(colour), WithJsonSchema(colour_schema(None))]
"""Linear sRGB, each at least 0; a single number stands for grey."""

Reflectance = Annotated[_Triple, BeforeValidator(reflectance), WithJsonSchema(colour_schema(1.0))]
"""Linear sRGB, each from 0 to 1; a single number stands for grey."""

Positive = Annotated[float, Field(gt=0)]


def types_of(union: Any) -> tuple[Any, ...]:
    """The types of descriptions in a union, such as `AnyShape`, in its order; or the one type."""
    of = get_args(union)[0] if get_origin(union) is Annotated else union
    return get_args(of) or (of,)


def name_of(description: type[Description]) -> str:
    """The name of a type in scene files, its field `type`."""
    return str(description.__pydantic_fields__["type"].default)


def setups_of(union: Any) -> dict[type, type[Description]]:
    """The classes that `setup` of a union's types returns, each with the first such type."""
    of: dict[type, type[Description]] = {}
    for cls in types_of(union):
        if hasattr(cls, "setup"):
            made = get_type_hints(cls.setup)["return"]
            for setup in get_args(made) or (made,):
                of.setdefault(setup, cls)
    return of


def module_of(cls: type) -> ModuleType:
    """The module that defines a class, and the kernels that take it."""
    return sys.modules[cls.__module__]
