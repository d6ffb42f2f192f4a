"""Draw the figures of the paper: `make paper` writes paper/*.png.

1. The pair over the paper's four steps, simulated. 2. Numbers that other laboratories published,
beside what the plant gives. 3. Scores of the check-up on the sealed bank, from evaluation/results.
"""

from __future__ import annotations

import json
import math
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from sim_device.plant import Drive, Plant, load_parameters
from sim_device.plant.published import NEAR, NUMBERS
from sim_device.plant.units import ZERO_C
from smad.report.plots import new_figure
from smad.style.palette import in_print

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FOLDER = Path(__file__).parent
SCORES = FOLDER.parent / "evaluation" / "results" / "sealed-check-ups.json"
SHOWN = (
    "quiet benches called changed",
    "parameters given a cause",
    "noticed near 1 floor",
    "noticed near 3 floors",
    "place right first, listed",
    "place right first, unlisted",
)
_INTERVAL = re.compile(r"([\d.]+) \[([\d.]+), ([\d.]+)\]")
STEP_S, CURRENT_A = 0.05, 4.0


def cycle() -> Figure:
    """Displacement against the temperature of each spring: X heats, X cools, Y heats, Y cools."""
    plant = Plant(load_parameters("A"))
    phases = [
        ((CURRENT_A, 0.0), (0.0, 0.0), 0, 0.02),
        ((0.0, 0.0), (1.0, 0.0), 0, 0.98),
        ((0.0, CURRENT_A), (0.0, 0.0), 1, 0.02),
        ((0.0, 0.0), (0.0, 1.0), 1, 0.98),
    ]
    rows = []
    for i_A, duty, spring, fraction in phases * 2:
        below = fraction < 0.5
        for _ in range(4000):
            plant.advance(Drive(i_A, duty), STEP_S)
            now = plant.truth
            rows.append((*now.T_K, 1e3 * now.displacement_m, now.force_N))
            if (now.xi[spring] <= fraction) == below:
                break
    T_x, T_y, u, F = np.array(rows).T
    figure, (left, right) = new_figure(1, 2, width_in=8.0, height_in=3.2)
    left.plot(T_x - ZERO_C, u, color=in_print("x"), label="spring X")
    left.plot(T_y - ZERO_C, u, color=in_print("y"), label="spring Y")
    left.set_xlabel("temperature of the wire (°C)")
    left.set_ylabel("displacement (mm)")
    left.legend(frameon=False, fontsize=8)
    right.plot(u, F, color=in_print("main"))
    right.set_xlabel("displacement (mm)")
    right.set_ylabel("tension of the tendon (N)")
    return figure


def published() -> Figure:
    """Ratio of what the plant gives to what was published, a point for each number."""
    shown = [n for n in NUMBERS if n.ratio is not None and not math.isinf(n.ratio)]
    figure, (axes,) = new_figure(1, 1, width_in=8.0, height_in=6.4)
    axes.axvspan(1.0 - NEAR, 1.0 + NEAR, color=in_print("raised"))
    for place, number in enumerate(reversed(shown)):
        mark = "o" if not number.fitted else "s"
        fill = in_print("x") if not number.fitted else "none"
        if number.stated is not None:
            bounds = [bound / number.value for bound in number.stated]
            axes.plot(bounds, [place, place], color=in_print("main"), linewidth=3, alpha=0.3)
        axes.plot(number.ratio, place, mark, color=in_print("x"), markerfacecolor=fill)
    names = [f"{number.what} ({number.source})" for number in reversed(shown)]
    axes.set_yticks(range(len(shown)), names, fontsize=6)
    axes.set_xlim(0.0, 2.0)
    axes.set_xlabel(
        "simulated over published; squares: fitted; bars: the interval that the source states"
    )
    return figure


def scores() -> Figure:
    """Share of the check-ups and its 95 % interval, a bar for each score shown."""
    table = json.loads(SCORES.read_text())["tables"]["Scores, check-up"]["rows"]
    values = {row[0]: row[1:3] for row in table}
    figure, (axes,) = new_figure(1, 1, width_in=8.0, height_in=2.6)
    names = []
    for place, name in enumerate(reversed(SHOWN)):
        text, cases = values[name]
        match = _INTERVAL.fullmatch(text)
        assert match is not None
        value, low, high = map(float, match.groups())
        axes.plot([low, high], [place, place], color=in_print("main"))
        axes.plot(value, place, "o", color=in_print("main"))
        names.append(f"{name} (n = {cases})")
    axes.set_yticks(range(len(SHOWN)), names, fontsize=8)
    axes.set_xlim(0.0, 1.0)
    axes.set_xlabel("share of the cases, with 95 % interval")
    return figure


FIGURES = {"cycle": cycle, "published": published, "scores": scores}


def main(folder: Path = FOLDER) -> int:
    """Write every figure to `folder`."""
    for name, make in FIGURES.items():
        make().savefig(folder / f"{name}.png", dpi=200, metadata={"Software": None})
        print(folder / f"{name}.png")
    return 0


if __name__ == "__main__":
    sys.exit(main(*map(Path, sys.argv[1:])))
