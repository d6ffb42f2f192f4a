"""PI control with bounds and anti-windup, for displacement (signed current) and temperature."""


class PI:
    """`output = feedforward + kp·error + integral`, held within [low, high].

    While the output is saturated the integral does not grow further into the saturation; a part of
    it that already points there fades with `anti_windup_time_s`. It never winds up beyond the
    bounds, and unlike back-calculation it leaves the proportional part alone, so that a large error
    keeps the full current until it is small.
    """

    __slots__ = ("_fade_time_s", "high", "integral", "ki", "kp", "low")

    def __init__(
        self, kp: float, ki: float, low: float, high: float, anti_windup_time_s: float
    ) -> None:
        self.kp = kp
        self.ki = ki
        self.low = low
        self.high = high
        self._fade_time_s = anti_windup_time_s
        self.integral = 0.0

    def preset(self, output: float, error: float = 0.0) -> None:
        """Choose the integral so that the next output at `error` is `output` (bumpless change)."""
        self.integral = min(self.high, max(self.low, output - self.kp * error))

    def step(self, error: float, dt_s: float, feedforward: float = 0.0) -> float:
        """The output after `dt_s` seconds at `error`, within the bounds."""
        proportional = feedforward + self.kp * error
        integral = self.integral + self.ki * error * dt_s
        unlimited = proportional + integral
        if unlimited > self.high:
            integral = self._saturated(1.0, integral, dt_s)
        elif unlimited < self.low:
            integral = self._saturated(-1.0, integral, dt_s)
        self.integral = min(self.high, max(self.low, integral))
        return min(self.high, max(self.low, proportional + self.integral))

    def _saturated(self, sign: float, integral: float, dt_s: float) -> float:
        if (integral - self.integral) * sign > 0.0:
            integral = self.integral
        if integral * sign > 0.0:
            integral -= integral * min(1.0, dt_s / self._fade_time_s)
        return integral
