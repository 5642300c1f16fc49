"""Generated choices: what is refused, and what tracebacks show.  Their values: `test_links`."""

from types import SimpleNamespace
from typing import Annotated, NamedTuple

import pytest

from reference_rt.jit.by_code import ByCode
from reference_rt.jit.kernel import kernel


class Adders(NamedTuple):
    number: float


@kernel
def _add(adders: Adders, x: float) -> float:
    return adders.number + x


class Tables(NamedTuple):
    adders: Annotated[Adders | None, SimpleNamespace(value=_add)]


by_code = ByCode(Tables)


@by_code("value")
def value(tables: Tables, kind: int, x: float) -> float:
    """The value of x."""
    return -x


def test_a_parameter_that_cannot_be_given_is_an_error():
    with pytest.raises(TypeError, match=r"_add, for adders: parameters \{'x'\} are none of those"):

        @by_code("value")
        def choice(tables: Tables, kind: int) -> float:
            return 0.0
