"""Sections of the control loops and of the host's limits; see `smad.config.model`."""

from typing import Annotated, Literal

from msgspec import field

from smad.config.section import HOST, Section, about, above, between


class CoolingConfig(Section, frozen=True, kw_only=True):
    """When the pump of the spring that does not pull runs."""

    mode: Annotated[
        Literal["switch", "proportional", "off"],
        about("full on and off with hysteresis; duty by demand; or no water at all"),
    ] = "switch"
    on_threshold_A: Annotated[
        float, between(0.0, 4.0, "demand on the pulling spring that starts the pump")
    ] = 0.2
    off_threshold_A: Annotated[float, between(0.0, 4.0, "demand below which the pump stops")] = 0.05
    min_on_s: Annotated[float, between(0.0, 60.0, "shortest time on")] = 0.2
    min_off_s: Annotated[float, between(0.0, 60.0, "shortest time off (heating needs no wait)")] = (
        0.2
    )
    switch_duty: Annotated[float, between(0.0, 1.0, "pump duty while on, in mode switch")] = 1.0
    full_duty_current_A: Annotated[
        float, between(0.1, 4.0, "demand that means duty 1, in mode proportional")
    ] = 4.0
    after_heat_s: Annotated[
        float, between(0.0, 60.0, "water waits so long after its spring was heated")
    ] = 0.1
    urgent_A: Annotated[float, between(0.0, 4.0, "demand that waits for no shortest time")] = 1.0

    def __post_init__(self) -> None:
        Section.__post_init__(self)
        if self.off_threshold_A > self.on_threshold_A:
            raise ValueError(
                f"`off_threshold_A` {self.off_threshold_A} is above `on_threshold_A` "
                f"{self.on_threshold_A}; a switch without hysteresis chatters"
            )


class HoldConfig(Section, frozen=True, kw_only=True):
    """A quiet hold: at a constant reference that is reached, no pump runs."""

    band_mm: Annotated[
        float, between(0.0, 1.0, "full width about the reference: no error within")
    ] = 0.01
    near_bands: Annotated[
        float, between(0.5, 1000.0, "quiet within so many bands, until twice as far off")
    ] = 5.0
    settled_s: Annotated[float, between(0.0, 60.0, "quiet after so long within them")] = 0.3
    smooth_s: Annotated[
        float, between(0.0, 10.0, "time constant that smooths error and temperatures")
    ] = 0.2
    ease_s: Annotated[float, between(0.1, 600.0, "on arrival the integral fades so")] = 5.0
    arrive_s: Annotated[
        float, between(0.0, 600.0, "so long after, both springs are kept as warm as then")
    ] = 5.0
    kept_A_per_K: Annotated[
        float, between(0.0, 100.0, "proportional gain on a kept temperature")
    ] = 0.5
    kept_A_per_K_s: Annotated[float, between(0.0, 100.0, "integral gain on a kept temperature")] = (
        0.1
    )
    kept_K_per_mm: Annotated[
        float, between(0.0, 1000.0, "kept temperatures move apart by the error")
    ] = 30.0
    kept_K_per_mm_s: Annotated[float, between(0.0, 1000.0, "and by its integral")] = 10.0
    reversal_A: Annotated[
        float, between(0.0, 4.0, "demand on the other spring that turns to it")
    ] = 0.3
    reversal_smooth_s: Annotated[
        float, between(0.0, 1.0, "time constant that smooths that demand")
    ] = 0.03


class TemperatureConfig(Section, frozen=True, kw_only=True):
    """PI control that holds one spring at a temperature."""

    kp_A_per_K: Annotated[float, between(0.0, 100.0, "proportional gain")] = 0.5
    ki_A_per_K_s: Annotated[float, between(0.0, 100.0, "integral gain")] = 0.02
    pump_above_K: Annotated[
        float, between(0.0, 100.0, "so far above the target, the pump cools")
    ] = 2.0


