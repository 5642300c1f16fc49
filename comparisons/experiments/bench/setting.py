"""The options of a benchmark, common to all groups of rows."""

import os
from dataclasses import dataclass, field
from pathlib import Path

from reference_rt.rendering.render import Progress
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import UsageError


def _silent(what: str, fraction: float) -> None:
    pass


@dataclass(frozen=True)
class Setting:
    """scenes: folder of the suite's scenes;  mesh: file that rays are traced against, None for a
    generated mesh;  quick: fewer scenes and smaller pictures;  threads: of our renderer;  say:
    called with the progress."""

    scenes: Path = Path("scenes")
    mesh: Path | None = None
    quick: bool = False
    threads: int = field(default_factory=lambda: os.cpu_count() or 1)
    say: Progress = _silent

    def file(self, name: str) -> Path:
        """The file of a scene.  Raises UsageError."""
        path = self.scenes / f"{name}.yaml"
        if not path.is_file():
            raise UsageError(f"--scenes: there is no {path}; expected the folder of the scenes")
        return path

    def load(self, name: str) -> Scene:
        """A scene by name.  Raises UsageError, SceneError."""
        return Scene.load(self.file(name))

    def names(self) -> list[str]:
        """All scenes of the folder.  Raises UsageError for a folder without any."""
        found = sorted(path.stem for path in self.scenes.glob("*.yaml"))
        if not found:
            raise UsageError(f"--scenes: '{self.scenes}' holds no scene; expected .yaml files")
        return found
