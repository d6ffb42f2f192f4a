"""`smad status`: everything about the bench in lines. Pure."""

import math
import time
from collections.abc import Iterator
from functools import partial

import click

from firmware_protocol.enums import Fault
from firmware_protocol.supervisor.faults import FAULT_TEXTS
from smad.api import Motion, Percentiles, Status
from smad.client.endpoints import candidate_folders, running_benches
from smad.client.link_counts import LinkCounts
from smad.counted import counted
from smad.files import display_path
from smad.view.state import LINK_MEANS, limiter_of
from smad.view.terminal.axis_lines import aged, axis_lines, number
from smad.view.terminal.tables import wrapped

_EVENTS = 5
_LABEL = 11
SENSORS_AGREE_K = 1.0
"""Two sensors of one temperature differ by less."""
_green, _red, _yellow = (partial(click.style, fg=name) for name in ("green", "red", "yellow"))


def lines(now: Status) -> Iterator[str]:
    """The status as a person reads it, the most urgent first; a line an axis where several are."""
    yield from _bench(now)
    if now.axes:
        yield from axis_lines(now.axes, now.skew or Percentiles())
    else:
        yield from _readings(now)
        yield from _link(now)
    yield from _record(now)
    yield from _realtime(now)
    for event in now.events[-_EVENTS:]:
        when = time.strftime("%H:%M:%S", time.localtime(event.time_s))
        yield labelled("event", f"{when}  {event.text}")


def _bench(now: Status) -> Iterator[str]:
    motion = now.motion
    armed = _yellow("ARMED") if motion.armed else _green("not armed")
    link = f"{len(now.axes)} axes" if now.axes else LINK_MEANS.get(now.link.state, now.link.state)
    yield labelled("bench", f"{now.bench}: {armed}, board {motion.mode}, {link}")
    if motion.fault is not None:
        yield labelled(
            "fault", _red(f"{motion.fault.in_words()} (stopped by the {motion.fault.by})")
        )
        explained = FAULT_TEXTS[Fault(motion.fault.number)]
        yield labelled("", explained.cause)
        yield labelled("", f"{explained.remedy} Then smad clear.")
    if now.warnings:
        yield labelled("warnings", _yellow(", ".join(now.warnings)))
    done = "stopped" if motion.fault else "done" if motion.done else "under way"
    reference = "" if motion.reference_mm is None else f", reference {motion.reference_mm:.2f} mm"
    yield labelled("motion", f"{motion.running}, {done}{reference}")
    if limiter := limiter_of(now):
        yield labelled("limited by", limiter)
    if now.control.holder:
        whose = "you" if now.control.yours else now.control.holder
        yield labelled("control", f"exclusive: {whose}, {now.control.left_s:.0f} s left")


def _readings(now: Status) -> Iterator[str]:
    row = now.sample
    if row is None:
        yield labelled("readings", "none yet")
        return
    old = _yellow(age) if (age := aged(now.motion)) else ""
    yield labelled(
        "position", f"{number(row.displacement_mm, 3)} mm, {number(row.force_N, 2)} N{old}"
    )
    for name, degrees, amperes, volts, duty, starts in (
        ("spring x", row.rtd_x_degC, row.i_meas_x_A, row.v_x_V, row.duty_x, row.pump_starts_x),
        ("spring y", row.rtd_y_degC, row.i_meas_y_A, row.v_y_V, row.duty_y, row.pump_starts_y),
    ):
        yield labelled(
            name,
            f"{number(degrees, 2)} °C, {number(amperes, 2)} A, {number(volts, 2)} V, "
            f"pump {number(None if duty is None else 100 * duty, 0)} %"
            + ("" if starts is None else f", {starts} start{'s'[: starts != 1]}")
            + old,
        )
    yield labelled(
        "water, room",
        f"{number(row.rtd_inlet_degC, 2)} °C, {number(row.rtd_ambient_degC, 2)} °C; "
        f"supply {number(row.supply_V, 2)} V{old}",
    )


