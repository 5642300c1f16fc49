"""What the site has beside the pages: the repository's link, the scene files, and formulas as
MathML, which browsers typeset themselves, without a script and without another server.

Pages link to `../scenes/NAME.yaml`, as the repository has them; the site has a copy.
"""

import html
import re
import subprocess
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File

SCENES = re.compile(r"\]\((?:\.\./)+(scenes/\w+\.yaml)\)")

FORMULA = re.compile(r'<(span|div) class="arithmatex">\\[([](.*?)\\[)\]]</\1>', flags=re.DOTALL)
"""As arithmatex leaves it: \\(...\\) in a line, \\[...\\] by itself."""


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


def on_page_content(page_html: str, page: Any, **_: Any) -> str:
    def typeset(found: re.Match[str]) -> str:
        tag, latex = found[1], html.unescape(found[2])
        display = "block" if tag == "div" else "inline"
        return f'<{tag} class="arithmatex">{convert(latex, display=display)}</{tag}>'

    typeset_page = FORMULA.sub(typeset, page_html)
    if (left := re.search(r'class="arithmatex">(?!<math).{,60}', typeset_page)) is not None:
        raise PluginError(f"{page.file.src_uri}: a formula that is none: {left[0]}")
    return typeset_page
