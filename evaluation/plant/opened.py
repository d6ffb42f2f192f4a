"""Effects of no list whose sealed bank was opened last: they have joined development banks.

Where a forcing at another place would leave less than one floor of ten, that place is right, too.
The load cell is beside X, so that a force between the springs has one place.
"""

from evaluation.plant.effect import FLOW, Effect

EFFECTS: tuple[Effect, ...] = (
    Effect("bimetal_cutout", "dev", "electrical", "1", 0.0217, 0.9, "driven_current",
           "wire current",
           "a bimetal beside its wire puts a resistor before the heater: I(1 − e) from a mean "
           "of 46 °C on, until it is below 40 °C, in 0.3 s", "one"),
    Effect("beating_bridges", "dev", "electrical", "1", 0.0454, 0.8, "driven_current",
           "time current other_current",
           "two bridges switch at nearly the same rate: each current + e min(I, J) sin(2πt/11 s "
           "+ c)", "both"),
    Effect("scattering_interfaces", "dev", "electrical", "1", 0.0159, 0.6, "resistance",
           "fraction",
           "interfaces between the phases scatter electrons: R[1 + 4e ξ(1 − ξ)]"),
    Effect("soaking_sense", "dev", "electrical", "1", 0.00995, 0.9, "reading_voltage",
           "reading_rate reading current",
           "the voltmeter's capacitor soaks: V − e(V − z), z → V in 5 s"),
    Effect("cracking_valve", "dev", "thermal", "1", 0.112, 0.6, FLOW, "duty",
           "a valve opens only against a pressure: flow of the share (q − e)⁺", "one"),
    Effect("narrow_return", "dev", "thermal", "1", 0.27, 8.0, FLOW, "duty other_duty",
           "both tubes return through one narrow hose: flow/[1 + e(q_x + q_y)²], the flows' "
           "shares without it", "both"),
    Effect("crackling_wire", "dev", "thermal", "1", 0.53, 20.0, "film", "fraction_rate",
           "the transforming wire crackles, which stirs: film[1 + e r/(r + 0.05/s)], r → "
           "|dξ/dt| in 0.3 s"),
    Effect("relay_chiller", "dev", "thermal", "K", 2.89, 18.0, "inlet_water heat_into_water",
           "water duty other_wire other_duty",
           "a chiller behind the inlet's sensor is switched by what returns: T_in − e m, m → 1 "
           "in 3 s from h > 0.5 on, until h < 0.25; h gains qΔT_out/10 K of both tubes each 4 "
           "s, and fades in 20 s", "both"),
    Effect("fanned_by_tendon", "dev", "thermal", "1", 9.87, 80.0, "heat_into_water",
           "velocity water",
           "a vane on the tendon fans both tubes: loss[1 + e |v|/(|v| + 2 mm/s)]", "both"),
    Effect("motor_under_tube", "dev", "thermal", "W", 1.39, 20.0, "heat_into_water",
           "duty time",
           "a pump's motor warms its tube from below: + e w, w → its speed in 8 s"),
    Effect("sprayed_clamp", "dev", "thermal", "W/K", 0.087, 2.0, "heat_into_wire", "duty wire",
           "pumped water sprays the clamp at the outlet's end: − e m(T − T_room) there, m → the "
           "flow's share in 2 s, and dries in 12 s", "one"),
    Effect("leaking_insulation", "dev", "sensors", "K", 3.38, 20.0, "reading_rtd",
           "current water",
           "an RTD's insulation leaks in warm water: T + e I/4 A (T_w − 27 °C)⁺/10 K", "one"),
    Effect("unsynchronised_clock", "dev", "sensors", "s", 1.08, 2.4, "reading_rtd",
           "reading_rate wire_rate time",
           "the RTDs' clock is not synchronised: both are read late by e z, z from 0 to 1 in "
           "every 13 s", "both"),
    Effect("bracket_on_hoses", "dev", "sensors", "mm", 0.785, 6.0, "reading_displacement",
           "duty other_duty",
           "hoses under pressure tilt the encoder's bracket: x + e(q_x − q_y), the flows' "
           "shares", "both"),
    Effect("yielding_bracket", "dev", "sensors", "mm", 0.604, 8.0, "reading_displacement",
           "force time",
           "the encoder's bracket yields to the tendon: x + e r, r → (F − 1.24 N)/0.4 N in 6 s",
           "both"),
    Effect("resonant_filter", "dev", "sensors", "1", 1.33, 4.0, "reading_force",
           "force reading_rate reading",
           "the load cell's indicator filters with a resonance: F + e(r − F), r the force "
           "through an oscillator of 0.2 Hz, damping 0.12", "both"),
    Effect("ghost_of_rtd", "dev", "sensors", "N", 0.0956, 0.9, "reading_force",
           "other_wire reading",
           "the converter keeps some of Y's RTD when it comes to the load cell: F + e(T_RTD − "
           "27 °C)/20 K", "both"),
    Effect("overshooting_hall", "dev", "sensors", "1", 0.0098, 0.9, "reading_current",
           "current reading_rate reading",
           "a current sensor's compensation overshoots: i + e(i − z), z → i in 2 s"),
    Effect("freed_interfaces", "dev", "phase", "1", 0.487, 4.0, "heat_into_wire",
           "fraction_rate",
           "interfaces have to be freed on the way to austenite, which takes heat: L(1 + e) "
           "there"),
    Effect("relaxing_back_stress", "dev", "phase", "K", 3.2, 18.0, "transformation_shift",
           "fraction time",
           "what transforms strains the rest, which relaxes: both thresholds + e(z − ξ), z → "
           "the mean ξ in 8 s"),
    Effect("following_twins", "dev", "phase", "mm", 3.73, 12.0, "recoverable_strain",
           "force fraction time",
           "martensite's twins follow the load: deflection + e r, r → ξ(F − 1.24 N)/0.4 N in 4 "
           "s"),
    Effect("cogging_wheel", "dev", "mechanics", "N", 0.0871, 0.15, "force_cell_on_x",
           "displacement",
           "a wheel's magnets hold the tendon here and there: against x by e sin(2πx/10 mm + c)",
           "both"),
    Effect("freed_by_pumps", "dev", "mechanics", "N", 0.345, 0.9, "force_cell_on_x",
           "velocity duty other_duty",
           "a guide rubs unless the pumps shake it: against x by e(1 − q)⁺ v/(|v| + 0.5 mm/s), "
           "q both flows' share", "both"),
    Effect("jets_on_clip", "dev", "mechanics", "N", 0.0806, 0.4, "force_cell_on_x",
           "duty other_duty",
           "the outlets' jets push the tendon's clip: along x by e(q_x² − q_y²), the flows' "
           "shares", "both"),
)  # fmt: skip