def _link(now: Status) -> Iterator[str]:
    link, counts, board = now.link, now.counts, now.board
    yield labelled(
        "link",
        f"{link.port}, {link.baud} baud, {link.rate_hz} Hz, "
        f"{counts.samples} samples, {_lost(counts.missed)} missed, {counts.skipped} skipped, "
        f"{_lost(link.losses)} losses of the port",
    )
    for note in link.notes:
        yield labelled("", _yellow(note))
    if board is not None:
        agree = {True: "agree", False: _red("DISAGREE"), None: "being read"}[board.params_agree]
        schema = "agree" if board.schema_agrees else _red("DISAGREE: watching only")
        yield labelled(
            "board",
            f"{board.firmware} ({board.uid}), protocol {board.protocol}, boot {board.boot_count} "
            f"after {board.reset_cause}; messages {schema}, parameters {agree}",
        )
    timing = now.timing
    yield labelled("host share", spread(timing.own_share))
    yield labelled(
        "age",
        f"{spread(timing.setpoint_age)}{' when applied' * bool(timing.setpoint_age.count)}; "
        f"{_lost(counts.setpoints_refused)} refused as too old",
    )
    yield labelled("jitter", spread(timing.jitter))


def _record(now: Status) -> Iterator[str]:
    recorder = now.recorder
    if recorder.recording:
        yield labelled("recording", f"{display_path(recorder.path)}, {recorder.rows} samples")
    elif recorder.path:
        yield labelled("run log", f"{display_path(recorder.path)}, {recorder.rows} samples")
    if recorder.error:
        yield labelled("", _red(recorder.error))


def _realtime(now: Status) -> Iterator[str]:
    granted = [m.name for m in now.realtime if m.granted]
    yield labelled("real time", ", ".join(granted) or "nothing granted")
    for measure in now.realtime:
        if measure.asked and not measure.granted:
            yield labelled("", _yellow(f"no {measure.name}: {measure.detail}"))
    yield labelled(
        "daemon",
        f"smad {now.version}, process {now.pid}, up {now.uptime_s:.0f} s, "
        f"{now.memory_MiB:.0f} MiB, {counted(now.counts.commands, 'command')}, "
        f"{now.counts.refused} refused",
    )


def motion_words(motion: Motion) -> str:
    """A motion in a few words."""
    parts = [f"{motion.running}, board {motion.mode}"]
    if motion.displacement_mm is not None:
        parts.append(f"at {motion.displacement_mm:.2f} mm{aged(motion)}")
    if motion.reference_mm is not None:
        parts.append(f"reference {motion.reference_mm:.2f} mm")
    if motion.fault is not None:
        parts.append(f"fault {motion.fault.name}")
    return ", ".join(parts)


def below_surroundings(now: Status, goal_degC: float) -> str:
    """Say that no spring gets as cold as its goal: neither water nor room is; empty if one is."""
    row = now.sample
    shown = (None, None) if row is None else (row.rtd_inlet_degC, row.rtd_ambient_degC)
    known = [degC for degC in shown if degC is not None and math.isfinite(degC)]
    if not known or goal_degC >= min(known) - SENSORS_AGREE_K:
        return ""
    water, room = (number(degC, 1) for degC in shown)
    return (
        f"{goal_degC:.1f} °C is out of reach: a spring gets no colder than water and room, "
        f"{water} °C and {room} °C"
    )


def count_lines(link: LinkCounts) -> Iterator[str]:
    """What was counted on the link, a line each."""
    timing = link.after.timing
    rate_hz = link.after.link.rate_hz
    rows = {
        "samples": f"{link.since('samples')} in {link.took_s:.1f} s (asked for {rate_hz} a second)",
        "missed": f"{link.since('missed')}",
        "skipped": f"{link.since('skipped')} (a newer one was there already)",
        "damaged": f"{counted(link.damaged, 'frame')} from the board",
        "not written": counted(link.since("setpoints_dropped"), "setpoint"),
        "refused": f"{counted(link.since('setpoints_refused'), 'setpoint')}, too old for the board",
        "setpoint age": spread(timing.setpoint_age),
        "host share": spread(timing.own_share),
    }
    yield from (f"{name:<13} {text}" for name, text in rows.items())


def other_benches(bench: str) -> Iterator[str]:
    """Name the other benches that run, if any."""
    names = [name for name in running_benches(candidate_folders()) if name != bench]
    if names:
        yield labelled("also", f"{', '.join(names)} (smad status --bench NAME)")


def labelled(label: str, text: str) -> str:
    """A line of the status: its label in a column, then the text."""
    return f"{label:<{_LABEL}} {text}"


def folded(line: str, width: int) -> str:
    """Return a labelled line in lines of at most `width`: the text goes on below itself."""
    return "\n".join(wrapped(line, width, labelled("", "")))


def _lost(count: int) -> str:
    return _red(str(count)) if count else "0"


def spread(part: Percentiles) -> str:
    """Percentiles of a duration, in one line."""
    if part.count == 0:
        return "no samples yet"
    return f"p50 {part.p50_us:.0f} µs, p99 {part.p99_us:.0f} µs, p99.9 {part.p999_us:.0f} µs"
