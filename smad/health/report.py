"""The trends of a record, in words, as a table, and as one page."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from smad.counted import counted
from smad.health.record import Row
from smad.health.trends import LEAST_ROWS, LEAST_SITTINGS, Forecast, Trend, forecast, trend_of
from smad.report.page import Block, Page, Picture, Section, Table, Text
from smad.runlog.header import date_of

CHANGE_HEADER = ("what", "then", "now", "changed", "noticed at cycle", "limit", "reached at cycle")


@dataclass(frozen=True)
class Health:
    """The trends of a record by name, with the forecasts of those that have a limit."""

    rows: tuple[Row, ...]
    trends: Mapping[str, Trend]
    limits: Mapping[str, float]

    def forecast(self, name: str) -> Forecast | None:
        """Return when a quantity reaches its limit; None without a limit, or without a slope."""
        limit = self.limit(name)
        return (
            None if limit is None or name not in self.trends else forecast(self.trends[name], limit)
        )

    def limit(self, name: str) -> float | None:
        """Return the limit of a series: given for it, or for its quantity in every group."""
        return self.limits.get(name, self.limits.get(name.partition(": ")[2]))

    @property
    def changed(self) -> list[Trend]:
        """Trends with a change that stands, the earliest noticed first."""
        noticed = [trend for trend in self.trends.values() if trend.noticed is not None]
        return sorted(noticed, key=lambda trend: float(trend.x[trend.noticed or 0]))

    @property
    def returned(self) -> list[Trend]:
        """Trends that changed for a while and have come back."""
        return [t for t in self.trends.values() if t.passed and t.noticed is None]

    def record(self) -> dict[str, object]:
        """Return it as JSON takes it."""
        trends = {
            name: {
                "then": trend.mean,
                "scatter": trend.scatter,
                "change": trend.change,
                "came_back_at_cycles": [float(trend.x[back]) for _, back in trend.passed],
                "noticed_at_cycle": None
                if trend.noticed is None
                else float(trend.x[trend.noticed]),
                "forecast": self.forecast(name),
            }
            for name, trend in self.trends.items()
        }
        return {"headline": headline(self), "rows": len(self.rows), "trends": trends}


def health_of(rows: Sequence[Row], limits: Mapping[str, float]) -> Health:
    """Return the health that rows show; cycles are summed up from the first one on."""
    behind = np.cumsum([row.cycles for row in rows])
    # Without a cycle in any row the order is all there is.
    if len(behind) and behind[-1] == 0.0:
        behind = np.arange(len(rows), dtype=np.float64)
    names = dict.fromkeys((row.group, name) for row in rows for name in row.values)
    trends = {}
    for group, name in names:
        places = [
            place for place, row in enumerate(rows) if row.group == group and name in row.values
        ]
        y = np.array([rows[place].values[name].value for place in places])
        unix_s = np.array([rows[place].unix_s for place in places])
        trend = trend_of(f"{group}: {name}", behind[places], y, unix_s)
        if trend is not None:
            trends[trend.name] = trend
    return Health(tuple(rows), trends, limits)


def headline(health: Health) -> str:
    """Return the state of the bench in one sentence."""
    if not health.trends:
        return (
            f"no trend yet, {counted(len(health.rows), 'row')} in health.jsonl: a trend needs "
            f"{LEAST_ROWS} runs of one name in one session, or {LEAST_SITTINGS} sessions"
        )
    returned = ", ".join(trend.name for trend in health.returned)
    passed = f"; changed for a while and came back: {returned}" if returned else ""
    if not health.changed:
        return f"nothing has changed in {counted(len(health.rows), 'row')}{passed}"
    first = health.changed[0]
    names = ", ".join(trend.name for trend in health.changed)
    return f"changed: {names}; first noticed at cycle {first.x[first.noticed or 0]:.0f}{passed}"


def table(health: Health) -> Table:
    """Return the trends as a table, those that changed first."""
    changed = health.changed
    unchanged = [trend for trend in health.trends.values() if trend not in changed]
    rows = []
    for trend in (*changed, *unchanged):
        predicted = health.forecast(trend.name)
        noticed = "" if trend.noticed is None else f"{trend.x[trend.noticed]:.0f}"
        limit = health.limit(trend.name)
        reached = (
            ""
            if predicted is None
            else f"{predicted.x:.0f} [{predicted.low:.0f}, {predicted.high:.0f}]"
        )
        rows.append(
            (
                trend.name,
                f"{trend.mean:.4g} ± {trend.scatter:.2g}",
                f"{np.mean(trend.y[-3:]):.4g}",
                f"{trend.change:+.3g}" if trend.noticed is not None else _passed(trend),
                noticed,
                "" if limit is None else f"{limit:g}",
                reached,
            )
        )
    return Table(CHANGE_HEADER, rows)


def _passed(trend: Trend) -> str:
    ranges = (f"{trend.x[begin]:.0f} to {trend.x[back]:.0f}" for begin, back in trend.passed)
    return f"from {', '.join(ranges)}" if trend.passed else "no"


def page(health: Health, bench: str) -> Page:
    """Return one page: what changed, trends with bands, and the last rows."""
    blocks: list[Block] = [Text(headline(health))]
    if health.trends:
        blocks.append(table(health))
    blocks += [Picture(_figure(health, trend), trend.name) for trend in health.trends.values()]
    events = [
        (date_of(row.unix_s), row.kind, "; ".join(row.words)) for row in health.rows if row.words
    ]
    sections = [Section("Trends", blocks)]
    if events:
        sections.append(Section("Check-ups", [Table(("when", "what", "said"), events[-50:])]))
    return Page(f"Health of {bench}", sections)


def _figure(health: Health, trend: Trend) -> str:
    from smad.report.plots import label, new_figure, svg_of
    from smad.style.palette import in_print

    figure, (axes,) = new_figure(height_in=2.2)
    axes.axhspan(*trend.band, color=in_print("run-2"), alpha=0.15)
    axes.plot(trend.x, trend.y, ".-", markersize=4, color=in_print("run-1"))
    if trend.noticed is not None:
        axes.axvline(trend.x[trend.noticed], color=in_print("text"), linewidth=0.8, linestyle="--")
    if (limit := health.limit(trend.name)) is not None:
        axes.axhline(limit, color=in_print("text"), linewidth=0.8)
    label(axes, "cycles", trend.name)
    return svg_of(figure, f"{trend.name} against cycles, with the band of the first rows")
