"""What the benchmark measures: meshes, rays and the machine."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from comparisons.experiments.bench import mesh_rays, program
from comparisons.experiments.bench.mesh_rays import blob, write_ply
from comparisons.experiments.bench.run import machine, vector_bits
from reference_rt.rendering import query
from reference_rt.rendering.scene import Scene
from reference_rt.shapes import Mesh
from reference_rt.shapes.meshes.files import read_mesh

SCENES = Path(__file__).parents[3] / "scenes"


def test_a_blob_is_closed_and_survives_its_file(tmp_path: Path) -> None:
    mesh = blob(1000)
    assert 1000 <= len(mesh.faces) < 1300
    corners = mesh.vertices[mesh.faces]
    volumes = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
    assert np.all(volumes > 0.0)  # counter-clockwise everywhere: seen from inside nothing is
    path = tmp_path / "blob.ply"
    write_ply(path, mesh)
    read = read_mesh(path)
    expected = mesh.vertices.astype("f4")[mesh.faces]
    assert np.array_equal(read.vertices[read.faces].astype("f4"), expected)


def test_coherent_rays_see_the_mesh_and_incoherent_ones_cross_it() -> None:
    vertices = blob(1000).vertices
    lower, upper = vertices.min(axis=0), vertices.max(axis=0)
    center, radius = (lower + upper) / 2.0, np.linalg.norm(upper - lower) / 2.0

    def distance(o: Any, d: Any) -> Any:
        return np.linalg.norm(np.cross(center - o, d), axis=1)

    o, d = mesh_rays.coherent(vertices, 32)
    assert len(o) == len(d) == 1024
    assert distance(o, d).min() < 0.1 * radius
    assert np.sum(d * np.roll(d, 1, axis=0), axis=1)[1:32].min() > 0.999  # neighbours in a row
    o, d = mesh_rays.incoherent(vertices, 500)
    assert np.linalg.norm(o - center, axis=1) == pytest.approx(np.full(500, radius))
    assert distance(o, d).max() < radius
    o, d, length = mesh_rays.chords(vertices, 500)
    assert np.linalg.norm(o + d * length[:, None] - center, axis=1) == pytest.approx(
        np.full(500, radius)
    )
    assert np.linalg.norm(d, axis=1) == pytest.approx(np.ones(500))


def test_closest_is_what_intersect_finds_on_any_number_of_threads(tmp_path: Path) -> None:
    path = tmp_path / "blob.ply"
    write_ply(path, blob(300))
    tables = Scene(shapes=(Mesh(file=str(path)),)).tables
    rays = mesh_rays.incoherent(blob(300).vertices, 40_000)  # three blocks
    one, two = (query.closest_primitives(tables, *rays, threads=n) for n in (1, 2))
    full = query.intersect(tables, *rays)
    for field in ("t", "kind", "row", "uv"):
        assert np.array_equal(getattr(one, field), getattr(two, field))
    assert np.array_equal(one.t, full.t)
    assert np.array_equal(one.kind < 0, full.shape < 0)
    assert 0.2 < np.mean(one.kind >= 0) < 0.9
    shadows = query.occluded(tables, *rays, threads=2)
    assert np.array_equal(shadows, one.kind >= 0)


@pytest.mark.slow
def test_the_program_reports_its_times(tmp_path: Path) -> None:
    found = program.Program(tmp_path).render(SCENES / "whitted_classic.yaml")
    assert found["wall"] > found["render"] > 0.0
    assert set(found) == {"wall", "build", "compile", "render"}


@pytest.mark.slow
def test_a_program_that_fails_is_reported(tmp_path: Path) -> None:
    with pytest.raises(Exception, match=r"nowhere\.yaml"):
        program.Program(tmp_path).render(tmp_path / "nowhere.yaml")


def test_the_machine_is_described() -> None:
    facts = machine()
    assert facts["cores"] >= 1
    assert vector_bits() in (128, 256, 512, None)
    assert {"machine", "system", "python", "numba", "memory_gib", "date"} <= set(facts)
