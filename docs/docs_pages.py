"""What the scripts of this folder share: where the pages are, how pictures are stored, and how what
a page shows is run."""

import io
import re
from collections.abc import Callable, Iterator
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from PIL import Image

from reference_rt.util.files import replacing

DOCS = Path(__file__).parent


def save(path: Path, values: npt.NDArray[np.uint8]) -> None:
    """Write (height, width, 3) pixels as a JPEG file."""
    data = io.BytesIO()
    Image.fromarray(values).save(data, "JPEG", quality=88, optimize=True)
    with replacing(path) as temporary:
        temporary.write_bytes(data.getvalue())


class Block(NamedTuple):
    """A block of code.  title: the file that it is, or for Python that it is from."""

    language: str
    title: str
    text: str


def blocks_of(page: Path) -> list[Block]:
    """Those of a page, in order."""
    text = page.read_text(encoding="utf-8")
    found = re.findall(r'^```(\w+)(?: title="(.*?)")?\n(.*?)^```$', text, re.DOTALL | re.MULTILINE)
    return [Block(*each) for each in found]


def run(page: Path, shell: Callable[[str], object]) -> Iterator[tuple[str, str]]:
    """Run what a page of the course shows, in the current folder: YAML with a title becomes a file,
    Python without one runs in a namespace of the page, and `shell` takes each command.  Yields what
    each block printed, and what the page says that it prints: the block of text after it.
    """
    names, blocks = dict[str, Any](), blocks_of(page)
    for k, block in enumerate(blocks):
        printed = io.StringIO()
        if block.language == "yaml" and block.title:
            Path(block.title).write_text(block.text, encoding="utf-8")
        elif block.language == "python" and not block.title:
            with redirect_stdout(printed):
                exec(compile(block.text, str(page), "exec"), names)
        elif block.language == "sh":
            list(map(shell, block.text.splitlines()))
        after = blocks[k + 1] if k + 1 < len(blocks) else Block("", "", "")
        yield printed.getvalue(), after.text if after.language == "text" else ""
