"""Effects of no list whose sealed bank was opened last: they have joined development banks.

Where a forcing at another place would leave less than one floor of ten, that place is right, too.
The load cell is beside X, so that a force between the springs has one place.
"""

from evaluation.plant.effect import FLOW, Effect

EFFECTS: tuple[Effect, ...] = (
    Effect("drooping_hold", "dev", "electrical", "1", 0.0221, 0.9, "driven_current",
           "time current",
           "a driver's hold is charged where its set value moves by 5 mA, and droops: "
           "I(1 − e t/10 s), t since then"),
    Effect("lost_frames", "dev", "electrical", "s", 0.00243, 2.0, "driven_current",
           "other_duty current",
           "a starting pump disturbs the other driver's bus: that current stays for e as it was, "
           "from where the motor gains speed faster than 1/s", "across"),
    Effect("parting_strand", "dev", "electrical", "ohm", 0.00685, 0.3,
           "resistance", "displacement velocity",
           "a lead's broken strand parts and meets as it is bent: R + e b, b by dy/1.5 mm within "
           "0…1, y its own contraction", "one"),
    Effect("peak_voltmeter", "dev", "electrical", "s", 0.00901, 3.0, "reading_voltage",
           "reading_rate reading current",
           "a voltmeter's rectifier holds peaks: the reading rises at once, and falls by one pole "
           "of e"),
    Effect("polled_pump", "dev", "thermal", "s", 0.87, 8.0, FLOW, "duty time",
           "a pump's board asks for its duty once in e, and holds it"),
    Effect("decoupled_rotor", "dev", "thermal", "1", 0.202, 0.95, FLOW, "duty",
           "a rotor's magnets slip once its duty is 0.4 ahead of the motor's speed: flow(1 − e), "
           "until the duty is below 0.15", "one"),
    Effect("clouding_inhibitor", "dev", "thermal", "1", 1.17, 8.0, "film", "water",
           "an inhibitor clouds out of warm water onto the wire, and dissolves: film/(1 + e c), "
           "c → (T_w − 33 °C)⁺/10 K in 4 s"),
    Effect("running_varnish", "dev", "thermal", "1", 0.748, 12.0, "film", "wire time",
           "varnish on the wire softens in heat and runs off: film(1 + e m), m the most of "
           "(T − 36 °C)⁺/15 K ≤ 1 so far"),
    Effect("sucked_through_tee", "dev", "thermal", "1", 0.188, 0.95,
           "inlet_water heat_into_water", "other_wire duty other_duty",
           "a tee lets a pump suck at the other tube's outlet: T_in + e(q − p)⁺(T_other − T_in), "
           "q its share of flow, p the other's", "across"),
    Effect("tubes_over_supply", "dev", "thermal", "W", 1.04, 5.0,
           "heat_into_water ambient_air", "current other_current time",
           "both tubes lie above the drivers' supply: + e w on each, w → (I_x² + I_y²)/(4 A)² in "
           "10 s", "both"),
    Effect("heavy_core", "dev", "thermal", "W/K", 0.0553, 4.0, "heat_into_wire",
           "wire wire_rate",
           "a core of 1 J/K in the coil stores heat: + e(T_core − T)"),
    Effect("slewing_transmitter", "dev", "sensors", "s", 3.15, 20.0, "reading_rtd",
           "reading_rate wire_rate reading wire",
           "an RTD's transmitter takes faster changes for faults: it shows at most 10 K in e"),
    Effect("crowded_bus", "dev", "sensors", "s", 0.974, 2.0, "reading_rtd",
           "velocity reading_rate wire_rate",
           "the encoder's counts crowd a bus: both RTDs are read late by e |v|/(|v| + 0.5 mm/s)",
           "both"),
    Effect("warmed_scale", "dev", "sensors", "1", 0.333, 1.5, "reading_displacement",
           "displacement current other_current reading",
           "the encoder's converter beside the drivers warms: x(1 + e w), w → (I_x² + I_y²)/"
           "(4 A)² in 10 s", "both"),
    Effect("sleeping_encoder", "dev", "sensors", "mm", 0.305, 2.5, "reading_displacement",
           "displacement velocity time",
           "an encoder sleeps after 2 s below 0.3 mm/s: it wakes when moved by e, which it loses",
           "both"),
    Effect("kicked_amplifier", "dev", "sensors", "N", 0.223, 0.9, "reading_force",
           "current other_current",
           "switched heaters kick the load cell's amplifier: F + e(j − z), j the sum of both "
           "currents over 4 A, z → j in 1.5 s", "both"),
    Effect("slow_clock", "dev", "sensors", "s", 0.515, 1.6,
           "reading_displacement reading_force", "reading_rate velocity time",
           "the clock of encoder and load cell is slow: both are read late by e t/60 s", "both"),
    Effect("stressed_hall", "dev", "sensors", "1", 0.0193, 0.9, "reading_current",
           "force current reading",
           "the strained frame stresses both current sensors: i[1 + e(F/1.24 N − 1)]", "both"),
    Effect("settling_interfaces", "dev", "phase", "K", 1.42, 14.0, "transformation_shift",
           "fraction time",
           "interfaces settle that stay within the wire: A_s + e m, M_s − e m, m → 1 in 10 s where "
           "0.15 < ξ < 0.85, else → 0 in 2 s"),
    Effect("ageing_at_rest", "dev", "phase", "1", 0.133, 2.0, "recoverable_strain",
           "time transformed force",
           "a wire that rests ages and stiffens: elastic deflection/(1 + e a), a → 1 in 15 s, and "
           "worn off by transforming, exp(−Σ|Δξ|/0.3)"),
    Effect("creeping_austenite", "dev", "phase", "mm", 0.67, 5.0, "recoverable_strain",
           "fraction time force",
           "stressed austenite creeps: deflection + e∫(1 − ξ)F/1.24 N dt/10 s"),
    Effect("pitted_guide", "dev", "mechanics", "N", 0.106, 0.8, "force_cell_on_x",
           "displacement velocity",
           "the tendon catches on a pitted part of its guide: against x by "
           "e b exp[−((x − c)/2 mm)²], b by dx/0.5 mm within ±1", "both"),
    Effect("swelling_seal", "dev", "mechanics", "N", 0.0634, 0.9, "force_cell_on_x",
           "velocity water other_wire",
           "warm outlets swell a seal that rubs on the tendon: e w v/(|v| + 0.5 mm/s), w → both "
           "outlets' ΔT_w/20 K, added, in 5 s", "both"),
    Effect("slipping_ferrule", "dev", "mechanics", "mm", 0.439, 5.0, "recoverable_strain",
           "force time",
           "the tendon slips through its ferrule: it is longer by e∫(F − 1.4 N)⁺/0.2 N dt/10 s",
           "both"),
)  # fmt: skip
