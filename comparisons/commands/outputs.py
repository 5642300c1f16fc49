"""What commands write: checked before their work begins, and said at its end."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from comparisons.report import templates
from comparisons.report.plots import save
from reference_rt.cli.guarded import say
from reference_rt.util.files import check_writable, discard


@dataclass(frozen=True)
class Outputs:
    """What a command writes, as its options say.

    folder: of the files `names`, and of the folders `records`, which a later run reads;  markdown:
    a file, in whose block of this name a table is rewritten;  plots: a folder of .svg files;
    others: files elsewhere.
    """

    folder: Path
    names: tuple[str, ...]
    records: tuple[str, ...] = ()
    markdown: tuple[Path | None, str] = (None, "")
    plots: Path | None = None
    others: Sequence[Path | None] = ()

    @property
    def files(self) -> list[Path]:
        """Those of its folder."""
        return [self.folder / name for name in self.names]

    def check(self) -> None:
        """Raise ImageError where one of them cannot be written; UsageError where the block is
        missing."""
        kept = [self.folder / name / "a record" for name in self.records]
        plots = [] if self.plots is None else [self.plots / "a plot"]
        others = [path for path in self.others if path is not None]
        check_writable(*self.files, *kept, *plots, *others)
        path, block = self.markdown
        if path is not None:
            templates.check(path, block)

    def prepare(self) -> None:
        """Check them, and remove the files of an earlier run, which must not be mistaken for this
        one's.  Raises as `check`."""
        self.check()
        for file in self.files:
            discard(file)

    def finish(
        self,
        table: Callable[[], str] = str,
        plots: Callable[[], Mapping[str, str]] = dict,
        facts: Mapping[str, Any] | None = None,
    ) -> None:
        """Write the table and the plots if they are asked for, and say where the files are;
        facts: about the run, below each plot."""
        path, block = self.markdown
        if path is not None:
            templates.rewrite(path, block, table())
        if self.plots is not None:
            save(self.plots, plots(), facts or {})
        say(", ".join(map(str, self.files)), err=True)
