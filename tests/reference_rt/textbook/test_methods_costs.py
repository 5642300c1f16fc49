"""The numbers of operations that docstrings state, counted."""

import collections
import math
import re

import numpy as np
import pytest
from method_checks import EXAMPLES

from reference_rt import textbook
from reference_rt.core.ray import Ray
from reference_rt.core.vec3 import Vec3
from reference_rt.textbook import box, polygon, sphere, triangle

_COUNTS: collections.Counter[str] = collections.Counter()


class Counted(float):
    """A float that counts its operations."""


def _counting(symbol, name):
    def operate(self, other):
        _COUNTS[symbol] += 1
        return Counted(getattr(float, name)(self, other))

    return operate


for _symbol, _names in {"+": "add sub radd rsub", "*": "mul rmul", "/": "truediv rtruediv"}.items():
    for _name in _names.split():
        setattr(Counted, f"__{_name}__", _counting(_symbol, f"__{_name}__"))


class CountedMath:
    inf, pi = math.inf, math.pi

    @staticmethod
    def sqrt(x):
        _COUNTS["sqrt"] += 1
        return Counted(math.sqrt(x))

    @staticmethod
    def atan2(y, x):
        _COUNTS["atan2"] += 1
        return Counted(math.atan2(y, x))

    @staticmethod
    def copysign(x, y):
        return Counted(math.copysign(x, y))


def stated(text):
    return {symbol: int(n) for n, symbol in re.findall(r"(\d+) (\+|\*|/|sqrt|atan2)", text)}


def counted(value):
    return type(value)(*map(Counted, value)) if isinstance(value, Vec3) else Counted(value)


HIT = Ray(Vec3(3.0, 0.1, 0.2), Vec3(-1.0, 0.05, 0.02), math.inf)
ACROSS = textbook.TriangleParameters((0.1, -1, -1), (0, 1.3, -1), (-0.1, 0, 1.4))


MODULES = {"sphere": sphere, "triangle": triangle, "box": box}


@pytest.mark.parametrize("name", [n for family in MODULES for n in textbook.names(family)])
def test_costs_are_as_stated(name, monkeypatch):
    family, _, method = name.partition(".")
    module = MODULES[family]
    shape = module.prepare({**EXAMPLES, "triangle": ACROSS}[family])
    monkeypatch.setattr(module, "math", CountedMath)
    _COUNTS.clear()
    ray = Ray(counted(HIT.o), counted(HIT.d), math.inf)
    assert 2.0 <= getattr(module, method)(ray, *map(counted, shape)) < 4.0
    doc = " ".join(getattr(module, method).__doc__.split())
    assert stated(re.search("Cost: ([^.;]*)", doc)[1]) == dict(_COUNTS)


@pytest.mark.parametrize("method", ["even_odd", "winding", "angle_sum"])
def test_costs_of_polygons_are_as_stated(method, monkeypatch):
    """A convex polygon: two edges span the line."""
    monkeypatch.setattr(polygon, "math", CountedMath)
    angles = np.arange(7) * 2 * np.pi / 7 + 0.1
    ring = np.stack([np.zeros(7), np.cos(angles), np.sin(angles)], axis=1)
    edges, normal, point, axis = polygon.prepare(textbook.PolygonParameters([ring]))
    boxed = np.array([[Counted(x) for x in edge] for edge in edges], dtype=object)
    _COUNTS.clear()
    ray = Ray(counted(HIT.o), counted(HIT.d), math.inf)
    assert 2.0 <= getattr(polygon, method)(ray, boxed, counted(normal), counted(point), axis) < 4.0
    doc = " ".join(getattr(polygon, method).__doc__.split())
    each, _, spanning = re.search("Cost: (.*?)[.] Fails", doc)[1].partition(";")
    plane = stated(re.search("beside (.*) for the plane", polygon.__doc__)[1])
    total = collections.Counter(plane)
    for symbol, n in stated(each).items():
        total[symbol] += 7 * n
    for symbol, n in stated(spanning).items():
        total[symbol] += 2 * n
    assert total == _COUNTS
