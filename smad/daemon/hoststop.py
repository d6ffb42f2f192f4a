"""A motion that a limit of the host ended: told as a fault, and kept until a person clears it."""

from firmware_protocol.enums import Channel, Fault
from firmware_protocol.supervisor.faults import FAULT_TEXTS
from firmware_protocol.supervisor.limits import LIMIT_ROWS
from smad import api
from smad.control.controller import Controller
from smad.control.limits import HostLimit, Trip

_CHANNELS = {
    HostLimit.SENSOR_X: Channel.SPRING_X,
    HostLimit.SENSOR_Y: Channel.SPRING_Y,
    HostLimit.ON_TIME: Channel.BOARD,
}


def fault_of_trip(trip: Trip) -> api.Fault:
    """Return a trip under the name of the board's fault for the same cause."""
    fault = _fault(trip)
    return api.Fault(
        number=int(fault),
        name=fault.name,
        by="host",
        channel=_CHANNELS[trip.limit].name,
        measured=round(trip.measured, 3),
        limit=trip.allowed,
        unit="s" if trip.limit is HostLimit.ON_TIME else "K/s",
    )


def _fault(trip: Trip) -> Fault:
    if trip.limit is HostLimit.ON_TIME:
        return Fault.ARMED_TOO_LONG
    # An open or shorted sensor jumps as well, and the board takes three samples to say which.
    if trip.rtd_degC >= LIMIT_ROWS["rail_high_cC"].compiled * 1e-2:
        return Fault.SENSOR_OPEN
    if trip.rtd_degC <= LIMIT_ROWS["rail_low_cC"].compiled * 1e-2:
        return Fault.SENSOR_SHORT
    return Fault.SENSOR_IMPLAUSIBLE


def in_full(fault: api.Fault) -> str:
    """Return a fault with its cause and remedy, as `smad faults explain` has them."""
    text = FAULT_TEXTS[Fault(fault.number)]
    return f"{fault.in_words()}. {text.cause} {text.remedy}"


class HostStop:
    """The stop that stands, if one does: the controller's, until `clear`."""

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        self._cleared: Trip | None = None
        self._reported: Trip | None = None

    @property
    def fault(self) -> api.Fault | None:
        """What stopped it, until it is cleared."""
        trip = self._controller.trip
        return None if trip is None or trip is self._cleared else fault_of_trip(trip)

    def new_reason(self) -> api.Fault | None:
        """Return the stop the first time that it is asked for, None afterwards."""
        trip = self._controller.trip
        if trip is None or trip is self._reported:
            return None
        self._reported = trip
        return fault_of_trip(trip)

    def clear(self) -> None:
        """A person has seen it."""
        self._cleared = self._controller.trip
