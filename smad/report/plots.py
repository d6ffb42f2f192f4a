"""Drawing with matplotlib: figures without pyplot, text as text, honest decimation."""

from __future__ import annotations

import io
import math
import re
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from smad.arrays import Array
from smad.report.page import Picture
from smad.style.decimation import Decimation
from smad.style.palette import in_print

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


HOUSE_STYLE: dict[Any, Any] = {
    # Letters as letters, so that a journal can set its own face.
    "svg.fonttype": "none",
    "svg.hashsalt": "smad",
    "pdf.fonttype": 42,
    "font.size": 9.0,
    "font.sans-serif": ["system-ui", "Helvetica", "Arial", "DejaVu Sans", "sans-serif"],
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": in_print("line"),
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "lines.linewidth": 1.2,
}


def new_figure(
    rows: int = 1,
    columns: int = 1,
    *,
    width_in: float = 8.0,
    height_in: float = 3.0,
    share_x: bool = False,
) -> tuple[Figure, list[Axes]]:
    """A figure in the house style and its axes, row by row."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(HOUSE_STYLE):
        figure = Figure(figsize=(width_in, height_in), layout="constrained")
        axes = figure.subplots(rows, columns, sharex=share_x, squeeze=False)
    return figure, list(axes.flat)


def svg_of(figure: Figure, title: str = "") -> str:
    """The figure as an `<svg>` element to stand in an HTML page; the same figure, the same text.

    `title` is what a screen reader says. No metadata, no document type, nothing from outside.
    """
    from xml.sax.saxutils import escape, quoteattr

    text = _saved(figure, "svg", ("Date", "Creator", "Format", "Type")).decode()
    text = text[text.index("<svg") :].strip()
    if title:
        close = text.index(">")
        text = (
            f'{text[:close]} role="img" aria-label={quoteattr(title)}>'
            f"<title>{escape(title)}</title>{text[close + 1 :]}"
        )
    return text


def picture(figure: Figure, title: str, caption: str = "") -> Picture:
    """The figure as a block of a page, which can save it. `title` names its files, too."""
    pdf = _saved(figure, "pdf", ("CreationDate", "Creator", "Producer"))
    name = re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")
    return Picture(svg_of(figure, title), caption, name, pdf)


def _saved(figure: Figure, kind: str, without: tuple[str, ...]) -> bytes:
    """The file of a figure, without metadata of these names."""
    import matplotlib as mpl

    # DejaVu is measured for the layout; in SVG the reader's own sans-serif is shown.
    with mpl.rc_context({**HOUSE_STYLE, "font.sans-serif": ["DejaVu Sans", "sans-serif"]}):
        buffer = io.BytesIO()
        figure.savefig(buffer, format=kind, metadata=dict.fromkeys(without))
    return buffer.getvalue()


def decimated(
    t: ArrayLike, y: ArrayLike, most: int = 1600, long_pause: float = math.inf
) -> tuple[Array, Array]:
    """At most `most` points that look the same: the extremes of each stretch.

    `t` and `y` of shape (n,). Gaps (nan in `y`) stay gaps; a step of `t` of `long_pause` times the
    usual one is a gap, too.
    """
    cut = Decimation(np.asarray(t, float), most, long_pause)
    return cut.x, cut.thinned(np.asarray(y, float))


def draw(
    axes: Axes,
    t: ArrayLike,
    y: ArrayLike,
    label: str,
    colour: str,
    *,
    style: str = "-",
    width: float = 1.2,
) -> None:
    """Draw a recorded signal, decimated. `colour` is a name of the palette."""
    shown_t, shown_y = decimated(t, y)
    axes.plot(shown_t, shown_y, style, color=in_print(colour), linewidth=width, label=label)


def label(axes: Axes, x: str, y: str, title: str = "", *, legend: bool = True) -> None:
    """Name the axes; a legend when anything has a label."""
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    if title:
        axes.set_title(title, fontsize=10, loc="left")
    if legend and axes.get_legend_handles_labels()[0]:
        axes.legend(loc="best", frameon=False, fontsize=8)
