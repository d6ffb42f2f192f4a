"""A check-up as a page: the answer, the laws, its budget, and what differs where."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sim_device.plant.laws import Law, own_states, unit_of_state
from smad.checkup.commission import Judged
from smad.checkup.paired.difference import Pair
from smad.checkup.verdict import QUIET, UNCALIBRATED, UNKNOWN, Share, Verdict
from smad.diagnosis.data.grid import PERIOD_S
from smad.diagnosis.gap import change_of, with_effects
from smad.diagnosis.places.place import Forceable, PlacesPlant
from smad.diagnosis.plant import Array
from smad.diagnosis.search.locate import Located
from smad.diagnosis.search.told import law_series, side_words
from smad.diagnosis.verdict import PlaceTold
from smad.report.page import Block, Page, Picture, Section, Table, Text
from smad.style.palette import in_print

_SHOWN = 4
_DIGITS = 3
_BINS = 24
_PLACES_SHOWN = 12


def checkup_page(found: Judged, facts: Sequence[tuple[str, str]]) -> Page:
    """The page; `facts` are baseline, folder and the like."""
    v = found.verdict
    answer: list[Block] = [_answer(v.places)] if v.places else []
    if v.likely and not v.places:
        answer.append(_likely(v))
    answer += [Text(note, "note") for note in v.notes]
    if v.outcome not in (QUIET, UNKNOWN) and not v.places:
        answer.append(Text(UNCALIBRATED[0].upper() + UNCALIBRATED[1:] + ".", "note"))
    sections = [Section("Answer", answer or [Text(_NOTHING)])]
    if found.located is not None and v.places:
        sections.append(Section("Law", _laws(found, found.located)))
        sections.append(Section("Places", [_map(found, found.located)]))
    sections += [
        Section("Budget", [Picture(_budget_figure(v), _BUDGET), _budget(v)]),
        Section("Runs", [_differences(found)]),
    ]
    return Page(
        "Check-up", sections, lead=v.headline[0].upper() + v.headline[1:] + ".", facts=facts
    )


_NOTHING = "Nothing stands out of what two good days differ in."
_BUDGET = (
    "RMS of now minus then in floors: as measured, less what days and small moves of parameters "
    "explain, and less what the model makes of each run with laws that it had no part in. A bench "
    "without a change stays at 1 or below."
)


def _answer(places: Sequence[PlaceTold]) -> Table:
    """Where, which law, what name; a row for each place."""
    rows = []
    for p in places:
        where = p.words + "".join(f" or {near}" for near in p.near)
        name = (
            f"{p.name}, takes {p.takes:.2f} of the law"
            if p.name
            else (f"none; nearest {p.nearest}, takes {p.takes:.2f}" if p.nearest else "none")
        )
        law = "; ".join(t.text for t in p.read)
        rows.append((where, f"{p.share:.2f}", law, "yes" if p.in_simulator else "no", name))
    header = ("where", "share, held out", "law: change for each unit of", "helps the simulator",
              "name")  # fmt: skip
    return Table(header, rows, numeric=frozenset((1,)))


def _laws(found: Judged, located: Located) -> list[Block]:
    """The law of each place over the state that it goes with most."""
    plant = found.pairs.plant
    assert isinstance(plant, Forceable)
    out: list[Block] = []
    for told in found.verdict.places:
        laws = [law for law in located.laws if law.place == told.place]
        state = _first_state(told)
        if not laws or state is None:
            continue
        out.append(
            Picture(
                _law_figure(plant, found, laws, state, told),
                f"{told.words}: the law over {told.terms[0].words}. The line is its mean, the "
                "band one standard deviation of it within the runs, where other states differ; "
                "below, how often the runs were there. Beyond its ends the law keeps its last "
                "value.",
            )
        )
    return out or [Text("The law does not bring the simulator nearer, and is not drawn.")]


def _first_state(told: PlaceTold) -> str | None:
    """The state of the law's first term; None for a constant."""
    name = told.terms[0].name if told.terms else "constant"
    for lag in ("_lag1", "_lag10", "_sign"):
        name = name.removesuffix(lag)
    return None if name == "constant" else name


