"""The scenes that are stiff."""

from pathlib import Path

from reference_rt.rendering.scene import Scene

FOLDER = Path(__file__).parents[2] / "scenes"
STIFF = (
    *("planet", "needle", "far_origin", "tiny", "slivers", "grazing", "nested_glass"),
    *("csg_coincident", "index_matched", "bright_and_dim", "deep_mirrors", "near_delta"),
    *("tiny_light", "white_corridor"),
)


def scene(name: str) -> Scene:
    return Scene.load(FOLDER / f"{name}.yaml")
