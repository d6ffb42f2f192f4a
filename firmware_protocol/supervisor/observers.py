"""What the checks look at besides the raw sample: energies, envelopes and timers of each spring.

This module is translated to C (see translate): integers, no allocation, no exceptions.
Temperatures are cC as measured, and fcC (a cC in 65536 parts) where they are integrated: small
steps count, 32 bits hold them, and a chip without a divider gets cC from them by moving bytes.
"""

from __future__ import annotations

from firmware_protocol.supervisor.limits import Limits
from firmware_protocol.supervisor.memory import Measurements, Memory, follow

FCC_PER_CC = 1 << 16
FCC_PER_K_LOG2 = 12
"""Shares of heat capacity keep so many bits of a step's (mW) to fcC."""
NJ_PER_MJ = 1_000_000
MA2US_PER_A2S = 1_000_000_000_000
DUTY_FULL = 255
TIMER_MOST_US = 1_000_000_000
"""A timer whose value is reported stops here, in C as in Python."""
SUM_MOST = 10_000_000_000_000_000
"""Sums stop here, far above every limit, so that 64 bits are always enough."""
MODEL_MOST_fcC = 30_000 * FCC_PER_CC
POWER_MOST_mW = 100_000
"""Above what the supply can give; a reading beyond it is a broken sense wire."""