def _law_figure(
    plant: PlacesPlant, found: Judged, laws: Sequence[Law], state: str, told: PlaceTold
) -> str:
    from smad.report.plots import new_figure, svg_of

    figure, (top, low) = new_figure(2, height_in=3.6, share_x=True)
    for law, colour in zip(laws, ("x", "y"), strict=False):
        x, y = _points(plant, found, law, state)
        edges = np.linspace(x.min(), x.max(), _BINS + 1)
        at = np.clip(np.digitize(x, edges) - 1, 0, _BINS - 1)
        count = np.bincount(at, minlength=_BINS)
        mean = np.bincount(at, y, minlength=_BINS) / np.maximum(count, 1)
        square = np.bincount(at, y**2, minlength=_BINS) / np.maximum(count, 1)
        sd = np.sqrt(np.maximum(square - mean**2, 0.0))
        middle = np.where(count > 0, 0.5 * (edges[1:] + edges[:-1]), np.nan)
        side = "" if law.side == "both" else f" {law.side.upper()}"
        top.plot(middle, mean, color=in_print(colour), label=f"law{side}")
        top.fill_between(middle, mean - sd, mean + sd, color=in_print(colour), alpha=0.2,
                         linewidth=0.0)  # fmt: skip
        low.bar(middle, count / max(int(count.max()), 1), width=np.diff(edges), alpha=0.4,
                color=in_print(colour))  # fmt: skip
    top.axhline(0.0, color=in_print("text"), linewidth=0.6)
    top.set_ylabel(told.unit if told.unit != "1" else "share")
    top.legend(loc="best")
    low.set_ylabel("data")
    low.set_ylim(0.0, 1.05)
    low.set_xlabel(f"{state.replace('_', ' ')}, {unit_of_state(told.place, state)}")
    return svg_of(figure, f"Law: {told.words}")


def _points(plant: PlacesPlant, found: Judged, law: Law, state: str) -> tuple[Array, Array]:
    """Values of a state and of the law over all runs."""
    side = "y" if law.side == "y" else "x"
    xs, ys = [], []
    for pair in found.pairs.pairs:
        run = pair.reference.played.run
        states = plant.trajectory(found.pairs.reference.point, run, fast=True)
        xs.append(own_states(law.place, side, states)[state])
        ys.append(law_series(plant, found.pairs, law, run))
    return np.concatenate(xs), np.concatenate(ys)


def _map(found: Judged, located: Located) -> Picture:
    """What each place alone takes of held-out runs, the best of its sides."""
    from smad.report.plots import new_figure, svg_of

    plant = found.pairs.plant
    assert isinstance(plant, Forceable)
    places = {p.name: p for p in plant.places}
    best: dict[str, tuple[str, float]] = {}
    for s in located.where.ranked:
        c = s.candidate
        best.setdefault(c.place, (side_words(places[c.place], c.side), max(s.share, 0.0)))
    shown = sorted(best.values(), key=lambda x: -x[1])[:_PLACES_SHOWN]
    figure, (ax,) = new_figure(height_in=0.26 * len(shown) + 0.7)
    at = np.arange(len(shown))
    ax.barh(at, [share for _, share in shown], 0.6, color=in_print("main"))
    ax.set_yticks(at, [words for words, _ in shown])
    ax.invert_yaxis()
    ax.set_xlim(left=0.0)
    ax.set_xlabel("share of the change that a law of this place takes, on runs left out")
    return Picture(
        svg_of(figure, "Places"),
        "Each place alone. Places whose bars are nearly as long as the first are not told apart.",
    )


def _likely(v: Verdict) -> Table:
    rows = [
        (
            " + ".join(x.names),
            f"{x.probability:.2f}",
            "; ".join(f"{q} = {n:.3g}" for own in x.values.values() for q, n in own.items()),
        )
        for x in v.likely
        if x.probability >= 0.005
    ]
    return Table(("what may be the matter", "probability", "at"), rows, numeric=frozenset((1,)))


