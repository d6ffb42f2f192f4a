"""What must hold between the configuration and the board's own parameters before it is armed."""

from __future__ import annotations

from firmware_protocol.parameters import BENCH_PARAMETERS
from smad.api import Reason
from smad.config import Config
from smad.config.hostlimits import looser_than
from smad.daemon.board import Parameters
from smad.daemon.errors import Refusal


def require_tighter(config: Config, parameters: Parameters) -> None:
    """Raise Refusal when a limit of the host is looser than the board's, or a scale is zero."""
    for parameter in BENCH_PARAMETERS:
        if parameter.never_zero and parameters.value(parameter) == 0:
            raise Refusal(
                Reason.INVALID,
                f"the board's {parameter.name} is zero, so nothing can be measured with it",
                value=0,
                limit=f"{parameter.allowed} {parameter.unit}",
                action=f"set it first (smad params set {parameter.name} VALUE)",
            )
    for found in looser_than(config, parameters.limits()):
        raise Refusal(
            Reason.INVALID,
            f"{found.key} is looser than the board's {found.board}",
            value=found.value,
            limit=f"at most {found.limit:g}",
            action="tighten it in the configuration and start the daemon again, or loosen the "
            f"board's (smad params set {found.board} VALUE)",
        )
