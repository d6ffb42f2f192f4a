"""A run of a programme as a plan, which a bench or a simulated one carries out from rest."""

from __future__ import annotations

from smad.checkup.programme import ProgrammeRun
from smad.control.commands import FollowInputs
from smad.control.pieces import rows_in_pieces
from smad.control.plan import Do, Plan, UntilDone

_LATE_S = 5.0


def plan_of(run: ProgrammeRun, name: str) -> Plan:
    """The run as open-loop currents and duties; the host's limits apply as in every mode."""
    i_x_A, i_y_A, duty_x, duty_y = (tuple(column.tolist()) for column in run.inputs.T)
    command = FollowInputs(
        t_s=tuple(run.t_s.tolist()),
        end_s=run.duration_s,
        i_x_A=i_x_A,
        i_y_A=i_y_A,
        pump_x_duty=duty_x,
        pump_y_duty=duty_y,
    )
    actions = [Do(piece) for piece in rows_in_pieces(command)]
    return Plan(name, (*actions, UntilDone(run.duration_s + _LATE_S)))
