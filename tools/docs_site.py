"""Hook of mkdocs: pages from outside docs/, the README first, and links to other files made plain.

make site
"""

from __future__ import annotations

import posixpath
import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[1]
_LINK = re.compile(r"(!?)\[([^\]]*)\]\(([^)#\s]+)(#[^)\s]*)?\)")


OUTSIDE = {
    "README.md": "index.md",
    "examples/README.md": "examples.md",
    "evaluation/README.md": "evaluation.md",
    "evaluation/results/README.md": "results.md",
    "CHANGELOG.md": "changes.md",
    "CONTRIBUTING.md": "contributing.md",
}
"""Files outside docs/ that are pages of the site, and their names there."""


def on_files(files: Files, config: Any) -> Files:
    """Add the pages from outside docs/, their links as from the folder of the site."""
    for source, page in OUTSIDE.items():
        folder = posixpath.dirname(source)

        def moved(link: re.Match[str], folder: str = folder) -> str:
            picture, text, target, anchor = link.groups()
            if "://" in target:
                return link[0]
            path = posixpath.normpath(posixpath.join(folder, target))
            path = OUTSIDE.get(path, posixpath.relpath(path, "docs"))
            return f"{picture}[{text}]({path}{anchor or ''})"

        text = _LINK.sub(moved, (ROOT / source).read_text())
        files.append(File.generated(config, page, content=text))
    return files


def on_page_markdown(markdown: str, *, page: Any, config: Any, files: Files) -> str:
    """Turn links to files that the site does not have into their text."""
    folder = posixpath.dirname(page.file.src_uri)

    def kept(link: re.Match[str]) -> str:
        picture, text, target, anchor = link.groups()
        if "://" in target or target.startswith("mailto:"):
            return link[0]
        path = posixpath.normpath(posixpath.join(folder, target))
        if (inside := OUTSIDE.get(path.removeprefix("../"))) is not None and not picture:
            return f"[{text}]({posixpath.relpath(inside, folder or '.')}{anchor or ''})"
        return link[0] if files.get_file_from_path(path) is not None or picture else text

    return _LINK.sub(kept, markdown)
