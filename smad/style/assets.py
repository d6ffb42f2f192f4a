"""The files of the look: for a server that hands them out, and inside a page of one file."""

import re
from collections.abc import Mapping
from pathlib import Path

from smad.style.palette import css

_STATIC = Path(__file__).parent / "static"
_UPLOT_EXPORT = "export { uPlot as default };"
_IMPORT = re.compile(r"^import .*?;\n", re.MULTILINE | re.DOTALL)
_PLOTS = ("vendor/font.js", "plots.js", "sheet.js", "plane.js", "panels.js")
_KINDS = {
    ".html": "text/html",
    ".js": "text/javascript",
    ".css": "text/css",
    ".txt": "text/plain",
}


def files() -> Mapping[str, tuple[str, bytes]]:
    """Return each file by its path, with its content type: `style.css`, `plots.js`, vendored."""
    return {**files_in(_STATIC), "style.css": (f"{_KINDS['.css']}; charset=utf-8", css().encode())}


def files_in(folder: Path) -> dict[str, tuple[str, bytes]]:
    """Return each file of a folder that a page may ask for, as `files` does."""
    return {
        path.relative_to(folder).as_posix(): (
            f"{_KINDS[path.suffix]}; charset=utf-8",
            path.read_bytes(),
        )
        for path in sorted(folder.rglob("*"))
        if path.suffix in _KINDS
    }


def style(*, plots: bool) -> str:
    """Return the style sheet of a page of one file; `plots`: with what plots need."""
    return css() + (_text("vendor/uPlot.css") if plots else "")


def script() -> str:
    """Return uPlot and all that draws with it as one script: a page of one file cannot import."""
    ours = [_IMPORT.sub("", _text(name)).replace("export ", "") for name in _PLOTS]
    uplot = _text("vendor/uPlot.js").replace(_UPLOT_EXPORT, "return uPlot;")
    return "\n".join([f"const uPlot = (() => {{\n{uplot}}})();", *ours])


def _text(name: str) -> str:
    return (_STATIC / name).read_text("utf-8")
