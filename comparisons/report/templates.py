"""How every page is made: from a template, all text escaped, whole or not at all."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined, Template

from comparisons.report.values import label, shown
from reference_rt.files import replacing


def template(name: str, folder: str = "report", **filters: Callable[..., Any]) -> Template:
    """A template of a folder of `comparisons`, which may include what lies in `report`.

    filters: beside `shown` and `label`.
    """
    environment = Environment(
        loader=ChoiceLoader([PackageLoader("comparisons", each) for each in (folder, "report")]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"shown": shown, "label": label, **filters}
    return environment.get_template(name)


def encoded(page: str) -> bytes:
    """A lone surrogate, of a file name that is not UTF-8, becomes a reference to no character."""
    return page.encode(errors="xmlcharrefreplace")


def write(path: Path, page: str) -> None:
    """At once or not at all."""
    with replacing(path) as temporary:
        temporary.write_bytes(encoded(page))
