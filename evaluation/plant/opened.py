"""Effects of no list whose sealed bank was opened last: they have joined development banks.

Where a forcing at another place would leave less than one floor of ten, that place is right, too.
The load cell is beside X, so that a force between the springs has one place.
"""

from evaluation.plant.effect import FLOW, Effect

EFFECTS: tuple[Effect, ...] = (
    Effect("inrush_limiter", "dev", "electrical", "1", 0.0154, 0.9, "driven_current",
           "current time",
           "a limiter of inrush resists until its current has warmed it: I[1 − e/(1 + 8h)], h → "
           "(I/4 A)² in 3 s"),
    Effect("settling_reference", "dev", "electrical", "1", 0.0176, 0.6, "driven_current",
           "time current",
           "a driver's reference settles after it is switched on: I[1 + e exp(−t/12 s)]"),
    Effect("warm_martensite_resists", "dev", "electrical", "1", 0.00948, 0.5,
           "resistance reading_voltage",
           "wire fraction",
           "martensite conducts worse as it warms, austenite does not: R[1 + e ξ(T − 27 °C)/10 K]"),
    Effect("compressing_divider", "dev", "electrical", "1", 0.0345, 6.0,
           "reading_voltage resistance",
           "reading current",
           "a voltmeter's divider compresses: V/(1 + e V/12 V)"),
    Effect("play_in_throttle", "dev", "thermal", "1", 0.0531, 1.6, FLOW, "duty",
           "a throttle behind a pump has play: the flow's share follows within e/2"),
    Effect("kick_started_pump", "dev", "thermal", "1", 0.325, 6.0, FLOW, "duty time",
           "a pump's board kicks it off: flow's share + e k, k gains what its duty gains, and "
           "fades in 1.5 s", "one"),
    Effect("lagging_mixer_tap", "dev", "thermal", "K", 4.57, 20.0,
           "inlet_water heat_into_water",
           "duty other_duty time",
           "a mixing tap behind the inlet's sensor answers late to what is drawn: T_in + e(q − z), "
           "q both flows' share, z → q in 5 s", "both"),
    Effect("scoured_slime", "dev", "thermal", "1", 0.415, 40.0, "film", "water duty time",
           "slime grows on the coil in warm water, and is scoured off: film/(1 + e b), b gains "
           "(T_w − 30 °C)⁺/10 K each 10 s, and fades by exp(−∫q dt/6 s), q the flow's share"),
    Effect("thermostat_fan", "dev", "thermal", "1", 2.82, 80.0, "heat_into_water",
           "water time",
           "a fan cools its tube from a mean T_w of 36 °C on, until it is below 32 °C: "
           "loss(1 + e m), m in 1 s", "one"),
    Effect("dummy_load_under_tubes", "dev", "thermal", "W", 0.915, 10.0,
           "heat_into_water ambient_air",
           "current other_current time",
           "the supply's dummy load lies under both tubes: + e b on each, b → 1 in 3 s where "
           "I_x + I_y < 0.5 A, else → 0", "both"),
    Effect("clamp_pressed_by_pull", "dev", "thermal", "W/K", 0.0223, 1.0,
           "heat_into_wire recoverable_strain",
           "force wire",
           "its pull presses the wire into the clamp at the inlet's end: − e F/1.24 N (T − T_room) "
           "there", "one"),
    Effect("jet_on_rtd", "dev", "sensors", "1", 0.525, 0.95, "reading_rtd",
           "duty wire water reading",
           "the feed's jet reaches an RTD: T − e q(T − T_w), q the flow's share, T_w at the "
           "inlet's end"),
    Effect("quadratic_rtd", "dev", "sensors", "K", 2.91, 12.0, "reading_rtd",
           "reading wire",
           "a converter leaves an RTD's curvature: T + e((T − 27 °C)/20 K)²"),
    Effect("sloping_interpolator", "dev", "sensors", "mm", 2.09, 8.0, "reading_displacement",
           "displacement reading",
           "the encoder's interpolator has the wrong slope between lines: x + e[frac(x/4 mm + c) − "
           "c]", "both"),
    Effect("joined_scales", "dev", "sensors", "1", 0.173, 0.9, "reading_displacement",
           "displacement reading",
           "the encoder's scale is joined of two unlike ones: x(1 + e) where x > 0", "both"),
    Effect("taut_cell_cable", "dev", "sensors", "N", 0.128, 0.9, "reading_force",
           "displacement",
           "the load cell's cable draws taut: F + e(x/5 mm − 0.3)⁺", "both"),
    Effect("sagging_excitation", "dev", "sensors", "1", 0.0586, 0.9, "reading_force",
           "current other_current force reading",
           "the load cell's excitation sags under the heaters: F[1 − e(I_x + I_y)/4 A]", "both"),
    Effect("sensors_on_pump_rail", "dev", "sensors", "1", 0.00661, 0.45, "reading_current",
           "other_duty duty current reading",
           "both current sensors share the pumps' rail: i[1 − e(w_x + w_y)], the motors' speeds",
           "both"),
    Effect("mismatched_coat", "dev", "phase", "K", 2.25, 12.0, "transformation_shift",
           "wire water",
           "a coat on the wire that widens less strains it: both thresholds + e(T − T_w)/10 K"),
    Effect("uneven_latent", "dev", "phase", "1", 0.907, 4.0, "heat_into_wire",
           "fraction_rate fraction",
           "the last martensite to go takes the more heat: L[1 + e(1 − ξ)]"),
    Effect("late_strain", "dev", "phase", "mm", 3.26, 12.0, "recoverable_strain",
           "fraction fraction_rate time",
           "grains hold the strain back that transforming sets free: deflection + e(z − ξ), z → ξ "
           "in 3 s"),
    Effect("paddle_in_water", "dev", "mechanics", "N", 0.141, 0.9, "force_cell_on_x",
           "velocity",
           "a paddle on the tendon dips into water: against x by e v|v|/(5 mm/s)²", "both"),
    Effect("ball_in_notch", "dev", "mechanics", "N", 0.0879, 0.25, "force_cell_on_x",
           "displacement",
           "a ball snaps into a notch of the tendon's slide: against x by e d exp[(1 − d²)/2], d = "
           "(x − c)/2 mm", "both"),
    Effect("shaken_knot", "dev", "mechanics", "mm", 1.56, 8.0, "recoverable_strain",
           "duty other_duty time",
           "the tendon's knot gives as the pumps shake it: longer by e[1 − exp(−∫(w_x + w_y)dt/"
           "10 s)], the motors' speeds", "both"),
)  # fmt: skip
