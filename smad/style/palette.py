"""The one palette, for pages in light and dark, for figures to print, and for other viewers.

A colour has a name for what it stands for. Pages use it as a CSS variable (`--x` is spring X),
figures and layouts by `in_print`.
"""

from collections.abc import Mapping
from typing import NamedTuple


class Colour(NamedTuple):
    """A colour on a light ground, and the same on a dark one, as #rrggbb."""

    light: str
    dark: str


PALETTE: Mapping[str, Colour] = {
    # Ground and text.
    "back": Colour("#ffffff", "#0f1419"),
    "raised": Colour("#f4f6f8", "#182028"),
    "line": Colour("#d0d7de", "#333d47"),
    "text": Colour("#1b1f24", "#e3e8ed"),
    "quiet": Colour("#57606a", "#98a4b0"),
    "link": Colour("#0b5cad", "#6cb2f5"),
    # What a person has to see.
    "stop": Colour("#c9190b", "#e5352b"),
    "stop-text": Colour("#ffffff", "#ffffff"),
    "bad": Colour("#b3140a", "#ff7b72"),
    "good": Colour("#1a7f37", "#4cc26b"),
    "warn-back": Colour("#fff4d6", "#3a2f12"),
    "bad-back": Colour("#ffe9e7", "#431a18"),
    # Quantities: spring X is warm, spring Y is cold, what was wanted is grey.
    "main": Colour("#0b5cad", "#6cb2f5"),
    "reference": Colour("#6e7781", "#98a4b0"),
    "x": Colour("#c2410c", "#fb923c"),
    "y": Colour("#0f766e", "#2dd4bf"),
    "limit": Colour("#b3140a", "#ff7b72"),
    "model": Colour("#8250df", "#c297ff"),
    # Runs that are compared.
    "run-1": Colour("#0b5cad", "#6cb2f5"),
    "run-2": Colour("#b45309", "#fbbf24"),
    "run-3": Colour("#047857", "#34d399"),
    "run-4": Colour("#a21caf", "#e879f9"),
    "run-5": Colour("#b91c1c", "#f87171"),
    "run-6": Colour("#57534e", "#d6d3d1"),
    # Cycles of one run: from the first by way of the middle one to the last.
    "cycle-first": Colour("#2c4fb0", "#7aa2ff"),
    "cycle-middle": Colour("#b0307f", "#f07ac0"),
    "cycle-last": Colour("#d97706", "#ffd166"),
}
_TYPE_SCALE: Mapping[str, str] = {
    "font": "15px/1.45 system-ui, sans-serif",
    "size-small": ".85rem",
    "size-h1": "1.6rem",
    "size-h2": "1.2rem",
    "size-h3": ".95rem",
}
_GROUND = "color-scheme: light dark;"


def in_print(name: str) -> str:
    """Return a colour as #rrggbb for a light ground. Raises KeyError for a name that is none."""
    return PALETTE[name].light


def checked_colour(name: str) -> str:
    """Return the name of a colour. Raises KeyError for one that is none: a page draws nothing."""
    if name not in PALETTE:
        raise KeyError(f"no colour is named {name!r}; there are {', '.join(PALETTE)}")
    return name


def css() -> str:
    """Return the style sheet with all colours and sizes as variables.

    Dark where the screen asks for it, never on paper; `:root.paper` is light on a screen, too.
    """
    light = _variables({name: colour.light for name, colour in PALETTE.items()})
    dark = _variables({name: colour.dark for name, colour in PALETTE.items()})
    return (
        f":root {{ {_GROUND} {light} {_variables(_TYPE_SCALE)} }}\n"
        f"@media screen and (prefers-color-scheme: dark) {{ :root:not(.paper) {{ {dark} }} }}\n"
        ":root.paper { color-scheme: light; }\n"
        "* { box-sizing: border-box; }\n"
        "[hidden] { display: none !important; }\n"
        "body { background: var(--back); color: var(--text); font: var(--font); }\n"
        ".uplot { font: inherit; }\n"
    )


def following(svg: str) -> str:
    """Return an SVG whose colours are those of the page that it stands in, light or dark.

    Black and white stand for text and ground. By itself the SVG is as it was.
    """
    names = {colour.light: name for name, colour in reversed(tuple(PALETTE.items()))}
    for value, name in (("#000000", "text"), ("#ffffff", "back"), *names.items()):
        for what in ("fill", "stroke"):
            svg = svg.replace(f"{what}: {value}", f"{what}: var(--{name}, {value})")
    return svg


def _variables(values: Mapping[str, str]) -> str:
    return " ".join(f"--{name}: {value};" for name, value in values.items())
