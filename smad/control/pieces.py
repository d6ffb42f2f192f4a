"""Commands cut into such as fit one message. Needs nothing of the controller: clients import it."""

from collections.abc import Mapping, Sequence
from typing import Any

from msgspec.structs import replace

from smad.control.commands import LONGEST_INPUTS, FollowInputs, Samples, Trajectory

POINTS_A_PIECE = 500
"""Longer sample trajectories go out in pieces of so many points, to keep messages short."""

DRIVEN = ("i_x_A", "i_y_A", "pump_x_duty", "pump_y_duty")
_DRAINS = ("drain_x", "drain_y")
READINGS = ("displacement_mm", "rtd_x_degC", "rtd_y_degC", "force_N")
"""What may be watched beside the recorded."""
COLUMNS = (*DRIVEN, *_DRAINS, *READINGS)
"""Every field of FollowInputs that has a value for each row."""


def in_pieces(trajectory: Trajectory, points: int = POINTS_A_PIECE) -> list[Trajectory]:
    """Return the trajectory, cut where it is too long for one message."""
    if not isinstance(trajectory, Samples) or len(trajectory.t_s) <= points:
        return [trajectory]
    pieces: list[Trajectory] = []
    for begin in range(0, len(trajectory.t_s) - 1, points - 1):
        part = slice(begin, begin + points)
        start_s = trajectory.t_s[begin]
        pieces.append(
            Samples(
                t_s=tuple(t - start_s for t in trajectory.t_s[part]),
                displacement_mm=trajectory.displacement_mm[part],
            )
        )
    return pieces


def first_pieces(
    group: Mapping[str, Trajectory | Sequence[Trajectory]],
) -> tuple[dict[str, tuple[Trajectory, ...]], dict[str, tuple[Trajectory, ...]]]:
    """Return what begins together, in one message, and what each axis is to follow afterwards."""
    begin, later = {}, {}
    for axis, motion in group.items():
        whole = motion if isinstance(motion, Sequence) else (motion,)
        pieces = [p for command in whole for p in in_pieces(command, POINTS_A_PIECE // len(group))]
        # The pieces of one trajectory are too many for one message; those of others are short.
        cut = len(pieces) if len(pieces) == len(whole) else 1
        begin[axis] = tuple(pieces[:cut])
        if pieces[cut:]:
            later[axis] = tuple(pieces[cut:])
    return begin, later


def rows_in_pieces(command: FollowInputs) -> list[FollowInputs]:
    """The command cut into such as fit one message; all but the first are queued."""
    rows = len(command.t_s)
    pieces = []
    for begin in range(0, max(rows, 1), LONGEST_INPUTS):
        end = begin + LONGEST_INPUTS
        part: dict[str, Any] = {name: getattr(command, name)[begin:end] for name in COLUMNS}
        pieces.append(
            replace(
                command,
                t_s=command.t_s[begin:end],
                end_s=command.end_s if end >= rows else command.t_s[end],
                queue=command.queue or begin > 0,
                **part,
            )
        )
    return pieces
