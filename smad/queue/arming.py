"""Arming a queue in two steps: what is proposed, and when a confirmation is good.

Pure: the wall clock and the code are arguments.
"""

import re
from datetime import datetime, time, timedelta

import msgspec

from smad.queue.errors import ArmingError
from smad.queue.machine import Change, resumed
from smad.queue.states import Arming, Budget, Snapshot
from smad.queue.store import Proposal

CONFIRM_WITHIN_S = 120.0
LONGEST_H = 31 * 24.0
_CLOCK = re.compile(r"(\d{1,2}):(\d{2})")


def end_time(text: str, now: datetime) -> datetime:
    """Return the moment that `text` names: `07:30` is the next one, or an ISO date and time.

    `now` is aware, in the time zone that is meant. Where the clocks change, the moment is that of
    the wall clock: of two equal ones the first, of one that is skipped the next that exists.
    Raises ArmingError.
    """
    clock = _CLOCK.fullmatch(text)
    try:
        if clock:
            hour, minute = map(int, clock.groups())
            end = _resolved(now.replace(hour=hour, minute=minute, second=0, microsecond=0, fold=0))
            if end.timestamp() <= now.timestamp():
                later = (now + timedelta(days=1)).date()
                end = _resolved(datetime.combine(later, time(hour, minute), now.tzinfo))
        else:
            end = datetime.fromisoformat(text)
            if end.tzinfo is None:
                end = _resolved(end.replace(tzinfo=now.tzinfo))
    except ValueError:
        raise ArmingError(
            "this is not an end time",
            value=text,
            limit="07:30, or 2026-11-26T07:30",
            action="give it so; nothing was armed",
        ) from None
    # Of timestamps: two times of one zone are subtracted as if no clock ever changed.
    if not 0.0 < end.timestamp() - now.timestamp() <= LONGEST_H * 3600.0:
        raise ArmingError(
            "the end time is in the past, or too far ahead",
            value=end.isoformat(timespec="minutes"),
            limit=f"within {LONGEST_H / 24:.0f} days from now",
            action="arm it for less; nothing was armed",
        )
    return end


def earliest_end(until: str | None, hours: float | None, now: datetime) -> float:
    """Return when a time, or so many hours, end first, in Unix seconds. Raises ArmingError."""
    after_hours = float("inf") if hours is None else now.timestamp() + hours * 3600.0
    return after_hours if until is None else min(end_time(until, now).timestamp(), after_hours)


def _resolved(moment: datetime) -> datetime:
    """Return a moment that exists: one that the clocks skip is an hour later."""
    return datetime.fromtimestamp(moment.timestamp(), moment.tzinfo)


def propose(
    snapshot: Snapshot,
    *,
    code: str,
    now_unix_s: float,
    end_unix_s: float,
    budget: Budget,
    generation: int | None,
) -> Proposal:
    """Return the first step: all items that wait now. Raises ArmingError when there are none."""
    if not snapshot.queued:
        raise ArmingError("the queue is empty", action="add an item first; nothing was armed")
    if snapshot.mode == "running":
        raise ArmingError("the queue is running already", action="pause it to arm it again")
    for name, amount in msgspec.structs.asdict(budget).items():
        if amount is not None and not 0.0 < amount < float("inf"):
            raise ArmingError(f"the budget {name} is not positive", value=amount)
    return Proposal(
        code=code,
        made_unix_s=now_unix_s,
        arming=Arming(
            items=tuple(item.id for item in snapshot.queued),
            end_unix_s=end_unix_s,
            longest_s=end_unix_s - now_unix_s,
            budget=budget,
            generation=generation,
        ),
    )


def confirm(
    snapshot: Snapshot,
    proposal: Proposal | None,
    code: str,
    *,
    now_unix_s: float,
    generation: int | None,
) -> Change:
    """Return the second step. Raises ArmingError unless it confirms what was shown, just now."""
    nothing = "give smad queue resume again, without --confirm; nothing was armed"
    if proposal is None or proposal.code != code.strip().upper():
        raise ArmingError("this is not the code of the last proposal", value=code, action=nothing)
    age_s = now_unix_s - proposal.made_unix_s
    if not 0.0 <= age_s <= CONFIRM_WITHIN_S:
        raise ArmingError(
            "the proposal is too old",
            value=f"{age_s:.0f} s",
            limit=f"{CONFIRM_WITHIN_S:.0f} s",
            action=nothing,
        )
    if tuple(item.id for item in snapshot.queued) != proposal.arming.items:
        raise ArmingError("the queue has changed since the proposal", action=nothing)
    if generation != proposal.arming.generation:
        raise ArmingError(
            "the bench was stopped, or its daemon was restarted, since the proposal", action=nothing
        )
    return resumed(snapshot, proposal.arming)