def _budget(v: Verdict) -> Table:
    header = ("signal", "unit", "now − then", "less days", _last(v), "floor")
    rows = [
        (s.signal, s.unit, *(f"{x:.{_DIGITS}g}" for x in (s.raw, s.parameters, _left(v, s),
                                                          s.noise)))
        for s in (*v.budget, v.whole)
    ]  # fmt: skip
    return Table(header, rows, numeric=frozenset(range(2, 6)))


def _last(v: Verdict) -> str:
    return "less law" if v.places else "less named"


def _left(v: Verdict, s: Share) -> float:
    return s.laws if v.places else s.entries


def _budget_figure(v: Verdict) -> str:
    from smad.report.plots import new_figure, svg_of

    figure, (ax,) = new_figure(height_in=0.35 * len(v.budget) + 0.9)
    at = np.arange(len(v.budget))
    stages = (
        ("as measured", "reference", [s.raw for s in v.budget]),
        ("less days", "main", [s.parameters for s in v.budget]),
        (_last(v), "y", [_left(v, s) for s in v.budget]),
    )
    for k, (name, colour, rms) in enumerate(stages):
        values = [x / s.noise if s.noise > 0.0 else 0.0
                  for s, x in zip(v.budget, rms, strict=True)]  # fmt: skip
        ax.barh(at + 0.27 * (k - 1), values, 0.25, label=name, color=in_print(colour))
    ax.axvline(1.0, color=in_print("text"), linewidth=0.8)
    ax.set_yticks(at, [s.signal for s in v.budget])
    ax.invert_yaxis()
    ax.set_xlim(left=0.0)
    ax.set_xlabel("floors")
    ax.legend(loc="lower right")
    return svg_of(figure, "Budget by signal")


def _differences(found: Judged) -> Picture:
    """Signals of the run with most of the change, what the model makes of it beside."""
    from smad.report.plots import draw, label, new_figure, svg_of

    pairs, v = found.pairs, found.verdict
    k = next(k for k, p in enumerate(pairs.pairs) if p.now == v.worst_run)
    pair = pairs.pairs[k]
    said, name = _said(found, k)
    order = _largest(pair)[:_SHOWN]
    figure, axes = new_figure(len(order), height_in=1.5 * len(order) + 0.4, share_x=True)
    t = (np.arange(len(pair.difference)) + 0.5) * PERIOD_S
    for ax, c in zip(axes, order, strict=True):
        channel = pairs.plant.channels[c]
        floor = pair.rows.sd[:, c]
        ax.fill_between(t, -floor, floor, color=in_print("reference"), alpha=0.25, linewidth=0.0,
                        label="floor")  # fmt: skip
        measured = np.where(pair.rows.valid[:, c], pair.difference[:, c], np.nan)
        draw(ax, t, measured, "now − then", "main")
        if said is not None:
            draw(ax, t, said[:, c], name, "x", style="--")
        label(ax, "", channel.name, legend=c == order[0])
    axes[-1].set_xlabel("time of the run, s")
    caption = f"{v.worst_run}: the signals that differ most, with what the model makes of it."
    return Picture(svg_of(figure, "Differences"), caption)


def _said(found: Judged, k: int) -> tuple[Array | None, str]:
    """What the model makes of a pair: with laws that it had no part in, else named entries."""
    v = found.verdict
    if found.located is not None and found.located.laws and v.places:
        return found.located.change[k], "law, fitted without this run"
    values = v.likely[0].values if v.likely else {}
    change = change_of(found.pairs, with_effects(found.pairs.point, values)) if values else None
    return (None, "") if change is None else (change[k], " + ".join(v.likely[0].names))


def _largest(pair: Pair) -> list[int]:
    scaled = np.where(pair.rows.valid, pair.difference / pair.rows.sd, 0.0)
    return [int(c) for c in np.argsort(-(scaled**2).mean(axis=0))]
