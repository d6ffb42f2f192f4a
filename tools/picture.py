"""Draw the picture of the README from the run log of a demo.

    smad demo && python tools/picture.py runs/*-demo.mcap

The newest of the logs given is drawn, into docs/img/demo.svg or the file named with -o.
"""

import argparse
from pathlib import Path

from smad.report.plots import draw, label, new_figure, svg_of
from smad.runlog.reader import Run, read_run

PICTURE = Path(__file__).resolve().parents[1] / "docs/img/demo.svg"


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


def main() -> None:
    """Draw what the command line names."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("logs", type=Path, nargs="+", metavar="LOG")
    parser.add_argument("-o", "--output", type=Path, default=PICTURE)
    arguments = parser.parse_args()
    newest = max(arguments.logs, key=lambda path: path.name)
    arguments.output.write_text(picture(read_run(newest)) + "\n")
    print(f"{arguments.output} from {newest}")


if __name__ == "__main__":
    main()
