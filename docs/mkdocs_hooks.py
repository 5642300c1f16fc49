"""What the site has beside the pages: the repository's link, and the scene files.

Pages link to `../scenes/NAME.yaml`, as the repository has them; the site has a copy.
"""

import re
import subprocess
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File

SCENES = re.compile(r"\]\((?:\.\./)+(scenes/\w+\.yaml)\)")


def on_config(config: Any) -> None:
    """The clone's remote is the repository."""
    asked = ["git", "config", "--get", "remote.origin.url"]
    found = subprocess.run(asked, capture_output=True, text=True, check=False).stdout.strip()
    url = re.sub(r"^git@([^:]+):", r"https://\1/", found).removesuffix(".git")
    if url.startswith("https://"):
        config.repo_url = url


def on_files(files: Any, config: Any) -> None:
    for path in Path("scenes").glob("*.yaml"):
        files.append(File(str(path), ".", config.site_dir, use_directory_urls=False))


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    up = "../" * page.file.src_uri.count("/")
    return SCENES.sub(rf"]({up}\1)", markdown)
