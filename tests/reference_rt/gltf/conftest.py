"""Images of glTF files are written to a cache of each test's own."""

import pytest


@pytest.fixture(autouse=True)
def _own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("REFERENCE_RT_CACHE", str(tmp_path / "cache"))
