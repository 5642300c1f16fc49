"""Files for machines, each written whole or not at all."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TextIO

from reference_rt.util.files import replacing


def write_json(path: Path, document: Any) -> None:
    """Write strict JSON (RFC 8259).  Raises ValueError for a number that is not finite."""
    text = json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False)
    with replacing(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")


@contextmanager
def csv_file(path: Path) -> Iterator[TextIO]:
    """Open a file for a `csv` writer."""
    with replacing(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        yield file
