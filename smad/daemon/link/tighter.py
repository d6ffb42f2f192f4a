"""What must hold between the configuration and the board's own parameters before it is armed."""

from collections.abc import Collection

from firmware_protocol.parameters import BENCH_PARAMETERS, BY_NAME, axis_name_crc
from smad.api import Reason
from smad.config import Config
from smad.config.hostlimits import looser_than
from smad.daemon.errors import Refusal
from smad.daemon.link.board import Parameters


def require_name_of_axis(name: str, names: Collection[str], parameters: Parameters) -> None:
    """Raise Refusal unless the board stores the name of this axis: cables may be swapped.

    `names` are those of all axes; of a bench of one axis, which has no name, nothing is asked.
    """
    stored = parameters.value(BY_NAME["axis_name_crc"])
    if not name or stored == axis_name_crc(name):
        return
    if stored == 0:
        raise Refusal(
            Reason.DISAGREEMENT,
            "the board stores no name of an axis",
            limit=name,
            action=f"if it is the board of this axis: smad params name --axis {name}",
        )
    of_another = next((other for other in names if stored == axis_name_crc(other)), "")
    raise Refusal(
        Reason.DISAGREEMENT,
        "the board belongs to another axis",
        value=of_another or f"the CRC {stored}",
        limit=name,
        action="swap the cables, or correct the ports in [[axes]]; smad params name renames it",
    )


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
    for loose in looser_than(config, parameters.limits()):
        raise Refusal(
            Reason.INVALID,
            f"{loose.key} is looser than the board's {loose.board}",
            value=loose.value,
            limit=f"at most {loose.limit:g}",
            action="tighten it in the configuration and start the daemon again, or loosen the "
            f"board's (smad params set {loose.board} VALUE)",
        )
