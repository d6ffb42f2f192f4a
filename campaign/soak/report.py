"""What a soak has to show: a row for each check, judged by what a stage gave. Pure."""

from __future__ import annotations

import dataclasses
import json
import statistics
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from campaign.soak.found import LOOKING, StageResult, Usage
from smad.report.page import Table
from smad.version import VERSION

EXPECTED_FAULTS = frozenset({"SETPOINT_LOST", "ESTOP_PRESSED"})
"""What a pulled cable while armed and the emergency stop lead to; every other is a nuisance."""

RSS_GROWTH_MIB = 5.0
"""Between the second tenth and the last: an hour's run log needs half a MiB of indexes; the minute
that the black box keeps of an axis at 100 Hz is not full yet at the second tenth of a short soak
(3.4 MiB in all were measured); sixty writings of it after the first, which the soak asks for before
it looks, add 0.7 MiB and no thread."""

_HEADER = ("check", "found", "allowed", "")


@dataclass(frozen=True)
class Check:
    """One check: what was measured, what is allowed, whether it holds."""

    name: str
    measured: str
    allowed: str
    ok: bool


def checks(result: StageResult) -> list[Check]:
    """Every check of a stage."""
    early, late = parts_of(result.usage)
    growth = [
        _growth("memory, MiB", lambda u: u.rss_MiB, early, late, RSS_GROWTH_MIB),
        _growth("descriptors", lambda u: float(u.descriptors), early, late, 0.0),
        _growth("threads", lambda u: float(u.threads), early, late, 0.0),
    ]
    stage = result.stage
    restarts = result.reconnects + 1
    acknowledged = len(orders(result))
    strange = [name for name in result.faults if name not in EXPECTED_FAULTS]
    return [
        _least("board time, s", result.board_s, stage.seconds),
        _least("armings", result.armings, 1),
        _none("samples missed within a connection", result.missed),
        _none("times the armed board waited for the daemon in vain", result.host_timeouts),
        _same("losses of the port", result.losses, result.reconnects),
        _same("samples in the run log", result.logged_rows, result.recorded_rows),
        _most("gaps between logged samples", result.logged_gaps, restarts),
        _none("records dropped", result.log_dropped),
        _none_of("trouble with the run log", [result.log_error] if result.log_error else []),
        _same(
            "acknowledged commands in the run log",
            acknowledged - len(result.not_logged),
            acknowledged,
        ),
        _same("commands of the flood answered", result.flood_answered, result.flooded),
        _none_of("faults of the board without a cause", strange),
        *growth,
        _same("exit status", result.status, 0),
    ]


def orders(result: StageResult) -> list[str]:
    """The acknowledged commands that were more than looking, by method."""
    return [method for method, _ in result.commands.commands if method not in LOOKING]


def parts_of(usage: Sequence[Usage]) -> tuple[list[Usage], list[Usage]]:
    """What was held early (the second tenth: the first is warming up) and late (the last).

    Of a short soak up to three looks each, none of which counts twice: one alone may fall into a
    moment in which the daemon holds less.
    """
    tenth = max(1, len(usage) // 10)
    looks = max(tenth, min(3, (len(usage) - tenth) // 2))
    return list(usage[tenth : tenth + looks]), list(usage[-looks:])


def table_of(result: StageResult) -> Table:
    """The checks as a table."""
    rows = [(c.name, c.measured, c.allowed, "ok" if c.ok else "FAILED") for c in checks(result)]
    return Table(_HEADER, rows, numeric=frozenset({1, 2}))


def facts(result: StageResult) -> str:
    """What went on, in a line."""
    speed = result.board_s / result.wall_s if result.wall_s else 0.0
    return (
        f"{result.stage.name}, seed {result.seed}: {result.samples} samples "
        f"in {result.wall_s:.0f} s ({speed:.1f} times real time), "
        f"{result.reconnects} reconnects, {result.armings} armings, "
        f"{len(orders(result))} commands of {len(set(orders(result)))} kinds acknowledged, "
        f"{result.commands.refused} refused, {result.flooded} of the flood, "
        f"{result.telemetry_read} samples read by the slow subscriber"
    )


def json_of(results: Sequence[StageResult]) -> str:
    """Everything, as JSON text."""
    stages = [
        {
            "facts": {
                **{k: v for k, v in dataclasses.asdict(result).items() if k != "commands"},
                "acknowledged": dict(Counter(orders(result))),
                "refused": result.commands.refused,
            },
            "checks": [dataclasses.asdict(check) for check in checks(result)],
        }
        for result in results
    ]
    return json.dumps({"smad": VERSION, "stages": stages}, indent=1) + "\n"


def _growth(
    name: str,
    value: Callable[[Usage], float],
    early: Sequence[Usage],
    late: Sequence[Usage],
    allowed: float,
) -> Check:
    if not early or not late:
        return Check(name, "never looked", "", ok=False)
    before = statistics.median(value(usage) for usage in early)
    after = statistics.median(value(usage) for usage in late)
    limit = f"{before + allowed:g}" if allowed == 0.0 else f"{before + allowed:.1f}"
    return Check(
        f"{name}, early and late", f"{before:.4g}, {after:.4g}", limit, ok=after <= before + allowed
    )


def _least(name: str, value: float, limit: float) -> Check:
    return Check(name, f"{value:.0f}", f"at least {limit:.0f}", ok=value >= limit)


def _most(name: str, value: int, limit: int) -> Check:
    return Check(name, str(value), f"up to {limit}", ok=value <= limit)


def _same(name: str, value: int, wanted: int) -> Check:
    return Check(name, str(value), str(wanted), ok=value == wanted)


def _none(name: str, value: int) -> Check:
    return _same(name, value, 0)


def _none_of(name: str, values: Sequence[str]) -> Check:
    return Check(name, ", ".join(values) or "none", "none", ok=not values)
