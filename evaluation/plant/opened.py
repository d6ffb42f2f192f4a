"""Effects of no list whose sealed bank was opened last: they have joined development banks.

Where a forcing at another place would leave less than one floor of ten, that place is right, too.
The load cell is beside X, so that a force between the springs has one place.
"""

from evaluation.plant.effect import FLOW, Effect

EFFECTS: tuple[Effect, ...] = (
    Effect("worn_slip_ring", "dev", "electrical", "1", 0.00811, 0.9, "driven_current",
           "displacement current",
           "a heater's lead runs over a worn slip ring on the pulley: I[1 − e sin²(πx/6 mm + c)]",
           "one"),
    Effect("resettable_fuse", "dev", "electrical", "1", 0.0574, 0.9, "driven_current",
           "current time",
           "a resettable fuse warms and takes a part of the voltage: I[1 − e(h − 0.2)⁺], h → "
           "(I/4 A)² in 6 s"),
    Effect("loosening_crimp", "dev", "electrical", "ohm", 0.00402, 0.3,
           "resistance reading_voltage", "wire current",
           "a copper crimp at the outlet's end widens more than the wire in it: R + "
           "e(T_end − 32 °C)⁺/10 K", "one"),
    Effect("warmed_divider", "dev", "electrical", "1", 0.0204, 0.9, "reading_voltage",
           "current other_current time",
           "the voltmeters' dividers lie beside the drivers: V(1 + e w), w → (I_x² + I_y²)/"
           "(4 A)² in 10 s", "both"),
    Effect("lifted_outlet", "dev", "thermal", "1", 0.218, 0.9, FLOW, "displacement duty",
           "the tendon lifts a tube's outlet, which costs head: flow(1 − e y/5 mm), y its own "
           "contraction", "one"),
    Effect("beating_gears", "dev", "thermal", "1", 0.387, 0.95, FLOW, "time duty",
           "a pump's worn gears beat: flow[1 + e sin(2πt/7 s + c)]"),
    Effect("stirred_up_flakes", "dev", "thermal", "1", 3.43, 40.0, "film", "duty time",
           "a starting flow stirs up flakes, which cover the coil: film/(1 + e w), w gains what "
           "the flow's share gains, and fades in 4 s"),
    Effect("water_cooled_driver", "dev", "thermal", "K", 5.96, 20.0,
           "inlet_water heat_into_water", "current duty time",
           "the feed cools its driver's plate: T_in + e w, w gains (I/4 A)² each 4 s and loses "
           "w(1 + 6q) each 20 s, q the flow's share"),
    Effect("shifted_lagging", "dev", "thermal", "1", 3.46, 60.0, "heat_into_water",
           "displacement water",
           "a spring that contracts pulls the lagging off its tube: loss(1 + e k), k from 0 in "
           "the middle to 1 at 4 mm"),
    Effect("fan_on_other_motor", "dev", "thermal", "1", 7.8, 60.0, "heat_into_water",
           "other_duty water",
           "the other pump's motor has a fan that blows on the tube: loss(1 + e w), w its speed",
           "across"),
    Effect("massive_clamp", "dev", "thermal", "W/K", 0.0331, 1.0, "heat_into_wire",
           "wire wire_rate time",
           "the clamp at the inlet's end stores 3 J/K: + e(T_clamp − T) there", "one"),
    Effect("wrong_table_entry", "dev", "sensors", "K", 2.81, 12.0, "reading_rtd",
           "reading wire",
           "one entry in an RTD's table is wrong: T + e exp[−((T − 30 °C − 10c K)/3 K)²]"),
    Effect("sticking_element", "dev", "sensors", "K", 1.9, 12.0, "reading_rtd",
           "reading_rate wire_rate reading",
           "an RTD's winding sticks in its sheath, which strains it: T − e b, b by dT/4 K within "
           "±1"),
    Effect("soft_tape", "dev", "sensors", "1", 0.135, 0.95, "reading_displacement",
           "reading_rate displacement velocity time",
           "the encoder's scale on soft tape is dragged along, and creeps back: x − e(x − z), "
           "z → x in 5 s", "both"),
    Effect("bowed_scale", "dev", "sensors", "mm", 0.308, 8.0, "reading_displacement",
           "displacement reading",
           "the encoder's scale is bowed: x + e(x/5 mm)²", "both"),
    Effect("rubbing_cable", "dev", "sensors", "N", 0.0682, 0.9, "reading_force",
           "velocity displacement",
           "the load cell's cable rubs on the tendon: F + e b, b by dx/1 mm within ±1", "both"),
    Effect("thrifty_converter", "dev", "sensors", "N", 0.122, 0.6, "reading_force",
           "reading reading_rate force",
           "the load cell's converter spares the bus: it shows its last value until that is off "
           "by e", "both"),
    Effect("hall_on_hose", "dev", "sensors", "1", 0.0135, 0.9, "reading_current",
           "water current reading",
           "a current sensor lies on its tube's return: i(1 + e w), w → the outlet's ΔT_w/20 K "
           "in 6 s"),
    Effect("latent_of_rest", "dev", "phase", "1", 1.63, 8.0, "heat_into_wire",
           "fraction_rate time transformed",
           "a wire that has rested takes and gives more heat as it transforms: L(1 + e a), a → 1 "
           "in 15 s, and worn off by exp(−Σ|Δξ|/0.3)"),
    Effect("lagging_stress", "dev", "phase", "K", 2.74, 18.0, "transformation_shift",
           "force time",
           "grains take up the load late: both thresholds − e(F − z)/0.4 N, z → F in 6 s"),
    Effect("reverting_remnants", "dev", "phase", "mm", 4.14, 12.0, "recoverable_strain",
           "wire fraction",
           "remnants of martensite revert only in hot wire: deflection − e m, m from 0 at 42 °C "
           "to 1 at 52 °C"),
    Effect("folding_leaf", "dev", "mechanics", "N", 0.131, 0.9, "force_cell_on_x", "velocity",
           "a leaf on the tendon folds in oil on its way back: against x by e v⁺/5 mm/s", "both"),
    Effect("skewed_guide", "dev", "mechanics", "N", 0.0899, 0.9, "force_cell_on_x",
           "velocity displacement",
           "a skewed guide rubs off its middle: against x by e(x/5 mm)² v/(|v| + 0.5 mm/s)",
           "both"),
    Effect("shifting_pin", "dev", "mechanics", "mm", 1.81, 4.0, "recoverable_strain",
           "force time",
           "a spring's anchor pin shifts in its hole: deflection + e from 1.5 N on, until below "
           "1.3 N, in 0.3 s", "one"),
)  # fmt: skip
