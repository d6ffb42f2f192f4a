"""Effects that nobody who works on the diagnosis reads before a bank of them is opened.

Where a forcing at another place would leave less than one floor of ten, that place is right, too.
The load cell is beside X, so that a force between the springs has one place.
"""

from evaluation.plant.effect import FLOW, Effect

EFFECTS: tuple[Effect, ...] = (
    Effect("idle_tone_of_modulator", "sealed", "electrical", "1", 0.00795, 0.5, "driven_current",
           "current time",
           "a driver's modulator has an idle tone, the higher the more it drives: "
           "I[1 + e sin(2π∫I dt/8 A s + c)]"),
    Effect("thermistor_on_wrong_tube", "sealed", "electrical", "1", 0.00613, 0.5, "driven_current",
           "other_wire current time",
           "the thermistor that holds a driver back is tied to the other tube: I(1 − e w), w → "
           "that one's ΔT_w⁺/10 K in 5 s", "across"),
    Effect("rewelding_crimp", "sealed", "electrical", "ohm", 0.00309, 0.3,
           "resistance reading_voltage",
           "velocity current time",
           "the crimp at the inlet's end frets as its spring moves, and current welds it again: "
           "R + e f, f gains |dx|/10 mm, and fades by exp(−∫(I/4 A)² dt/3 s)", "one"),
    Effect("slow_at_small_signal", "sealed", "electrical", "1", 0.0143, 0.95, "reading_voltage",
           "reading_rate reading current time",
           "a voltmeter averages some of what it sees, the longer the less it is: V − e(V − z), z "
           "→ V in 1 V s/(0.2 V + V)"),
    Effect("pulsing_rollers", "sealed", "thermal", "1", 0.437, 0.95, FLOW, "duty time",
           "a pump's rollers pulse as they turn: flow[1 + e sin(2π∫w dt/8 s + c)], w its speed"),
    Effect("sticking_flap", "sealed", "thermal", "1", 0.449, 0.95, FLOW, "duty time",
           "a flap behind a pump sticks as it rests: flow(1 − e s), s → 1 in 5 s below a twentieth "
           "of its speed w, and fades by exp(−∫w dt/2 s)", "one"),
    Effect("ice_in_vessel", "sealed", "thermal", "K", 5.7, 20.0,
           "inlet_water heat_into_water",
           "duty other_duty time",
           "water behind the inlet's sensor passes ice, which melts and freezes again: T_in − e i, "
           "i gains (1 − i) each 20 s and loses i q each 4 s, q both flows' share", "both"),
    Effect("clinging_gas", "sealed", "thermal", "1", 0.486, 40.0, "film", "wire water time",
           "gas comes out of the water on the hotter wire, and clings: film/(1 + e m) from a mean "
           "T − T_w of 5 K on, until it is below 2 K, m in 0.5 s"),
    Effect("rack_fan", "sealed", "thermal", "1", 2.73, 80.0, "heat_into_water",
           "current other_current water time",
           "the drivers' rack has a fan that blows on both tubes: loss(1 + e m) from h > 0.25 on, "
           "until h < 0.12, m in 1 s, h → (I_x² + I_y²)/(4 A)² in 8 s", "both"),
    Effect("warm_puddle", "sealed", "thermal", "W", 0.399, 2.0, "heat_into_water",
           "duty water time",
           "an outlet leaks a puddle that warms its tube: + e g, g gains q ΔT_w⁺/10 K of the "
           "outlet each 4 s, and fades in 10 s, q the flow's share"),
    Effect("chopper_in_coil", "sealed", "thermal", "W", 1.07, 10.0, "heat_into_wire",
           "other_duty",
           "the other pump's chopper induces currents in the coil: + 4e w(1 − w), w its speed",
           "across"),
    Effect("lead_drawn_to_heater", "sealed", "sensors", "K", 5.02, 20.0, "reading_rtd",
           "displacement current",
           "a coil drawn in draws an RTD's lead to that of the heater: T + e I/4 A y⁺/5 mm, y its "
           "own contraction"),
    Effect("breathing_sheath", "sealed", "sensors", "K", 3.92, 20.0, "reading_rtd",
           "reading_rate wire_rate time",
           "an RTD's sheath draws moisture as it cools: T − e b, b gains (−dT)⁺/10 K, and dries in "
           "6 s", "one"),
    Effect("blind_to_creeping", "sealed", "sensors", "1", 0.354, 0.9, "reading_displacement",
           "velocity displacement",
           "the encoder loses lines of a creeping scale: x − e∫dx/[1 + (v/1.5 mm/s)²]", "both"),
    Effect("sagging_span", "sealed", "sensors", "mm", 3.09, 12.0, "reading_displacement",
           "force",
           "the tendon's span before the encoder sags: x + e(1.24 N/F − 1)", "both"),
    Effect("tipping_cell", "sealed", "sensors", "N", 0.193, 0.9, "reading_force",
           "velocity time",
           "the load cell tips on its seat the way the tendon runs: F + e r, r → v/(|v| + 1 mm/s) "
           "in 2 s", "both"),
    Effect("brush_noise_on_bridge", "sealed", "sensors", "N", 0.115, 0.9, "reading_force",
           "other_duty current duty other_current",
           "a heater's lead brings the sparks of the other pump to the load cell's bridge: F + "
           "e(w_x I_y + w_y I_x)/4 A, w the motors' speeds", "both"),
    Effect("shunt_in_feed", "sealed", "sensors", "1", 0.0191, 0.9, "reading_current",
           "current duty time reading",
           "a shunt warms itself, and its pump's feed cools it: i(1 + e h), h gains (I/4 A)² − "
           "h(1 + 6q) each 5 s, q the flow's share"),
    Effect("walls_pinned_at_rest", "sealed", "phase", "K", 3.16, 15.0, "transformation_shift",
           "fraction_rate time transformed",
           "interfaces at rest are pinned until they have moved: A_s + e p, M_s − e p, p → 1 in "
           "10 s, and worn off by exp(−Σ|Δξ|/0.25)"),
    Effect("rubbing_walls", "sealed", "phase", "J", 5.29, 14.0, "heat_into_wire",
           "fraction_rate",
           "moving interfaces rub, either way: + e r, r → |dξ/dt| in 0.3 s"),
    Effect("twins_shaken_by_pump", "sealed", "phase", "mm", 4.4, 14.0, "recoverable_strain",
           "duty fraction time",
           "a running pump shakes martensite's twins open: deflection + e ξ z, z → its speed in "
           "2 s"),
    Effect("guide_grips_at_rest", "sealed", "mechanics", "N", 0.392, 0.9, "force_cell_on_x",
           "velocity time displacement",
           "a guide grips what rests in it: against x by e s v/(|v| + 0.5 mm/s), s → 1 in 4 s, and "
           "worn off by exp(−∫|dx|/2 mm)", "both"),
    Effect("gel_pad", "sealed", "mechanics", "N", 0.0762, 0.9, "force_cell_on_x",
           "displacement time velocity",
           "a gel between tendon and frame yields: against x by e(x − z)/5 mm, z → x in 5 s",
           "both"),
    Effect("bulging_end_cap", "sealed", "mechanics", "mm", 3.23, 10.0, "recoverable_strain",
           "duty time",
           "the water's pressure bulges the cap that holds a spring: deflection − e p, p → q² in "
           "1 s, q the flow's share", "one"),
)  # fmt: skip

SIGNED: frozenset[str] = frozenset(
    (
        "breathing_sheath",
        "brush_noise_on_bridge",
        "lead_drawn_to_heater",
        "shunt_in_feed",
        "twins_shaken_by_pump",
    )
)
"""Those whose magnitude may be negative."""