class FeedforwardConfig(Section, frozen=True, kw_only=True):
    """Inverse model that begins reversals early. The defaults are parameter set A."""

    enabled: Annotated[bool, about("use it from the start; `tune` changes it")] = False
    wire_capacity_J_per_m_K: Annotated[
        float, above(0.0, 1000.0, "heat capacity of the wire, per metre")
    ] = 1.328
    water_capacity_J_per_m_K: Annotated[
        float, above(0.0, 1000.0, "heat capacity of the water that warms")
    ] = 6.276
    film_still_W_per_m_K: Annotated[float, above(0.0, 1000.0, "wire to water, pump off")] = 3.2
    film_flow_W_per_m_K: Annotated[float, above(0.0, 1000.0, "wire to water, pump on")] = 20.0
    flow_W_per_m_K: Annotated[
        float, above(0.0, 1000.0, "carried off by the water at full duty")
    ] = 1.346
    loss_W_per_m_K: Annotated[float, between(0.0, 100.0, "lost from the tube to the air")] = 0.05
    heat_W_per_m_A2: Annotated[float, above(0.0, 1000.0, "heat of 1 A in a metre of wire")] = 1.856
    austenite_start_degC: Annotated[float, between(-50.0, 150.0, "A_S without stress")] = 28.0
    slope_austenite_MPa_per_K: Annotated[float, above(0.0, 100.0, "C_A")] = 8.0
    martensite_start_degC: Annotated[float, between(-50.0, 150.0, "M_S without stress")] = 35.0
    slope_martensite_MPa_per_K: Annotated[float, above(0.0, 100.0, "C_M")] = 4.6
    stress_start_MPa: Annotated[
        float, between(0.0, 1000.0, "stress at which detwinning starts")
    ] = 58.0
    stress_MPa_per_N: Annotated[
        float, above(0.0, 10_000.0, "shear stress of 1 N of tension, C1")
    ] = 45.86
    inlet_degC: Annotated[
        float, between(0.0, 60.0, "water at the inlet, where no sensor measures it")
    ] = 26.85
    fill_time_s: Annotated[float, above(0.0, 600.0, "to fill a drained tube at full duty")] = 4.66
    drain_time_s: Annotated[float, above(0.0, 600.0, "time constant of draining")] = 1.0
    drain_ratio: Annotated[
        float, above(0.0, 1.0, "water that draining leaves, over a full tube")
    ] = 0.05


class RepeatConfig(Section, frozen=True, kw_only=True):
    """Deviation from the recorded run at which a repeated run ends."""

    displacement_mm: Annotated[
        float, above(0.0, 50.0, "between displacement and the recorded one")
    ] = 4.0
    temperature_K: Annotated[
        float, above(0.0, 100.0, "between a spring and its recorded temperature")
    ] = 8.0
    force_N: Annotated[float, above(0.0, 100.0, "between tendon force and the recorded one")] = 1.0
    for_s: Annotated[float, between(0.0, 60.0, "a reading may be further off for so long")] = 0.5


class ControlConfig(Section, frozen=True, kw_only=True):
    """PI control on displacement: the demand heats the spring that has to pull."""

    kp_A_per_mm: Annotated[float, between(0.0, 1000.0, "proportional gain")] = 28.0
    ki_A_per_mm_s: Annotated[float, between(0.0, 1000.0, "integral gain")] = 23.0
    current_limit_A: Annotated[
        float, between(0.0, HOST.current_mA / 1000, "largest current in a spring")
    ] = 4.0
    anti_windup_time_s: Annotated[
        float, between(0.01, 100.0, "the integral fades so while it saturates the output")
    ] = 0.5
    handover_rate_mm_per_s: Annotated[
        float, between(0.01, 100.0, "reference speed between two queued trajectories")
    ] = 5.0
    drain_before_heating: Annotated[
        bool, about("let the water out of a tube while its spring is heated")
    ] = False
    hold: HoldConfig = field(default_factory=HoldConfig)
    cooling: CoolingConfig = field(default_factory=CoolingConfig)
    feedforward: FeedforwardConfig = field(default_factory=FeedforwardConfig)
    temperature: TemperatureConfig = field(default_factory=TemperatureConfig)
    repeat: RepeatConfig = field(default_factory=RepeatConfig)


class LimitsConfig(Section, frozen=True, kw_only=True):
    """The host's own limits. Arming is refused while one is looser than the board's."""

    temperature_max_degC: Annotated[
        float,
        between(30.0, HOST.temperature_cC / 100, "hottest spring; current goes to 0 above it"),
    ] = 80.0
    displacement_max_mm: Annotated[
        float, between(0.1, 50.0, "largest displacement either way, and largest reference")
    ] = 15.0
    force_max_N: Annotated[float, between(0.1, 100.0, "largest tendon force")] = 10.0
    on_time_max_s: Annotated[
        float, between(1.0, HOST.on_time_s, "longest time armed without a new arming")
    ] = 3600.0
    current_rate_max_A_per_s: Annotated[
        float, between(0.1, HOST.current_slew_mA_per_ms, "fastest rise of a current setpoint")
    ] = 400.0
    reference_rate_max_mm_per_s: Annotated[
        float, between(0.01, 1000.0, "fastest ramp or sinusoid a command may ask for")
    ] = 50.0
    temperature_rate_max_K_per_s: Annotated[
        float, between(0.1, 1000.0, "faster than this is a broken sensor")
    ] = 50.0

    def in_words(self, field: str) -> str:
        """Return how far a displacement may go, or how fast a rate may be, by the field's name."""
        if field.endswith("_mm_per_s"):
            return f"up to {self.reference_rate_max_mm_per_s:g} mm/s"
        return f"up to ±{self.displacement_max_mm:g} mm"
