"""PI control with bounds and anti-windup, for displacement (signed current) and temperature."""


class PI:
    """`output = feedforward + kp·error + integral`, held within [low, high].

    While the output is saturated the integral does not grow further into the saturation; a part of
    it that already points there fades with `anti_windup_time_s`. It never winds up beyond the
    bounds, and unlike back-calculation it leaves the proportional part alone, so that a large error
    keeps the full current until it is small.
    """

    __slots__ = ("_error", "_fade_time_s", "high", "integral", "ki", "kp", "low")

    def __init__(
        self, kp: float, ki: float, low: float, high: float, anti_windup_time_s: float
    ) -> None:
        self.kp = kp
        self.ki = ki
        self.low = low
        self.high = high
        self._fade_time_s = anti_windup_time_s
        self.integral = 0.0
        self._error = 0.0

    def preset(self, output: float, error: float = 0.0) -> None:
        """Choose the integral so that the next output at `error` is `output` (bumpless change)."""
        self.integral = self._bounded(output - self.kp * error)
        self._error = error

    def retune(self, kp: float) -> None:
        """Take another proportional gain; with an integral gain the output stays as it is."""
        output = self._bounded(self.kp * self._error + self.integral)
        self.kp = kp
        if self.ki > 0.0 and self._bounded(kp * self._error + self.integral) != output:
            self.preset(output, self._error)

    def step(self, error: float, dt_s: float, feedforward: float = 0.0) -> float:
        """The output after `dt_s` seconds at `error`, within the bounds."""
        self._error = error
        proportional = feedforward + self.kp * error
        integral = self.integral + self.ki * error * dt_s
        unlimited = proportional + integral
        if unlimited > self.high:
            integral = self._saturated(1.0, integral, dt_s)
        elif unlimited < self.low:
            integral = self._saturated(-1.0, integral, dt_s)
        self.integral = self._bounded(integral)
        return self._bounded(proportional + self.integral)

    def _bounded(self, value: float) -> float:
        return min(self.high, max(self.low, value))

    def _saturated(self, sign: float, integral: float, dt_s: float) -> float:
        if (integral - self.integral) * sign > 0.0:
            integral = self.integral
        if integral * sign > 0.0:
            integral -= integral * min(1.0, dt_s / self._fade_time_s)
        return integral
