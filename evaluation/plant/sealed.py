"""Effects that nobody who works on the diagnosis reads before a bank of them is opened.

Where a forcing at another place would leave less than one floor of ten, that place is right, too.
The load cell is beside X, so that a force between the springs has one place.
"""

from evaluation.plant.effect import FLOW, TUBE, Effect

EFFECTS: tuple[Effect, ...] = (
    Effect("driver_on_return", "sealed", "electrical", "1", 0.0151, 0.6, "driven_current",
           "water wire current",
           "a driver is cooled by its tube's outlet: I(1 − e w), w → the outlet's ΔT_w/20 K in "
           "10 s"),
    Effect("lazy_setpoint", "sealed", "electrical", "A", 0.0526, 1.5, "driven_current", "current",
           "a driver takes a new set value only where it differs by e from the last one taken; "
           "zero at once"),
    Effect("stress_in_resistance", "sealed", "electrical", "1", 0.0228, 1.0,
           "resistance reading_voltage", "force",
           "the wire's resistance rises with its stress: R[1 + e(F/1.24 N − 1)]"),
    Effect("scattering_fronts", "sealed", "electrical", "1", 0.0121, 0.6,
           "resistance reading_voltage", "fraction_rate",
           "moving phase fronts scatter electrons: R[1 + e r/(r + 0.05/s)], r → |dξ/dt| in 0.3 s"),
    Effect("sliding_clip", "sealed", "electrical", "1", 0.00942, 0.4, "reading_voltage",
           "displacement reading",
           "a sense clip slides along its wire: V[1 + e y/5 mm], y its own contraction", "one"),
    Effect("humming_coils", "sealed", "thermal", "1", 0.433, 12.0, "film", "current",
           "chopped current makes the coils hum in their water: film[1 + e I/4 A]"),
    Effect("pump_supply_sag", "sealed", "thermal", "1", 0.202, 0.95, FLOW,
           "current other_current duty",
           "the pumps run on the heaters' supply: flow[1 − e(I_x + I_y)/4 A]", "both"),
    Effect("leaking_foot_valve", "sealed", "thermal", "s", 1.02, 6.0, FLOW, "duty time",
           "a suction line runs empty: flow 0.1/(0.1 + a), a → 1 in 8 s, and falls by the pump's "
           "share in each e", "one"),
    Effect("hoses_side_by_side", "sealed", "thermal", "K", 4.09, 25.0,
           "inlet_water heat_into_water", "other_wire duty",
           "a feeding hose lies on the other tube's outlet: T_in + e w, w → that outlet's "
           "ΔT_w/20 K in 6 s", "across"),
    Effect("cycling_chiller", "sealed", "thermal", "K", 1.96, 10.0, "inlet_water heat_into_water",
           "time duty",
           "a chiller behind the inlet's sensor switches: T_in + e sin(2πt/26 s + c)", "both"),
    Effect("sliding_sleeve", "sealed", "thermal", "1", 3.32, 30.0, "heat_into_water",
           "displacement water",
           "a sleeve round one tube slides with the tendon: loss(1 + e k), k from 0 at −1 mm of "
           "its own contraction to 1 at 4 mm", "one"),
    Effect("induced_heat", "sealed", "thermal", "W", 0.785, 8.0, "heat_into_wire", "other_current",
           "chopped current in one coil heats the other by induction: + e J(4 A − J)/4 A²",
           "across"),
    Effect("flexed_lead", "sealed", "sensors", "K", 4.37, 20.0, "reading_rtd", "velocity",
           "a flexed RTD lead charges: T + e v/(|v| + 2 mm/s), v that of its own contraction"),
    Effect("squeezed_rtd", "sealed", "sensors", "K", 4.46, 20.0, "reading_rtd", "force",
           "a taut spring squeezes its RTD: T + e(F/1.24 N − 1)", "one"),
    Effect("encoder_in_field", "sealed", "sensors", "mm", 0.861, 4.0, "reading_displacement",
           "current other_current",
           "the heaters' field turns a magnetic encoder's: x + e(I_x − I_y)/4 A", "both"),
    Effect("bridge_on_pump_supply", "sealed", "sensors", "1", 0.0601, 0.45, "reading_force",
           "duty other_duty reading",
           "the pumps pull the load cell's excitation down: F[1 − e(w_x + w_y)], w a motor's "
           "speed", "both"),
    Effect("shunt_on_tube", "sealed", "sensors", "1", 0.0197, 0.8, "reading_current",
           "water wire current reading",
           "a shunt is strapped to its tube: i(1 + e w), w → ΔT_w/20 K in 8 s"),
    Effect("narrowing_loop", "sealed", "phase", "K", 1.77, 9.0, "transformation_shift",
           "transformed",
           "transforming narrows the hysteresis: w = 1 − exp(−Σ|Δξ|/2), A_s − e w, M_s + e w/2"),
    Effect("resting_austenite", "sealed", "phase", "K", 2.95, 15.0, "transformation_shift",
           "time fraction",
           "austenite that rests transforms later: M_s − e lg(1 + t/0.5 s), t since ξ < ½"),
    Effect("cyclic_softening", "sealed", "phase", "1", 0.172, 1.0, "recoverable_strain",
           "transformed force",
           "transforming softens the wire: elastic deflection[1 + e(1 − exp(−Σ|Δξ|/1.5))]"),
    Effect("annealed_spring", "sealed", "phase", "1", 0.154, 1.0, "recoverable_strain",
           "wire time force",
           "heat anneals the drawn wire: elastic deflection[1 + e(1 − exp(−∫(T − 36 °C)⁺dt/"
           "100 K s))]"),
    Effect("attracting_turns", "sealed", "mechanics", "N", 0.0955, 0.8, TUBE, "current",
           "turns that carry current attract each other: the spring pulls e(I/4 A)² more"),
    Effect("plied_tendon", "sealed", "mechanics", "mm", 1.09, 8.0, "recoverable_strain", "force",
           "plies of the tendon rub on each other: it is longer by e b, b by dF/0.2 N within ±1",
           "both"),
    Effect("bent_guide", "sealed", "mechanics", "N", 0.106, 1.0, "force_cell_on_x",
           "velocity displacement",
           "a bent guide rubs on the tendon away from its middle: e |x|/5 mm v/(|v| + 0.5 mm/s)",
           "both"),
)  # fmt: skip
