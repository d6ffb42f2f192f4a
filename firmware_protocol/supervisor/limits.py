"""The limits table: every number a check or a state uses, with its unit, range and reason.

A limit is compiled into the board. It is a parameter as well: a stored value may tighten it,
towards `tightest`, and never loosen it beyond the compiled value. Integers only, in the units of
the wire, so that the generated C computes the same.

`Limits` is the table and the record at once: each field's annotation carries its row.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Annotated, get_type_hints

from firmware_protocol.supervisor.errors import LimitError


@dataclass(frozen=True, slots=True)
class Row:
    """One row of the limits table.

    `compiled` is the value of a board nobody touched, and the loose end of the range.
    `tightest` is the other end. The numbers 24 and 25 were once others and stay unused.
    """

    compiled: int
    tightest: int
    unit: str
    reason: str
    number: int = 0
    """Number of the parameter that tightens it; 0 for a limit that cannot be changed."""


@dataclass(slots=True)
class Limits:
    """The limits in force. Field order is the order of the generated C struct."""

    # What may flow.
    current_limit_mA: Annotated[
        int, Row(4000, 100, "mA", "largest current of the source's bench", 20)
    ]
    current_slew_mA_per_ms: Annotated[
        int, Row(400, 10, "mA/ms", "full current within one 100 Hz sample, without a kick", 27)
    ]
    fold_start_cC: Annotated[
        int,
        Row(
            8100,
            4000,
            "cC",
            "the host stops at 80 degC; austenite is finished under load below 72",
            28,
        ),
    ]
    fold_end_cC: Annotated[
        int, Row(8800, 4500, "cC", "current is zero here; 7 K for what is still on its way in", 29)
    ]
    i2t_rated_mA: Annotated[int, Row(3000, 200, "mA", "warms a flushed spring by 12 K only", 30)]
    i2t_budget_A2s: Annotated[int, Row(2100, 50, "A2s", "4 A for five minutes above the rated", 31)]

    stage_travel_um: Annotated[
        int, Row(200_000, 200_000, "um", "no experiment stretches a spring further; 0 is its start")
    ]

    # Temperatures.
    temperature_limit_cC: Annotated[
        int, Row(9500, 4500, "cC", "below boiling; silicone tube and cement stand 150 degC", 21)
    ]
    temperature_hysteresis_cC: Annotated[int, Row(500, 500, "cC", "several times the noise")]
    cold_cC: Annotated[int, Row(4500, 3000, "cC", "safe to touch; end of COOL, needed to arm", 22)]
    rail_high_cC: Annotated[int, Row(20000, 20000, "cC", "an open RTD reads full scale")]
    rail_low_cC: Annotated[int, Row(-4000, -4000, "cC", "a shorted RTD reads below any room")]
    below_surroundings_cC: Annotated[
        int, Row(500, 200, "cC", "nothing can cool a spring below water and room", 32)
    ]
    jump_cC: Annotated[int, Row(400, 200, "cC", "4 A in a dry tube gives 0.5 K in 20 ms", 33)]
    jump_decay_us: Annotated[int, Row(2_000_000, 2_000_000, "us", "one jump is forgotten in 2 s")]
    jumps: Annotated[int, Row(4, 2, "jumps", "one spike is two jumps, and may happen", 34)]
    stuck_us: Annotated[
        int, Row(5_000_000, 2_000_000, "us", "noise alone moves the last digit", 35)
    ]
    stuck_model_cC: Annotated[int, Row(300, 300, "cC", "the slowest good spring warmed by this")]

    # Heat that goes in must show, and must stop.
    unheated_energy_mJ: Annotated[
        int, Row(20_000, 5_000, "mJ", "slow sinusoids on set A need up to 13900", 36)
    ]
    unheated_debt_mJ: Annotated[int, Row(2_000, 2_000, "mJ", "a pause of half a second")]
    unheated_rise_cC: Annotated[int, Row(200, 200, "cC", "ten times the noise")]
    swapped_rise_cC: Annotated[int, Row(400, 400, "cC", "the other sensor warms without current")]
    sensor_offset_cC: Annotated[int, Row(200, 200, "cC", "two good RTDs may differ by this")]
    loss_static_mW_per_K: Annotated[int, Row(120, 120, "mW/K", "tube to air at most 87 mW/K")]
    loss_flow_mW_per_K: Annotated[int, Row(900, 900, "mW/K", "full flow at most 660 mW/K")]
    off_current_mA: Annotated[int, Row(100, 100, "mA", "offset and noise of the current sense")]
    off_lag_us: Annotated[int, Row(3_000_000, 3_000_000, "us", "sensor and wall lag, plus 1 s")]
    off_drift_cC_per_s: Annotated[int, Row(30, 30, "cC/s", "a room in the sun drifts slower")]
    off_rise_cC: Annotated[int, Row(400, 200, "cC", "a heater left on rises 4 K a second", 37)]
    residual_cC: Annotated[
        int, Row(1500, 800, "cC", "outside the envelope of all good benches", 38)
    ]
    residual_us: Annotated[int, Row(5_000_000, 1_000_000, "us", "longer than any sensor lag", 39)]
    envelope_light_mJ_per_K: Annotated[int, Row(200, 200, "mJ/K", "lightest bare wire 245")]
    envelope_heavy_mJ_per_K: Annotated[
        int, Row(7000, 7000, "mJ/K", "heaviest 4000, plus latent heat over 15 K")
    ]
    envelope_loss_least_mW_per_K: Annotated[int, Row(1, 1, "mW/K", "tube to air at least 1.4 mW/K")]
    envelope_lag_us: Annotated[int, Row(2_000_000, 2_000_000, "us", "slowest good sensor")]
    envelope_span_cC: Annotated[int, Row(2000, 2000, "cC", "the light model is not left behind")]

    # Current and resistance.
    current_filter_us: Annotated[int, Row(40_000, 40_000, "us", "noise of the sense, thrice less")]
    current_band_us: Annotated[int, Row(200_000, 200_000, "us", "a driver may lag by half of it")]
    current_error_mA: Annotated[int, Row(100, 100, "mA", "offset and noise of the current sense")]
    current_error_permille: Annotated[
        int, Row(100, 80, "permille", "gain of a good driver is 2 %", 40)
    ]
    current_error_us: Annotated[int, Row(50_000, 20_000, "us", "past the settling of any edge", 41)]
    over_current_mA: Annotated[
        int, Row(4600, 4600, "mA", "15 % above the largest setpoint; the sense may end at 4777")
    ]
    uncommanded_us: Annotated[int, Row(20_000, 20_000, "us", "two samples at 100 Hz")]
    resistance_current_mA: Annotated[int, Row(500, 500, "mA", "below, V/I is too coarse")]
    resistance_min_mohm: Annotated[int, Row(180, 180, "mohm", "least of any bench in range 230")]
    resistance_max_mohm: Annotated[
        int, Row(1800, 1800, "mohm", "most of any bench in range 1240, plus contacts 500")
    ]
    resistance_us: Annotated[int, Row(100_000, 100_000, "us", "past the settling of any edge")]
    resistance_tempco_ppm_per_K: Annotated[
        int, Row(12_000, 12_000, "ppm/K", "phase change: 20 % within 17 K")
    ]
    resistance_tolerance_permille: Annotated[
        int, Row(120, 60, "permille", "hysteresis of NiTi, noise", 42)
    ]
    disagree_us: Annotated[int, Row(2_000_000, 2_000_000, "us", "longer than the sensor lag")]
    wire_open_mV: Annotated[int, Row(6000, 6000, "mV", "no whole wire needs this at 4 A")]

    # Time.
    setpoint_age_us: Annotated[int, Row(50_000, 20_000, "us", "a stalled link must not replay", 43)]
    setpoint_ttl_ms: Annotated[int, Row(100, 10, "ms", "ten samples at 100 Hz", 26)]
    hold_us: Annotated[int, Row(500_000, 50_000, "us", "a short stall of the host is no fault", 44)]
    token_us: Annotated[int, Row(2_000_000, 500_000, "us", "one round trip and a slow host", 45)]
    cool_cap_us: Annotated[int, Row(60_000_000, 20_000_000, "us", "longer than any flush", 46)]
    on_time_limit_s: Annotated[
        int, Row(21_600, 60, "s", "six hours: longer than any experiment", 23)
    ]
    overrun_us: Annotated[int, Row(50_000, 30_000, "us", "five samples at 100 Hz missed", 47)]

    # Supply and pumps.
    brown_out_mV: Annotated[
        int,
        Row(7500, 10500, "mV", "twice what a spring needs at 4 A; the driver drops out at 5 V", 48),
    ]
    pump_rpm: Annotated[int, Row(6000, 6000, "rpm", "one pump at full duty, wet")]
    pump_stalled_permille: Annotated[int, Row(300, 300, "permille", "a worn pump keeps 60 %")]
    pump_stalled_us: Annotated[int, Row(1_000_000, 1_000_000, "us", "past spinning up")]
    pump_dry_permille: Annotated[int, Row(1400, 1400, "permille", "a dry pump races at 1.8x")]
    pump_dry_us: Annotated[int, Row(2_000_000, 2_000_000, "us", "bubbles pass within a second")]
    pump_duty_least: Annotated[int, Row(64, 64, "1/255", "below a quarter it may not start")]
    pump_off_rpm: Annotated[int, Row(600, 600, "rpm", "noise of the tachometer")]
    pump_off_us: Annotated[int, Row(1_000_000, 1_000_000, "us", "run-down of the motor")]
    cooling_us: Annotated[
        int, Row(12_000_000, 12_000_000, "us", "one flush is 4.7 s, 13 s at the least flow")
    ]
    cooling_excess_cC: Annotated[int, Row(1200, 1200, "cC", "enough above the inlet to tell")]
    cooling_drop_permille: Annotated[
        int, Row(150, 150, "permille", "the least flow removes 300; none leaves 75 to the air")
    ]
    leak_us: Annotated[int, Row(50_000, 50_000, "us", "contact bounce")]
    debounce_samples: Annotated[int, Row(3, 3, "samples", "one bad conversion is no fault")]
    double_samples: Annotated[int, Row(2, 2, "samples", "too fast to wait for a third")]
    at_once_samples: Annotated[int, Row(1, 1, "samples", "counted elsewhere, or beyond doubt")]


def _rows() -> dict[str, Row]:
    hints = get_type_hints(Limits, include_extras=True)
    return {field.name: hints[field.name].__metadata__[0] for field in fields(Limits)}


LIMIT_ROWS: dict[str, Row] = _rows()
"""Field name → row, in field order."""


def compiled_limits() -> Limits:
    """Return the limits of a board without stored parameters."""
    return Limits(**{name: row.compiled for name, row in LIMIT_ROWS.items()})


def tighten(limits: Limits, stored: Mapping[str, int]) -> Limits:
    """Return a copy of `limits` with the `stored` soft limits put in.

    Raises LimitError for a name that is not in the table, or for a value outside the soft range.
    """
    values = {name: getattr(limits, name) for name in LIMIT_ROWS}
    for name, value in stored.items():
        low, high = soft_range(name)
        if not low <= value <= high:
            raise LimitError(
                f"{name} = {value} {LIMIT_ROWS[name].unit} is refused: a stored limit may only "
                f"tighten the compiled {LIMIT_ROWS[name].compiled}, so it must be within "
                f"{low} to {high}; choose a value in that range"
            )
        values[name] = value
    return Limits(**values)


def soft_range(name: str) -> tuple[int, int]:
    """Return (lowest, highest) value that may be stored for the limit `name`.

    Raises LimitError if there is no such limit.
    """
    row = LIMIT_ROWS.get(name)
    if row is None:
        raise LimitError(f"there is no limit named {name!r}; see the limits table in safety.md")
    return min(row.compiled, row.tightest), max(row.compiled, row.tightest)
