"""`python -m comparisons.experiments.bench.million_worker MESH`: loads, builds and renders a large
mesh.

It is a separate process because the system reports the peak memory of a process.  Prints a JSON
object: seconds to "read" the file, to "build" the tables from its contents, and to "render" a small
picture; "peak": peak memory in MB (10^6 bytes), and "base": the peak before the mesh.
"""

import json
import re
import resource
import sys
import tempfile
import time
from pathlib import Path

from comparisons.experiments.bench.meshes import blob, write_ply
from reference_rt.cameras import Perspective
from reference_rt.integrators import Path as PathTracing
from reference_rt.lights import Constant
from reference_rt.materials import Diffuse
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Sobol
from reference_rt.scene.build import build_tables
from reference_rt.shapes import Mesh
from reference_rt.shapes.meshes.files import read_mesh


def scene_of(mesh: Path) -> Scene:
    """The mesh in clay under a white sky, 256 x 256 pixels, 4 samples each."""
    return Scene(
        camera=Perspective(eye=(0.9, 1.2, 4.5), target=(0.0, 0.0, 0.0), fov=40.0),
        sampler=Sobol(spp=4),
        integrator=PathTracing(max_depth=4),
        materials={"clay": Diffuse()},
        shapes=(Mesh(file=str(mesh), material="clay"),),
        lights=(Constant(radiance=(1.0, 1.0, 1.0)),),
    )


def peak() -> float:
    """The peak memory of this process, in MB."""
    status = Path("/proc/self/status")
    if status.exists():
        # On Linux a child inherits `ru_maxrss` of its parent; VmHWM starts at zero.
        found = re.search(r"VmHWM:\s+(\d+) kB", status.read_text(encoding="ascii"))
        if found:
            return int(found[1]) * 1024 / 1e6
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most / 1e6 if sys.platform == "darwin" else most * 1024 / 1e6


def main() -> None:
    mesh = Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory() as folder:
        small = Path(folder) / "small.ply"
        write_ply(small, blob(1000))
        render(scene_of(small))  # compile kernels, or load them from the cache
    base = peak()
    scene = scene_of(mesh)
    start = time.perf_counter()
    tables = build_tables(scene)
    built = time.perf_counter() - start
    seconds = render(scene, tables=tables).seconds["render"]
    most = peak()  # before the mesh is read a second time, for its time alone
    del tables
    start = time.perf_counter()
    read_mesh(mesh)
    read = time.perf_counter() - start
    found = {"read": read, "build": built - read, "render": seconds, "peak": most, "base": base}
    print(json.dumps(found))


if __name__ == "__main__":
    main()
