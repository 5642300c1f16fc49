"""Replaces a marker block of a text file: what is between `<!-- NAME -->` and `<!-- end -->`."""

from pathlib import Path

from reference_rt.util.errors import UsageError
from reference_rt.util.files import check_writable, read_text, replacing

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
    except UnicodeDecodeError:
        raise UsageError(f"{path}: is not text; expected UTF-8") from None
    before, first, rest = text.partition(begin(name))
    _, end, after = rest.partition(END)
    if not first or not end:
        raise UsageError(f"{path}: has no marker block; expected '{begin(name)}' and '{END}'")
    return before, after
