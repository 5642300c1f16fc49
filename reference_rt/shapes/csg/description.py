"""The tree of a solid as a scene describes it: its operands and its postfix program."""

from collections.abc import Iterator
from typing import Annotated

from pydantic import Field

from reference_rt.core.transform import Affine, affine, compose
from reference_rt.shapes import Primitive
from reference_rt.shapes.csg.tables import AND, NOT, OR
from reference_rt.shapes.instances import Instance
from reference_rt.shapes.shape import Difference, Intersection, Shape, Solid, Union

AnyOperand = Annotated[Primitive | Union | Intersection | Difference, Field(discriminator="type")]
AnyShape = Annotated[
    Primitive | Union | Intersection | Difference | Instance, Field(discriminator="type")
]

for _model in (Solid, Union, Intersection, Difference):
    _model.model_rebuild(_types_namespace={"AnyOperand": AnyOperand})


def operands_of(
    shape: Shape, outer: Affine, material: str | None, turned: bool = False
) -> Iterator[tuple[Shape, Affine, str | None, bool]]:
    """The primitive operands of a tree, from left to right: (shape, the map that is applied after
    its own transform, material, whether the solid's outside is its inside)."""
    material = shape.material if shape.material is not None else material
    if not isinstance(shape, Solid):
        yield shape, outer, material, turned
        return
    outer = compose(affine(shape.transform), outer)
    for k, operand in enumerate(shape.of):
        takes_away = isinstance(shape, Difference) and k > 0
        yield from operands_of(operand, outer, material, turned != takes_away)


def postfix(shape: Shape) -> list[int]:
    """The tree as a program: operands are numbered in the order of `operands_of`."""
    steps: list[int] = []
    count = 0

    def visit(part: Shape) -> None:
        nonlocal count
        if not isinstance(part, Solid):
            steps.append(count)
            count += 1
            return
        visit(part.of[0])
        for operand in part.of[1:]:
            visit(operand)
            if isinstance(part, Difference):
                steps.append(NOT)
            steps.append(OR if isinstance(part, Union) else AND)

    visit(shape)
    return steps