def set_pace(s: Memory, lim: Limits) -> None:
    """Work out what follows from time step and limits; once is enough until one changes.

    A share is the part of the way to its target that a filter goes in one step, in 1/65536. Heat:
    1 mW for 1 us into 1 mJ/K is 1 uK, and 10 000 uK are a cC.
    """
    if s.dt_us == s.paced_us:
        return
    s.paced_us = s.dt_us
    s.filter_share = (s.dt_us << 16) // (lim.current_filter_us + s.dt_us)
    s.band_share = (s.dt_us << 16) // (lim.current_band_us + s.dt_us)
    s.lag_share = (s.dt_us << 16) // (lim.envelope_lag_us + s.dt_us)
    s.heavy_share = (s.dt_us << 28) // (lim.envelope_heavy_mJ_per_K * 10_000)
    s.light_share = (s.dt_us << 28) // (lim.envelope_light_mJ_per_K * 10_000)
    s.drift_fcC = (lim.off_drift_cC_per_s * s.dt_us << 16) // 1_000_000
    s.slew_step_mA = lim.current_slew_mA_per_ms * s.dt_us // 1000
    s.rpm_share = (DUTY_FULL << 16) // lim.pump_rpm
    s.heat_limit_nJ = lim.unheated_energy_mJ * NJ_PER_MJ
    s.i2t_near_mA2us = lim.i2t_budget_A2s * 800_000_000_000
    s.i2t_budget_mA2us = lim.i2t_budget_A2s * MA2US_PER_A2S
    s.i2t_trip_mA2us = (11 * lim.i2t_budget_A2s // 10 + 1) * MA2US_PER_A2S


def of_duty(full: int, duty: int) -> int:
    """Return the part of `full` at a duty of 255 parts; 257/65536 is one of them."""
    return full * duty * 257 >> 16


def loss_mW(loss_mW_per_K: int, above_cC: int) -> int:
    """Return what is lost so far above the surroundings.

    41/1024 of a quarter is 1/99.9: a chip without a divider is spared a division by 100.
    """
    return loss_mW_per_K * (above_cC >> 2) * 41 >> 10


def power_mW(i_mA: int, v_mV: int) -> int:
    """Return the heat of a current, at least 0; 131/128 of 1/1024 is 1/1000.5."""
    return min(max((i_mA * v_mV >> 10) * 131 >> 7, 0), POWER_MOST_mW)


def observe_surroundings(s: Memory, m: Measurements, lim: Limits) -> None:
    """Keep the coldest and the warmest that surrounds a spring: water inlet and room."""
    inlet_cC = m.rtd_cC[2]
    ambient_cC = m.rtd_cC[3]
    if not is_believed(m, lim, 2):
        inlet_cC = ambient_cC
    if not is_believed(m, lim, 3):
        ambient_cC = inlet_cC
    if is_believed(m, lim, 2) or is_believed(m, lim, 3):
        s.coldest_cC = min(inlet_cC, ambient_cC)
        s.warmest_cC = max(inlet_cC, ambient_cC)


def is_believed(m: Measurements, lim: Limits, k: int) -> bool:
    """Return whether the reading of RTD k is one that a sensor in order can show."""
    return lim.rail_low_cC < m.rtd_cC[k] < lim.rail_high_cC


def observe_jumps(s: Memory, m: Measurements, lim: Limits) -> None:
    """Count jumps of each RTD from one sample to the next; with time they are forgotten."""
    for j in range(4):
        step_cC = m.rtd_cC[j] - s.last_cC[j]
        s.last_cC[j] = m.rtd_cC[j]
        if abs(step_cC) > lim.jump_cC:
            s.jumps[j] += 1
            s.jump_us[j] = 0
            s.jump_cC[j] = abs(step_cC)
            if j < 2 and is_believed(m, lim, j):
                # A jump is the sensor's; it must not pass for warming. It is one from the last
                # reading that was believed: what a broken sensor showed in between is no place.
                off_fcC = s.off_fcC[j] + (m.rtd_cC[j] - s.t_cC[j]) * FCC_PER_CC
                s.off_fcC[j] = max(off_fcC, lim.rail_low_cC * FCC_PER_CC)
        elif s.jumps[j] > 0:
            s.jump_us[j] += s.dt_us
            if s.jump_us[j] >= lim.jump_decay_us:
                s.jumps[j] -= 1
                s.jump_us[j] = 0


def observe_spring(s: Memory, m: Measurements, lim: Limits, k: int) -> None:
    """Advance what is known of spring k by one sample."""
    before_cC = s.t_cC[k]
    if is_believed(m, lim, k):
        s.t_cC[k] = m.rtd_cC[k]
        s.sensor_ok[k] = 1
    else:
        s.sensor_ok[k] = 0
    observe_electrical(s, m, lim, k)
    # A pump that runs on its own carries heat away like one that is told to.
    flow = max(m.duty[k], min(m.pump_rpm[k] * s.rpm_share >> 16, DUTY_FULL))
    loss_mW_per_K = lim.loss_static_mW_per_K + of_duty(lim.loss_flow_mW_per_K, flow)
    observe_energy(s, lim, k, loss_mW_per_K, min(before_cC, s.t_cC[k]))
    observe_stuck(s, lim, k)
    observe_off(s, m, lim, k)
    observe_envelope(s, lim, k, loss_mW_per_K)
    observe_cooling(s, m, lim, k)
    observe_resistance(s, m, lim, k)
    observe_i2t(s, m, lim, k)


def observe_electrical(s: Memory, m: Measurements, lim: Limits, k: int) -> None:
    """Keep power, filtered current and voltage, and the band the current should be in.

    The band spans what was regulated to lately, so that a driver that lags stays inside.
    """
    s.power_mW[k] = power_mW(m.i_mA[k], m.v_mV[k])
    s.i_uA[k] = follow(s.i_uA[k], m.i_mA[k] * 1000, s.filter_share)
    s.v_uV[k] = follow(s.v_uV[k], m.v_mV[k] * 1000, s.filter_share)
    applied_uA = m.applied_mA[k] * 1000
    low_uA = follow(s.band_low_uA[k], applied_uA, s.band_share)
    high_uA = follow(s.band_high_uA[k], applied_uA, s.band_share)
    s.band_low_uA[k] = min(low_uA, applied_uA)
    s.band_high_uA[k] = max(high_uA, applied_uA)


def observe_energy(s: Memory, lim: Limits, k: int, loss_mW_per_K: int, steady_cC: int) -> None:
    """Sum the energy a spring got since it last warmed by the least rise, losses taken off.

    The losses are the largest a good bench has, and a sensor offset is granted: a positive sum can
    only have warmed the spring, so a good one is not colder than where the sum began, the anchor.
    Only a rise above the anchor begins a new sum, and the anchor follows a fall only when the sum
    has run out, for only then has heat left. So a reading that swings gets each rise once. A good
    spring that cools runs the sum out first; one in balance, pump on or off, sums to nothing.

    steady_cC: the lower of the last two readings, so that a spike is no rise. The sum may fall
    below zero by the debt, so that in a short pause of the current the anchor follows no swing.
    """
    other = 1 - k
    if steady_cC >= s.anchor_cC[k] + lim.unheated_rise_cC:
        s.anchor_cC[k] = steady_cC
        s.anchor_net_nJ[k] = min(s.anchor_net_nJ[k], 0)
        s.anchor_other_cC[k] = s.t_cC[other]
        s.anchor_other_nJ[k] = 0
    excess_cC = s.t_cC[k] - s.coldest_cC
    excess_cC = max(excess_cC, 0)
    net_mW = s.power_mW[k] - loss_mW(loss_mW_per_K, excess_cC + lim.sensor_offset_cC)
    net_nJ = s.anchor_net_nJ[k] + net_mW * s.dt_us
    least_nJ = -lim.unheated_debt_mJ * NJ_PER_MJ
    if net_nJ < least_nJ:
        s.anchor_cC[k] = steady_cC
        s.anchor_other_cC[k] = s.t_cC[other]
        s.anchor_other_nJ[k] = 0
    s.anchor_net_nJ[k] = min(max(net_nJ, least_nJ), SUM_MOST)
    s.anchor_other_nJ[k] = min(s.anchor_other_nJ[k] + s.power_mW[other] * s.dt_us, SUM_MOST)


def observe_stuck(s: Memory, lim: Limits, k: int) -> None:
    """Time how long the reading has been the same to the last digit.

    The slowest good spring at that moment is kept too: only if it warmed since does sameness
    mean anything, for a spring in balance may well stay on one digit.
    """
    if s.t_cC[k] != s.stuck_cC[k]:
        s.stuck_cC[k] = s.t_cC[k]
        s.stuck_us[k] = 0
        s.stuck_low_fcC[k] = s.low_fcC[k]
    else:
        s.stuck_us[k] = min(s.stuck_us[k] + s.dt_us, TIMER_MOST_US)


def is_heated(s: Memory, m: Measurements, lim: Limits, k: int) -> bool:
    """Return whether spring k gets or should get current."""
    return m.applied_mA[k] > 0 or s.i_uA[k] > lim.off_current_mA * 1000


def observe_off(s: Memory, m: Measurements, lim: Limits, k: int) -> None:
    """Follow the temperature downwards, and upwards at most as fast as a room drifts.

    Begins when the current has been off for longer than the sensor and the wall may lag.
    """
    now_fcC = s.t_cC[k] * FCC_PER_CC
    if is_heated(s, m, lim, k):
        s.off_us[k] = 0
    else:
        s.off_us[k] += s.dt_us
    if s.off_us[k] < lim.off_lag_us or now_fcC < s.off_fcC[k]:
        s.off_fcC[k] = now_fcC
    else:
        s.off_fcC[k] = min(now_fcC, s.off_fcC[k] + s.drift_fcC)


def observe_envelope(s: Memory, lim: Limits, k: int, loss_mW_per_K: int) -> None:
    """Advance the lightest and the heaviest spring that any good bench could be.

    The heavy one takes the most energy to warm and loses most; its reading lags. The light one
    is the opposite. A good spring stays between them.
    """
    above_cC = s.low_fcC[k] // FCC_PER_CC - s.coldest_cC
    low_loss = loss_mW_per_K
    if above_cC < 0:
        low_loss = lim.envelope_loss_least_mW_per_K
    net_mW = s.power_mW[k] - loss_mW(low_loss, above_cC)
    low_fcC = s.low_fcC[k] + (net_mW * s.heavy_share >> FCC_PER_K_LOG2)
    s.low_fcC[k] = min(low_fcC, MODEL_MOST_fcC)
    s.low_seen_fcC[k] = follow(s.low_seen_fcC[k], s.low_fcC[k], s.lag_share)

    above_cC = s.high_fcC[k] // FCC_PER_CC - s.warmest_cC
    high_loss = lim.envelope_loss_least_mW_per_K
    if above_cC < 0:
        high_loss = loss_mW_per_K
    net_mW = s.power_mW[k] - loss_mW(high_loss, above_cC)
    high_fcC = s.high_fcC[k] + (net_mW * s.light_share >> FCC_PER_K_LOG2)
    s.high_fcC[k] = min(high_fcC, (s.t_cC[k] + lim.envelope_span_cC) * FCC_PER_CC)


def observe_cooling(s: Memory, m: Measurements, lim: Limits, k: int) -> None:
    """Time how long the pump of spring k has run at full duty with the heater off."""
    if is_heated(s, m, lim, k) or m.duty[k] < DUTY_FULL - 25 or s.cool_us[k] >= lim.cooling_us:
        s.cool_us[k] = 0
        s.cool_from_cC[k] = s.t_cC[k]
    else:
        s.cool_us[k] += s.dt_us


def resistance_mohm(s: Memory, k: int) -> int:
    """Return V/I of spring k, where it can be measured."""
    return max((s.v_uV[k] >> 6) * 1000 // max(s.i_uA[k] >> 6, 1), 0)


def observe_resistance(s: Memory, m: Measurements, lim: Limits, k: int) -> None:
    """Take the first resistance that can be measured after arming as the reference."""
    if s.reference_mohm[k] == 0 and resistance_is_measurable(s, m, lim, k):
        s.reference_mohm[k] = resistance_mohm(s, k)
        s.reference_cC[k] = s.t_cC[k]


def resistance_is_measurable(s: Memory, m: Measurements, lim: Limits, k: int) -> bool:
    """Return whether V/I of spring k means something: enough current, for long enough."""
    least_uA = lim.resistance_current_mA * 1000
    return s.i_uA[k] >= least_uA and s.band_low_uA[k] >= least_uA


def observe_i2t(s: Memory, m: Measurements, lim: Limits, k: int) -> None:
    """Sum the square of the current above the rated one; below it the sum shrinks."""
    if m.i_mA[k] <= lim.i2t_rated_mA and s.i2t_mA2us[k] == 0:
        return
    rated_mA2 = lim.i2t_rated_mA * lim.i2t_rated_mA
    total = s.i2t_mA2us[k] + (m.i_mA[k] * m.i_mA[k] - rated_mA2) * s.dt_us
    s.i2t_mA2us[k] = min(max(total, 0), SUM_MOST)


def reset_spring(s: Memory, k: int) -> None:
    """Begin the observers of spring k at its present temperature, as on arming."""
    t_cC = s.t_cC[k]
    s.anchor_cC[k] = t_cC
    s.anchor_other_cC[k] = s.t_cC[1 - k]
    s.anchor_net_nJ[k] = 0
    s.anchor_other_nJ[k] = 0
    s.stuck_us[k] = 0
    s.stuck_low_fcC[k] = t_cC * FCC_PER_CC
    s.off_us[k] = 0
    s.off_fcC[k] = t_cC * FCC_PER_CC
    s.low_fcC[k] = t_cC * FCC_PER_CC
    s.low_seen_fcC[k] = t_cC * FCC_PER_CC
    s.high_fcC[k] = t_cC * FCC_PER_CC
    s.cool_us[k] = 0
    s.cool_from_cC[k] = t_cC
    s.reference_mohm[k] = 0


def forget_jumps(s: Memory, m: Measurements) -> None:
    """Begin to count jumps at the present readings."""
    for j in range(4):
        s.last_cC[j] = m.rtd_cC[j]
        s.jumps[j] = 0
        s.jump_us[j] = 0
