"""Whether a budget of the queue can be metered on its bench."""

from smad.client import Client
from smad.config import Config, parse_config
from smad.errors import DaemonError
from smad.queue.errors import ArmingError
from smad.queue.meter import LONGEST_GAP_S
from smad.queue.states import Budget


def require_metered(budget: Budget, bench: str) -> None:
    """Raise ArmingError for a budget that nothing would end, since the daemon's samples are too few
    to meter what is used."""
    if budget.energy_J is None and budget.cycles is None:
        return
    config = configuration(bench)
    rate_hz = min(axis.link.rate_hz for axis in config.by_axis().values())
    apart_s = config.telemetry.every_nth_sample / rate_hz
    if config.telemetry.enabled and apart_s <= LONGEST_GAP_S:
        return
    raise ArmingError(
        "energy and cycles cannot be metered",
        value=f"a sample every {apart_s:g} s" if config.telemetry.enabled else "no samples",
        limit=f"a sample every {LONGEST_GAP_S:g} s",
        action="set telemetry.enabled and a smaller telemetry.every_nth_sample, or give a budget "
        "of hours; nothing was armed",
    )


def configuration(bench: str) -> Config:
    """The configuration of the daemon; without one the usual one, as it is looked at again."""
    try:
        with Client(bench, timeout_s=1.0) as client:
            return parse_config(client.config())
    except DaemonError:
        return Config()
