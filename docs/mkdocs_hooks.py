"""What the site has beside the pages: the repository's link, and the scene files that pages name.

Pages link to `../scenes/NAME.yaml`, as the repository has them; the site has a copy.
"""

import re
import subprocess
from typing import Any

from mkdocs.structure.files import File

SCENES = re.compile(r"\]\((?:\.\./)+(scenes/[\w/]+\.yaml)\)")


def on_config(config: Any) -> None:
    """The clone's remote is the repository."""
    asked = ["git", "config", "--get", "remote.origin.url"]
    found = subprocess.run(asked, capture_output=True, text=True, check=False).stdout.strip()
    url = re.sub(r"^git@([^:]+):", r"https://\1/", found).removesuffix(".git")
    if url.startswith("https://"):
        config.repo_url = url


def on_files(files: Any, config: Any) -> Any:
    named = {
        name for page in files.documentation_pages() for name in SCENES.findall(page.content_string)
    }
    for name in sorted(named):
        files.append(File(name, ".", config.site_dir, use_directory_urls=False))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    up = "../" * page.file.src_uri.count("/")
    return SCENES.sub(rf"]({up}\1)", markdown)
