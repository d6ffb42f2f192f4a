"""What the supervisor measures from and what it remembers: integers only.

Both records become C structs of the same fields in the same order (see generate). A list of two
is always (X, Y); rtd_cC is (X, Y, inlet, ambient), as in STATE.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields

RTD_INVALID_cC = -32768
"""What an RTD channel holds when its converter gave no value."""

UNKNOWN = -1
"""A speed that the board cannot measure; the checks that need it rest."""


def _pair() -> list[int]:
    return [0, 0]


def _four() -> list[int]:
    return [0, 0, 0, 0]


@dataclass(slots=True)
class Measurements:
    """One sample, in wire units. `applied_mA` is what was regulated to while it was taken."""

    i_mA: list[int] = field(default_factory=_pair)
    applied_mA: list[int] = field(default_factory=_pair)
    v_mV: list[int] = field(default_factory=_pair)
    rtd_cC: list[int] = field(default_factory=lambda: [2500, 2500, 2500, 2500])
    duty: list[int] = field(default_factory=_pair)
    pump_rpm: list[int] = field(default_factory=lambda: [UNKNOWN, UNKNOWN])
    vbus_mV: int = 12000
    leak: int = 0
    parameters_ok: int = 1
    encoder_invalid: int = 0
    force_invalid: int = 0


@dataclass(slots=True)
class Command:
    """What a command of the host carries; each command reads its own fields."""

    passed: int = 0
    link: int = 0
    token: int = 0
    fault: int = 0
    i_mA: list[int] = field(default_factory=_pair)
    duty: list[int] = field(default_factory=_pair)
    age_us: int = 0
    ttl_us: int = 0
    stage_um: int = 0
    """0 when the setpoint does not mean the stage."""


@dataclass(slots=True)
class Memory:
    """All that the supervisor keeps from one sample to the next, and what it decided."""

    lines: int
    """Number of lines of the check table; the length of the four lists at the end."""

    now_us: int = 0
    dt_us: int = 0
    started: int = 0

    # What follows from the time step and the limits, worked out when they change (see set_pace).
    paced_us: int = -1
    filter_share: int = 0
    band_share: int = 0
    lag_share: int = 0
    heavy_share: int = 0
    light_share: int = 0
    drift_fcC: int = 0
    rpm_share: int = 0
    heat_limit_nJ: int = 0
    i2t_near_mA2us: int = 0
    i2t_budget_mA2us: int = 0
    i2t_trip_mA2us: int = 0

    state: int = 0
    entered_us: int = 0
    armed_at_us: int = 0

    # What was decided.
    gate: int = 0
    ceiling_mA: list[int] = field(default_factory=_pair)
    ceiling_limiter: list[int] = field(default_factory=_pair)
    applied_mA: list[int] = field(default_factory=_pair)
    duty: list[int] = field(default_factory=_pair)
    limiter: list[int] = field(default_factory=_pair)
    warnings: int = 0

    slew_from_mA: list[int] = field(default_factory=_pair)
    slew_step_mA: int = 0
    cooling: int = 0
    capped: int = 0

    # The setpoint in force.
    setpoint_mA: list[int] = field(default_factory=_pair)
    setpoint_duty: list[int] = field(default_factory=_pair)
    setpoint_us: int = 0
    setpoint_ttl_us: int = 0
    stale_setpoints: int = 0
    stale_at_us: int = 0

    # Arming.
    token: int = 0
    token_us: int = 0
    token_valid: int = 0

    # Faults. The first one stays readable after it is cleared, until another takes its place.
    faults: int = 0
    latched: int = 0
    first_fault: int = 0
    first_channel: int = 0
    first_value: int = 0
    first_limit: int = 0
    first_us: int = 0

    # Where a check or a refusal leaves what it measured, and the limit it compared with.
    value: int = 0
    limit: int = 0
    channel: int = 0

    # Observers, one per spring.
    coldest_cC: int = 2500
    warmest_cC: int = 2500
    sensor_ok: list[int] = field(default_factory=_pair)
    t_cC: list[int] = field(default_factory=lambda: [2500, 2500])
    power_mW: list[int] = field(default_factory=_pair)
    i_uA: list[int] = field(default_factory=_pair)
    v_uV: list[int] = field(default_factory=_pair)
    band_low_uA: list[int] = field(default_factory=_pair)
    band_high_uA: list[int] = field(default_factory=_pair)
    anchor_cC: list[int] = field(default_factory=_pair)
    anchor_other_cC: list[int] = field(default_factory=_pair)
    anchor_net_nJ: list[int] = field(default_factory=_pair)
    anchor_other_nJ: list[int] = field(default_factory=_pair)
    stuck_cC: list[int] = field(default_factory=_pair)
    stuck_us: list[int] = field(default_factory=_pair)
    stuck_low_fcC: list[int] = field(default_factory=_pair)
    off_us: list[int] = field(default_factory=_pair)
    off_fcC: list[int] = field(default_factory=_pair)
    low_fcC: list[int] = field(default_factory=_pair)
    low_seen_fcC: list[int] = field(default_factory=_pair)
    high_fcC: list[int] = field(default_factory=_pair)
    i2t_mA2us: list[int] = field(default_factory=_pair)
    cool_us: list[int] = field(default_factory=_pair)
    cool_from_cC: list[int] = field(default_factory=_pair)
    reference_mohm: list[int] = field(default_factory=_pair)
    reference_cC: list[int] = field(default_factory=_pair)
    last_cC: list[int] = field(default_factory=_four)
    jumps: list[int] = field(default_factory=_four)
    jump_us: list[int] = field(default_factory=_four)
    jump_cC: list[int] = field(default_factory=_four)

    # Debounce, one per line of the check table.
    bad_samples: list[int] = field(init=False)
    bad_us: list[int] = field(init=False)
    need_samples: list[int] = field(init=False)
    need_us: list[int] = field(init=False)

    def __post_init__(self) -> None:
        self.bad_samples = [0] * self.lines
        self.bad_us = [0] * self.lines
        self.need_samples = [0] * self.lines
        self.need_us = [0] * self.lines


def members_of(record: Measurements | Command | Memory) -> list[tuple[str, object]]:
    """Name and value of each member of a record."""
    return [(member.name, getattr(record, member.name)) for member in fields(record)]


def follow(value: int, target: int, share: int) -> int:
    """Return `value` gone a share (in 1/65536) of the way to `target`; never beyond it.

    The translation to C writes this one itself: its ranges could not show the "never".
    """
    return value + ((target - value) * share >> 16)
