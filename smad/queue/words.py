"""A queue in words, for whoever prints it."""

from datetime import datetime

from smad.queue.states import Arming, Snapshot


def state_in_words(snapshot: Snapshot, *, runner: bool) -> str:
    """Return what the queue does now, in one line."""
    without = "" if runner else "; no runner is running: start one with smad queue run"
    if snapshot.arming is None:
        return f"paused: {snapshot.reason}; smad queue resume arms it{without}"
    return f"running until {limits_in_words(snapshot.arming)}{without}"


ITEMS = ("item", "command", "state", "since", "why")
_ENDED_SHOWN = 5


def item_rows(snapshot: Snapshot, *, everything: bool) -> list[tuple[str, ...]]:
    """Return the cells of each item, as `ITEMS` names them; of ended ones the last, or all."""
    ended = [item for item in snapshot.items if item.ended_unix_s]
    first = 0 if everything else max(0, len(ended) - _ENDED_SHOWN)
    running = [snapshot.running] if snapshot.running else []
    return [
        (
            str(item.id),
            item.title,
            item.state,
            clock(item.started_unix_s or item.added_unix_s),
            item.reason,
        )
        for item in [*ended[first:], *running, *snapshot.queued]
    ]


def limits_in_words(arming: Arming) -> str:
    """Return end time, budget and what is used of it, in one line."""
    usage, budget = arming.usage, arming.budget
    parts = [clock(arming.end_unix_s)]
    if budget.energy_J is not None:
        parts.append(f"{usage.energy_J / 1e3:.1f} of {budget.energy_J / 1e3:g} kJ")
    if budget.cycles is not None:
        parts.append(f"{usage.cycles:.0f} of {budget.cycles:.0f} cycles")
    if budget.hours is not None:
        parts.append(f"{usage.seconds / 3600:.2f} of {budget.hours:g} h")
    return ", or ".join(parts)


def clock(unix_s: float) -> str:
    """Return a time as day, month and time of day."""
    return datetime.fromtimestamp(unix_s).strftime("%d %b %H:%M:%S")
