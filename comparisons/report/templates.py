"""Templates of pages: all text is escaped, and files are written whole or not at all."""

import json
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined, Template

from comparisons.report.values import flip, label, rows_of, shown, soft, typeset
from reference_rt.util.errors import UsageError, printable
from reference_rt.util.files import check_writable, not_utf8, read_text, replacing

# Replaces a marker block of a text file: what is between `<!-- NAME -->` and `<!-- end -->`.


END = "<!-- end -->"


def begin(name: str) -> str:
    """The marker at the block's beginning."""
    return f"<!-- {name} -->"


def rewrite(path: Path, name: str, text: str) -> None:
    """Replace the contents of the block `name` by `text`, which ends with a newline.

    Raises UsageError where the file cannot be read, or has no such block.
    """
    before, after = around(path, name)
    with replacing(path) as temporary:
        temporary.write_text(f"{before}{begin(name)}\n{text}{END}{after}", encoding="utf-8")


def check(path: Path, name: str) -> None:
    """Raise what `rewrite` would raise: called before long work whose result `rewrite` writes."""
    around(path, name)
    check_writable(path)


def around(path: Path, name: str) -> tuple[str, str]:
    """The text before and after the block.  Raises UsageError."""
    try:
        text = read_text(path)
    except OSError as error:
        raise UsageError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise UsageError(f"{path}: {not_utf8(error)}") from None
    before, first, rest = text.partition(begin(name))
    _, end, after = rest.partition(END)
    if not first or not end:
        raise UsageError(f"{path}: has no marker block; expected '{begin(name)}' and '{END}'")
    return before, after


@cache
def template(name: str, folder: str = "report", **filters: Callable[..., Any]) -> Template:
    """The template `name` in a folder of `comparisons`; it may include files of `report`.

    filters: in addition to those of `values`.
    """
    environment = Environment(
        loader=ChoiceLoader([PackageLoader("comparisons", each) for each in (folder, "report")]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"shown": shown, "label": label, "rows": rows_of, "json": json.dumps}
    environment.filters |= {"typeset": typeset, "flip": flip, "soft": soft, **filters}
    return environment.get_template(name)


_CONTROL = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")
"""Characters that HTML does not allow: control characters, surrogates, non-characters."""


def encoded(page: str) -> bytes:
    """The page in UTF-8; characters that HTML does not allow, which names may have, are escaped."""
    return _CONTROL.sub(lambda found: printable(found[0]), page).encode()


def write(path: Path, page: str) -> None:
    """Write the page, whole or not at all."""
    with replacing(path) as temporary:
        temporary.write_bytes(encoded(page))
