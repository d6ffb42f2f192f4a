"""`smad status`: everything about the bench in lines. Pure."""

import math
import time
from collections.abc import Iterator
from typing import Literal, NamedTuple

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
Style = Literal["plain", "title", "good", "warned", "bad"]
COLOURS: dict[Style, str] = {"good": "green", "warned": "yellow", "bad": "red"}


class Line(NamedTuple):
    """A line of the status or of the screen."""

    text: str
    style: Style = "plain"


def lines(now: Status) -> Iterator[Line]:
    """The status as a person reads it, the most urgent first; a line an axis where several are."""
    yield from head(now)
    if now.axes:
        yield from map(Line, axis_lines(now.axes, now.skew or Percentiles()))
    else:
        yield from map(Line, _readings(now))
        yield from _board(now)
        yield from link(now)
        yield _line("host share", spread(now.timing.own_share))
        yield _line("jitter", spread(now.timing.jitter))
    yield from record(now)
    yield from _realtime(now)
    yield from events(now, _EVENTS)


def head(now: Status) -> Iterator[Line]:
    """State, fault, warnings, motion and control."""
    motion = now.motion
    state = f"{now.bench}: {'ARMED' if motion.armed else 'not armed'}, board {motion.mode}"
    connection = (
        f"{len(now.axes)} axes" if now.axes else LINK_MEANS.get(now.link.state, now.link.state)
    )
    yield _line("bench", f"{state}, {connection}", "warned" if motion.armed else "good")
    if motion.fault is not None:
        yield _line("fault", f"{motion.fault.in_words()} (by the {motion.fault.by})", "bad")
        explained = FAULT_TEXTS[Fault(motion.fault.number)]
        yield _line("", explained.cause)
        then = " Then smad clear." if explained.clears else ""
        yield _line("", f"{explained.remedy}{then}")
    if now.warnings:
        yield _line("warnings", ", ".join(now.warnings), "warned")
    reference = "" if motion.reference_mm is None else f", reference {motion.reference_mm:.2f} mm"
    yield _line("motion", f"{motion.in_words()}{reference}")
    if limiter := limiter_of(now):
        yield _line("limited by", limiter)
    if now.control.holder:
        whose = "you" if now.control.yours else now.control.holder
        yield _line("control", f"exclusive: {whose}, {now.control.left_s:.0f} s left")


def _readings(now: Status) -> Iterator[str]:
    row = now.sample
    if row is None:
        yield labelled("readings", "none yet")
        return
    old = aged(now.motion)
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


def _board(now: Status) -> Iterator[Line]:
    board = now.board
    if board is None:
        return
    agree = {True: "agree", False: "DISAGREE", None: "being read"}[board.params_agree]
    schema = "agree" if board.schema_agrees else "DISAGREE: watching only"
    yield _line(
        "board",
        f"{board.firmware} ({board.uid}), protocol {board.protocol}, boot {board.boot_count} "
        f"after {board.reset_cause}; messages {schema}, parameters {agree}",
        "bad" if not board.schema_agrees or board.params_agree is False else "plain",
    )


def link(now: Status) -> Iterator[Line]:
    """What comes over the link of the only axis, and how old setpoints are."""
    of_link, counts, age = now.link, now.counts, now.timing.setpoint_age
    yield _line(
        "link",
        f"{of_link.rate_hz} Hz, {counts.samples} samples, {counts.missed} missed, "
        f"{counts.skipped} skipped, {of_link.losses} losses of the port; "
        f"{of_link.port}, {of_link.baud} baud",
        "bad" if counts.missed or of_link.losses else "plain",
    )
    yield from (_line("", note, "warned") for note in of_link.notes)
    yield _line(
        "age",
        f"{spread(age)}{' when applied' * bool(age.count)}; "
        f"{counts.setpoints_refused} refused as too old",
        "bad" if counts.setpoints_refused else "plain",
    )


def record(now: Status) -> Iterator[Line]:
    """The run log that is open, or was last."""
    recorder = now.recorder
    if recorder.path:
        label = "recording" if recorder.recording else "run log"
        yield _line(label, f"{display_path(recorder.path)}, {recorder.rows} samples")
    if recorder.error:
        yield _line("", recorder.error, "bad")


def _realtime(now: Status) -> Iterator[Line]:
    granted = [m.name for m in now.realtime if m.granted]
    yield _line("real time", ", ".join(granted) or "nothing granted")
    for measure in now.realtime:
        if measure.asked and not measure.granted:
            yield _line("", f"no {measure.name}: {measure.detail}", "warned")
    yield _line(
        "daemon",
        f"smad {now.version}, process {now.pid}, up {now.uptime_s:.0f} s, "
        f"{now.memory_MiB:.0f} MiB, {counted(now.counts.commands, 'command')}, "
        f"{now.counts.refused} refused",
    )


def events(now: Status, most: int) -> Iterator[Line]:
    """The last events of the journal."""
    for event in now.events[-most:] if most > 0 else ():
        when = time.strftime("%H:%M:%S", time.localtime(event.time_s))
        yield _line("event", f"{when}  {event.text}")


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


def other_benches(bench: str) -> Iterator[Line]:
    """Name the other benches that run, if any."""
    names = [name for name in running_benches(candidate_folders()) if name != bench]
    if names:
        yield _line("also", f"{', '.join(names)} (smad status --bench NAME)")


def labelled(label: str, text: str) -> str:
    """A line of the status: its label in a column, then the text."""
    return f"{label:<{_LABEL}} {text}"


def _line(label: str, text: str, style: Style = "plain") -> Line:
    return Line(labelled(label, text), style)


def printed(line: Line, width: int) -> str:
    """Return a line as `folded` does, in its colour."""
    return click.style(folded(line.text, width), fg=COLOURS.get(line.style))


def folded(line: str, width: int) -> str:
    """Return a labelled line in lines of at most `width`: the text goes on below itself."""
    return "\n".join(wrapped(line, width, labelled("", "")))


def spread(part: Percentiles) -> str:
    """Percentiles of a duration, in one line."""
    if part.count == 0:
        return "no samples yet"
    return f"p50 {part.p50_us:.0f} µs, p99 {part.p99_us:.0f} µs, p99.9 {part.p999_us:.0f} µs"
