"""Feed-forward from the inverse of the model: which spring to heat now for what is to come.

A reversal costs time before anything moves. The spring that is to pull has to be heated to where
its reverse transformation goes on, T > A_S + τ/C_A (the hysteresis, Eq. (11)), and the one that
pulled has to cool to where it gives way, T < M_S + (τ − τ_s)/C_M (Eq. (13)). Both times follow from
the heat balance of wire and tube water, Eqs (15)–(18) with a water node, solved for time. PI
control alone sees the reversal only after it has happened and lags by that dead time.

Here the dead time is computed at each sample from the measured temperatures and force and an
estimate of the water, and the reversal begins that much before the reference asks for it: during
the dead time the new spring gets full current, then PI control goes on in the new direction.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

from smad.config import FeedforwardConfig
from smad.control.sample import Sample

CALL_BAND_M = 5e-5
"""A direction that was taken is kept until the reference is so far on the other side."""
LONGEST_LEAD_S = 5.0
"""A dead time beyond this is no basis for a prediction."""
_SOON_S = 1e-3


@dataclass(frozen=True, slots=True)
class Advice:
    """What the model says: pull this way (+1: X), for the reference of so far ahead.

    `push` asks for full current until the spring is ready to pull.
    """

    direction: int
    lead_s: float
    push: bool


class SpringHeat:
    """Heat balance of one spring, per metre of wire: wire measured, water estimated."""

    __slots__ = ("_model", "fill", "water_degC")

    def __init__(self, model: FeedforwardConfig, water_degC: float) -> None:
        self._model = model
        self.water_degC = water_degC
        self.fill = 1.0

    def update(
        self, wire_degC: float, inlet_degC: float, duty: float, drain: bool, dt_s: float
    ) -> None:
        """Carry the estimate of the water on over one sample."""
        m = self._model
        if duty > 0.0:
            self.fill = min(1.0, self.fill + duty * dt_s / m.fill_time_s)
        elif drain:
            rest = math.exp(-dt_s / m.drain_time_s)
            self.fill = m.drain_ratio + (self.fill - m.drain_ratio) * rest
        film = m.film_flow_W_per_m_K if duty > 0.0 else m.film_still_W_per_m_K
        flow = duty * m.flow_W_per_m_K / self.fill
        rate = film * (wire_degC - self.water_degC) - (flow + m.loss_W_per_m_K) * (
            self.water_degC - inlet_degC
        )
        # Implicit in the water's own temperature: a nearly empty tube follows the wire within ms.
        share = dt_s / m.water_capacity_J_per_m_K
        self.water_degC += share * rate / (1.0 + share * (film + flow + m.loss_W_per_m_K))

    def time_to_heat(self, wire_degC: float, target_degC: float, current_A: float) -> float:
        """Seconds at `current_A` until the wire is at `target_degC`; 0 when it is there."""
        need_K = target_degC - wire_degC
        if need_K <= 0.0:
            return 0.0
        m = self._model
        water = m.water_capacity_J_per_m_K * self.fill
        film = m.film_still_W_per_m_K * self.fill
        both = m.wire_capacity_J_per_m_K + water
        rate = m.heat_W_per_m_A2 * current_A * current_A / both
        if rate <= 0.0:
            return LONGEST_LEAD_S
        # The wire runs ahead of the mean temperature by `jump`, which builds up over `settle`.
        share = water / both
        settle_s = m.wire_capacity_J_per_m_K * share / film
        jump_K = share * (rate * water / film - (wire_degC - self.water_degC))
        t = need_K / rate
        for _ in range(3):
            decay = math.exp(-t / settle_s)
            slope = rate + jump_K * decay / settle_s
            if slope <= 0.0:
                break
            t = max(0.0, t - (rate * t + jump_K * (1.0 - decay) - need_K) / slope)
        return min(t, LONGEST_LEAD_S)

    def time_to_cool(self, wire_degC: float, target_degC: float, inlet_degC: float) -> float:
        """Seconds with the pump at full duty until the wire is at `target_degC`."""
        if wire_degC <= target_degC:
            return 0.0
        m = self._model
        water = m.water_capacity_J_per_m_K * self.fill
        both = m.wire_capacity_J_per_m_K + water
        mean_degC = (m.wire_capacity_J_per_m_K * wire_degC + water * self.water_degC) / both
        settle_s = m.wire_capacity_J_per_m_K / m.film_flow_W_per_m_K
        if mean_degC <= target_degC:
            return settle_s * math.log((wire_degC - mean_degC) / max(target_degC - mean_degC, 0.05))
        room_K = max(target_degC - inlet_degC, 0.5)
        flush_s = both / m.flow_W_per_m_K
        if mean_degC - inlet_degC <= room_K:
            return settle_s
        return min(settle_s + flush_s * math.log((mean_degC - inlet_degC) / room_K), LONGEST_LEAD_S)


class Anticipation:
    """Decides when to reverse, from the dead times of both springs."""

    __slots__ = ("_called", "_model", "_springs", "_warm_degC", "current_A", "direction")

    def __init__(self, model: FeedforwardConfig, current_A: float) -> None:
        self._model = model
        self.current_A = current_A
        """With which a spring is heated at a reversal."""
        self.direction = 1
        self._called = [False, False]
        self._springs: tuple[SpringHeat, SpringHeat] | None = None
        self._warm_degC = [model.inlet_degC, model.inlet_degC]

    def reset(self) -> None:
        """Forget the estimates; the next sample starts them at the measured temperatures."""
        self._springs = None
        self._called = [False, False]

    def step(
        self,
        reference_m: Callable[[float], float],
        sample: Sample,
        drain: tuple[bool, bool],
        dt_s: float,
    ) -> Advice:
        """Advice for the next control step; `reference_m(lead_s)` looks ahead.

        For a spring whose temperature is not read its last one counts.
        """
        model, rtd, warm = self._model, sample.rtd_degC, self._warm_degC
        inlet_degC = model.inlet_degC if math.isnan(rtd[2]) else rtd[2]
        for k in (0, 1):
            if not math.isnan(rtd[k]):
                warm[k] = rtd[k]
        if self._springs is None:
            self._springs = (SpringHeat(model, warm[0]), SpringHeat(model, warm[1]))
        x, y = self._springs
        x.update(warm[0], inlet_degC, sample.pump_duty[0], drain[0], dt_s)
        y.update(warm[1], inlet_degC, sample.pump_duty[1], drain[1], dt_s)
        stress = model.stress_MPa_per_N * max(0.0, sample.force_N)
        pulls_degC = model.austenite_start_degC + stress / model.slope_austenite_MPa_per_K
        yields_degC = (
            model.martensite_start_degC
            + max(0.0, stress - model.stress_start_MPa) / model.slope_martensite_MPa_per_K
        )
        heat_x_s = x.time_to_heat(warm[0], pulls_degC, self.current_A)
        heat_y_s = y.time_to_heat(warm[1], pulls_degC, self.current_A)
        up_s = max(heat_x_s, y.time_to_cool(warm[1], yields_degC, inlet_degC))
        down_s = max(heat_y_s, x.time_to_cool(warm[0], yields_degC, inlet_degC))
        self._decide(reference_m(up_s), reference_m(down_s), sample.displacement_m)
        if self.direction > 0:
            return Advice(1, up_s, heat_x_s > _SOON_S)
        return Advice(-1, down_s, heat_y_s > _SOON_S)

    def _decide(self, up_m: float, down_m: float, at_m: float) -> None:
        """Keep or change the direction.

        Both directions can be called for at once: the reference is still above and, after the dead
        time, will be below. Then the call that came last counts, or the two would alternate.
        """
        band = CALL_BAND_M
        up = up_m > at_m - (band if self._called[0] else 0.0)
        down = down_m < at_m + (band if self._called[1] else 0.0)
        pulling, other = (up, down) if self.direction > 0 else (down, up)
        other_is_new = not self._called[1 if self.direction > 0 else 0]
        if other and (other_is_new or not pulling):
            self.direction = -self.direction
        self._called = [up, down]
