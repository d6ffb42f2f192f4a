"""Hook of mkdocs: pages from outside docs/, links, equations, navigation, and no network.

make site
"""

from __future__ import annotations

import html
import posixpath
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files

from smad.style.palette import PALETTE

ROOT = Path(__file__).resolve().parents[1]
OUTSIDE = {
    "README.md": "index.md",
    "examples/README.md": "examples.md",
    "evaluation/README.md": "evaluation.md",
    "evaluation/results/README.md": "results.md",
    "CHANGELOG.md": "changes.md",
    "CONTRIBUTING.md": "contributing.md",
}
"""Pages of the repository that are not in docs/, and their place in the site."""
VENDORED = ROOT / "tools" / "site"
"""What a page takes from elsewhere: a font for equations, and what search needs in plain files."""
LISTED = {"Experiments": "experiments", "Decisions": "decisions"}
"""Sections of the navigation that are all pages of a folder, the overview first."""
_WORKER = "https://unpkg.com/iframe-worker/shim"
"""What the theme's search takes from a network to run in pages that are files; ours is vendored."""
_FROM_ELSEWHERE = re.compile(r"""<(?:script|link|img|iframe)[^>]+(?:src|href)=["']?https?:[^>]*>""")
_SOURCE = {place: source for source, place in OUTSIDE.items()}
_LINK = re.compile(r"(!?)\[([^\]]*)\]\(([^)#\s]+)(#[^)\s]*)?\)")
_PICTURE = re.compile(r'((?:src|srcset)=")docs/')
"""In a `<picture>` of README, which shows another file in a dark page."""
_EQUATION = re.compile(
    r'<(div|span) class="arithmatex">\\([\[(])(.*?)\\[\])]</\1>', re.DOTALL
)  # as pymdownx.arithmatex marks them

_MERMAID = re.compile(r"^```mermaid\n(.*?)^```$", re.DOTALL | re.MULTILINE)
_ARROW = re.compile(r"^ *(\S+?) *--> *(?:\|(.*?)\|)? *(\w+)(?:: (.*))?$", re.MULTILINE)
_AS_IT_IS = re.compile(r"(<(code|pre|math|script)\b.*?</\2>|<[^>]*>)", re.DOTALL)
_SYMBOL = re.compile(r"(?<![A-Za-z0-9_.])([A-Za-zα-ω])_([A-Za-z0-9]{1,4}(?:,[a-z0-9]\b)?)(?!\w)")


def on_config(config: Any) -> Any:
    """Fill the sections of `LISTED` in the navigation."""
    docs = Path(config.docs_dir)
    for section in config.nav:
        for name, folder in LISTED.items():
            if name in section:
                pages = sorted(path.name for path in (docs / folder).glob("*.md"))
                pages.sort(key="README.md".__ne__)
                section[name] = [f"{folder}/{page}" for page in pages]
    return config


def on_files(files: Files, config: Any) -> Files:
    """Add the pages from outside docs/, and the colours of all our pages."""
    files.append(File.generated(config, "site.css", content=site_css()))
    for path in VENDORED.iterdir():
        files.append(File.generated(config, path.name, content=path.read_bytes()))
    for source, place in OUTSIDE.items():
        files.append(File.generated(config, place, content=(ROOT / source).read_text()))
    return files


def on_page_markdown(markdown: str, *, page: Any, config: Any, files: Files) -> str:
    """Lead links to where the site has their page; one that it has not becomes its text."""
    place = page.file.src_uri
    source = _SOURCE.get(place, f"docs/{place}")

    def with_place(link: re.Match[str]) -> str:
        picture, text, target, anchor = link.groups()
        if "://" in target or target.startswith("mailto:"):
            return link[0]
        goal = posixpath.normpath(posixpath.join(posixpath.dirname(source), target))
        goal = OUTSIDE.get(goal, goal.removeprefix("docs/"))
        if files.get_file_from_path(goal) is None:
            return link[0] if picture else text
        way = posixpath.relpath(goal, posixpath.dirname(place) or ".")
        return f"{picture}[{text}]({way}{anchor or ''})"

    return _PICTURE.sub(r"\1", _LINK.sub(with_place, _MERMAID.sub(transitions, markdown)))


