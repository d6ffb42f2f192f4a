"""Draw the pictures of the handbook from run logs.

    smad demo && python tools/picture.py runs/*-demo.mcap
    smad run six-axes --sim && python tools/picture.py runs/*-six-axes.mcap

The newest of the logs given is drawn, into docs/img/demo.svg, or six-axes.svg for one of several
axes, or the file named with -o.
"""

import argparse
from pathlib import Path

from smad.config import parse_config
from smad.experiments.circles import TOGETHER, trackings
from smad.report.plots import draw, label, new_figure, svg_of
from smad.robot import Robot
from smad.runlog.reader import Run, read_axes

FOLDER = Path(__file__).resolve().parents[1] / "docs/img"
DARK = (
    "<style>@media (prefers-color-scheme: dark) "
    "{ svg { filter: invert(0.88) hue-rotate(180deg) } }</style>"
)
"""White would glare in a dark page. Hues stay as the legend has them."""


def picture(run: Run) -> str:
    """Return the SVG: displacement and reference, and the temperatures of both springs."""
    c = run.columns
    t_s = c["t_s"] - c["t_s"][0]
    figure, axes = new_figure(2, height_in=4.0, share_x=True)
    draw(axes[0], t_s, c["displacement_mm"], "displacement", "main")
    draw(axes[0], t_s, c["reference_mm"], "reference", "reference", style="--")
    label(axes[0], "", "mm", "Steps of ±10 mm, then 2 mm every 7 s")
    draw(axes[1], t_s, c["rtd_x_degC"], "spring X", "x")
    draw(axes[1], t_s, c["rtd_y_degC"], "spring Y", "y")
    label(axes[1], "time (s)", "°C", "Temperature of each spring")
    title = "displacement and reference, and the temperatures of both springs, over time"
    return svg_of(figure, title)


def circles(runs: dict[str, Run]) -> str:
    """Return the SVG: pitch and yaw of the segments while all draw their circles together."""
    robot = Robot.of(parse_config(next(iter(runs.values())).header.configuration))
    drawn = [tracking for tracking in trackings(runs, robot) if tracking.phase == TOGETHER]
    figure, axes = new_figure(len(drawn), height_in=4.5, share_x=True)
    for k, (place, tracking) in enumerate(zip(axes, drawn, strict=True)):
        for joint, pen, wanted, actual in zip(
            ("pitch", "yaw"), "xy", tracking.wanted_deg, tracking.actual_deg, strict=True
        ):
            draw(place, tracking.t_s, actual, joint, pen)
            draw(
                place,
                tracking.t_s,
                wanted,
                "reference" if joint == "yaw" else "",
                "reference",
                style="--",
            )
        label(place, "time (s)" if k + 1 == len(drawn) else "", "°", tracking.segment)
    return svg_of(figure, "pitch and yaw of three segments that draw circles together, over time")


def main() -> None:
    """Draw what the command line names."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("logs", type=Path, nargs="+", metavar="LOG")
    parser.add_argument("-o", "--output", type=Path)
    arguments = parser.parse_args()
    newest = max(arguments.logs, key=lambda path: path.name)
    runs = read_axes(newest)
    several = "" not in runs
    output = arguments.output or FOLDER / ("six-axes.svg" if several else "demo.svg")
    drawing = circles(runs) if several else picture(runs[""])
    output.write_text(drawing.replace("</title>", f"</title>{DARK}", 1) + "\n")
    print(f"{output} from {newest}")


if __name__ == "__main__":
    main()
