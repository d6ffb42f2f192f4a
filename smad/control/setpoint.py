"""An output of the controller as the SETPOINT that goes to the board."""

import msgspec

from firmware_protocol.enums import SetpointFlag
from firmware_protocol.messages import Setpoint

_DRAIN_X, _DRAIN_Y = SetpointFlag.DRAIN_X.value, SetpointFlag.DRAIN_Y.value
_STAGE = SetpointFlag.STAGE.value


class Output(msgspec.Struct, frozen=True, gc=False):
    """What the board is to apply. Pairs are (x, y). `stage_m` is None while no stage is moved."""

    i_A: tuple[float, float] = (0.0, 0.0)
    pump_duty: tuple[float, float] = (0.0, 0.0)
    drain: tuple[bool, bool] = (False, False)
    stage_m: float | None = None


def setpoint_of(output: Output, *, t_ref_us: int, axis: int = 0, ttl_ms: int = 100) -> Setpoint:
    """The SETPOINT for `output`, computed from the STATE whose raw `t_us` is `t_ref_us`.

    Currents are rounded to 1 mA, duties to 1/255, the stage to 1 µm.
    """
    i_x_A, i_y_A = output.i_A
    duty_x, duty_y = output.pump_duty
    flags = (_DRAIN_X if output.drain[0] else 0) | (_DRAIN_Y if output.drain[1] else 0)
    stage_um = 0
    if output.stage_m is not None:
        flags |= _STAGE
        stage_um = round(output.stage_m * 1e6)
    return Setpoint(
        axis,
        t_ref_us,
        (round(i_x_A * 1e3), round(i_y_A * 1e3)),
        (round(duty_x * 255.0), round(duty_y * 255.0)),
        flags,
        ttl_ms,
        stage_um,
    )