def transitions(drawn: re.Match[str]) -> str:
    """A Mermaid diagram of states as a table: its script would have to come from a network."""
    rows = ["| from | to | when |", "| --- | --- | --- |"]
    for state, label, then, when in _ARROW.findall(drawn[1]):
        rows.append(f"| {state.replace('[*]', 'power on')} | {then} | {label or when} |")
    return "\n".join(rows)


def on_page_content(content: str, *, page: Any, **_: Any) -> str:
    """Set equations as MathML, which a browser draws by itself, and subscripts of symbols."""

    def equation(marked: re.Match[str]) -> str:
        block = marked[2] == "["
        text = mathml(html.unescape(marked[3]), block=block)
        return f'<div class="equation">{text}</div>' if block else text

    content = _EQUATION.sub(equation, content)
    # Docstrings name variables.
    return content if page.file.src_uri.startswith("api/") else subscripted(content)


def subscripted(content: str) -> str:
    """Set the subscripts of symbols in the text of a page: ξ_S, but nothing in code."""
    parts = _AS_IT_IS.split(content)
    # Text, then what stays as it is, then the name of its tag, and again.
    return "".join(
        _SYMBOL.sub(r"\1<sub>\2</sub>", part) if k % 3 == 0 else part
        for k, part in enumerate(parts)
        if part is not None and k % 3 != 2
    )


def on_post_page(output: str, *, page: Any, **_: Any) -> str:
    """Take everything from the site itself. Raises PluginError for what is not there."""
    up = posixpath.relpath(".", posixpath.dirname(page.file.dest_uri) or ".")
    return _local(output, up, page.file.src_uri)


def on_post_template(output: str, *, template_name: str, **_: Any) -> str:
    """The same for the page of a page that is not found."""
    return _local(output, ".", template_name) if template_name.endswith(".html") else output


def _local(output: str, up: str, name: str) -> str:
    output = output.replace(_WORKER, f"{up}/iframe-worker.js")
    if foreign_tag := _FROM_ELSEWHERE.search(output):
        raise PluginError(f"{name} takes something from a network: {foreign_tag[0]}")
    return output


_WIDE = ".md-typeset__table, .equation, .md-typeset pre > code"
_SHADOWS = (
    "background: linear-gradient(90deg, var(--md-default-bg-color) 30%, transparent) 0 0, "
    "linear-gradient(270deg, var(--md-default-bg-color) 30%, transparent) 100% 0, "
    "linear-gradient(90deg, #8886, transparent) 0 0, "
    "linear-gradient(270deg, #8886, transparent) 100% 0; "
    "background-repeat: no-repeat; "
    "background-size: 2.5rem 100%, 2.5rem 100%, .8rem 100%, .8rem 100%; "
    "background-attachment: local, local, scroll, scroll;"
)


def site_css() -> str:
    """Return the theme's colours, taken from our palette."""

    def shades(colours: Mapping[str, str]) -> str:
        return (
            f"--md-primary-fg-color: {colours['main']}; --md-accent-fg-color: {colours['x']}; "
            f"--md-typeset-a-color: {colours['link']};"
        )

    light = shades({name: colour.light for name, colour in PALETTE.items()})
    dark = shades({name: colour.dark for name, colour in PALETTE.items()})
    # A bar as light as the links of a dark page could not be read over.
    dark_bar = f"--md-primary-fg-color: {PALETTE['raised'].dark};"
    return (
        f"[data-md-color-scheme=default] {{ {light} }}\n"
        f"[data-md-color-scheme=slate] {{ {dark} {dark_bar} "
        f"--md-default-bg-color: {PALETTE['back'].dark}; }}\n"
        "@font-face { font-family: 'STIX Two Math'; src: url(stix-two-math.woff2); }\n"
        "math { font-family: 'STIX Two Math', math; font-size: 1.1em; }\n"
        ".equation { margin: 1em 0; padding-bottom: .6em; overflow-y: hidden; }\n"
        ".md-typeset__table { display: block; }\n"
        ".md-typeset h1 { color: inherit; }\n"
        # What is wider than a phone scrolls by itself; a shadow at an edge says that there is more.
        f"{_WIDE} {{ overflow-x: auto; {_SHADOWS} }}\n"
        "@media print { pre, pre code { white-space: pre-wrap; overflow-wrap: anywhere; } }\n"
    )


def mathml(tex: str, *, block: bool) -> str:
    """Return an equation in TeX as an element of MathML."""
    return str(convert(tex.strip(), display="block" if block else "inline"))
