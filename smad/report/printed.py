"""Panels as one figure for print: width of a column, type of 8 points, a light ground."""

from pathlib import Path
from typing import Any

from smad.errors import CommandError, SmadError
from smad.extras import part
from smad.files import named_output, require_writable
from smad.report.panels import Panel, Panels
from smad.report.plots import HOUSE_STYLE, decimated
from smad.style.decimation import LONG_PAUSE
from smad.style.palette import in_print

FORMATS = ("pdf", "png", "svg")
PANEL_MM = 32.0
PNG_DPI = 600
_MM_PER_INCH = 25.4
_UNDATED: Any = {"svg": {"Date": None}, "pdf": {"CreationDate": None}, "png": {"Software": None}}
"""Metadata by kind: the same figure gives the same file."""
_POINTS = 8.0
_DASH_Y = (6, 3)
_STYLE: dict[str, Any] = {
    **HOUSE_STYLE,
    "font.size": _POINTS,
    "font.sans-serif": ["Helvetica", "Arial", "DejaVu Sans"],
    "axes.titlesize": _POINTS,
    "legend.fontsize": _POINTS - 1,
    "axes.linewidth": 0.6,
    "grid.linewidth": 0.4,
}


def write_figure(panels: Panels, path: Path, *, width_mm: float = 85.0) -> Path:
    """Draw the panels below each other over one axis and write them to `path`; returns it.

    The suffix chooses the format (`FORMATS`). Panels that are shown on demand are left out, unless
    there are no others. Raises CommandError for another suffix, a folder that is not there or
    nothing to draw, MissingPartError without matplotlib, SmadError where the file cannot be
    written.
    """
    kind = path.suffix.lower().removeprefix(".")
    if kind not in FORMATS:
        raise CommandError(
            "a figure is written as SVG, PDF or PNG",
            value=path.name,
            limit=" ".join(f".{name}" for name in FORMATS),
            action="name a file with one of these suffixes",
        )
    require_writable(path)
    mpl, figures = part("matplotlib"), part("matplotlib.figure")
    visible = [panel for panel in panels.panels if not panel.on_demand] or panels.panels
    if not visible:
        raise CommandError("no signal that is drawn was recorded", action="smad log show lists all")
    size = (width_mm / _MM_PER_INCH, PANEL_MM * len(visible) / _MM_PER_INCH)
    with mpl.rc_context(_STYLE):
        figure = figures.Figure(figsize=size, layout="constrained")
        for axes, panel in zip(
            figure.subplots(len(visible), 1, sharex=True, squeeze=False).flat, visible, strict=True
        ):
            _draw(axes, panel)
        figure.axes[-1].set_xlabel(panels.x_label)
        cause, action = "the figure cannot be written", "name another file, or make room"
        with named_output(path, SmadError, cause, action, value=str(path)) as partial:
            figure.savefig(partial, format=kind, dpi=PNG_DPI, metadata=_UNDATED[kind])
    return path


def _draw(axes: Any, panel: Panel) -> None:
    for trace in panel.traces:
        x, y = decimated(trace.x, trace.y, long_pause=LONG_PAUSE)
        # On paper the springs differ without colours, too.
        dash = trace.dash or (_DASH_Y if trace.pen == "y" else ())
        style: Any = (0, [0.5 * px for px in dash]) if dash else "-"
        axes.plot(
            x, y, linestyle=style, linewidth=0.9, color=in_print(trace.pen), label=trace.label
        )
    # Beside a panel of this height there is no room for a long name.
    axes.set_title(f"{panel.title} ({panel.unit})" if panel.unit else panel.title, loc="left")
    if len(panel.traces) > 1:
        axes.legend(
            loc="lower right",
            bbox_to_anchor=(1.0, 1.0),
            borderaxespad=0.1,
            ncols=len(panel.traces),
            handlelength=1.2,
            columnspacing=0.8,
        )
