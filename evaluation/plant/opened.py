"""Effects of no list whose sealed bank was opened last: they have joined development banks.

Where a forcing at another place would leave less than one floor of ten, that place is right, too.
The load cell is beside X, so that a force between the springs has one place.
"""

from evaluation.plant.effect import FLOW, Effect

EFFECTS: tuple[Effect, ...] = (
    Effect("worn_end_switch", "dev", "electrical", "1", 0.0134, 0.9, "driven_current",
           "displacement current",
           "a worn end switch puts a resistor before its heater: I(1 − e) from 3 mm of its own "
           "contraction on, until it is below 1.5 mm, in 0.2 s", "one"),
    Effect("freewheeling_choke", "dev", "electrical", "s", 0.00565, 2.0, "driven_current",
           "current",
           "a driver's choke runs on through its diode: the current falls by at most 1 A in e"),
    Effect("cohering_crimp", "dev", "electrical", "ohm", 0.0262, 0.3,
           "resistance reading_voltage", "current time",
           "an oxide in a crimp breaks down under current, and grows again: R + e c, c → 1 in "
           "10 s, worn off by exp(−∫(I/2 A)²dt/1.5 s)", "one"),
    Effect("drifting_zero", "dev", "electrical", "V", 0.0163, 0.6, "reading_voltage", "time",
           "a voltmeter's zero drifts, and is set anew every 7 s: V + e b, b from 0 to 1 between"),
    Effect("running_siphon", "dev", "thermal", "1", 0.0354, 0.8, FLOW, "duty time",
           "a hose siphons: flow at least e from where its pump passes a tenth of full speed until "
           "6 s after it falls below", "one"),
    Effect("gas_plug", "dev", "thermal", "1", 0.43, 20.0, FLOW, "wire duty time",
           "gas that hot wire drives out of its water stands in the tube: flow/(1 + e g), g gains "
           "(T − 38 °C)⁺/10 K in each 5 s, and is flushed out in 1.5 s by full flow"),
    Effect("silt_on_still_coils", "dev", "thermal", "1", 2.88, 12.0, "film", "velocity time",
           "silt settles on a coil that rests: film/(1 + e b), b → 1 in 15 s, shaken off by "
           "exp(−∫|dx|/2 mm)"),
    Effect("relief_of_martensite", "dev", "thermal", "1", 0.626, 12.0, "film", "fraction",
           "martensite's relief roughens the wire: film(1 + e ξ)"),
    Effect("warm_backwash", "dev", "thermal", "1", 0.808, 4.0, "inlet_water heat_into_water",
           "water duty time",
           "water of a tube at rest wanders back into its feeding hose: T_in + e b, b → that of "
           "the inlet's end less T_in in 8 s, flushed out in 1.5 s by full flow"),
    Effect("melting_gel", "dev", "thermal", "W/K", 0.341, 2.0, "heat_into_water",
           "water time",
           "a gel round the tube takes 12 J to melt at 38 °C, where it sets: + e(38 °C − T_w) "
           "while it does either"),
    Effect("swinging_fan", "dev", "thermal", "1", 5.96, 40.0, "heat_into_water",
           "time water",
           "a swinging fan blows on both tubes: loss[1 + e sin²(πt/18 s + c)]", "both"),
    Effect("hasty_transmitter", "dev", "sensors", "s", 0.759, 6.0, "reading_rtd",
           "reading_rate wire_rate reading wire",
           "an RTD's transmitter makes up for a lag that is not there: T + e dT/dt, over 0.5 s"),
    Effect("knocked_transmitter", "dev", "sensors", "K", 1.62, 20.0, "reading_rtd",
           "other_current",
           "the other driver's switching knocks an RTD's transmitter: T + e k, k gains |dJ|/4 A, "
           "and fades in 4 s", "across"),
    Effect("dragged_head", "dev", "sensors", "mm", 0.937, 4.0, "reading_displacement",
           "velocity reading_rate",
           "the encoder's head on soft leaves is dragged along: x − e v/(|v| + 0.5 mm/s)", "both"),
    Effect("torn_line", "dev", "sensors", "mm", 0.152, 3.0, "reading_displacement",
           "displacement time",
           "the decoder takes a torn line for a step forward, whichever way it passes: x + e n, "
           "n its passages so far", "both"),
    Effect("pulses_in_amplifier", "dev", "sensors", "N", 0.115, 0.9, "reading_force",
           "velocity",
           "the load cell's amplifier rectifies the encoder's pulses: F + e |v|/(|v| + 0.5 mm/s)",
           "both"),
    Effect("missing_codes", "dev", "sensors", "N", 0.156, 0.3, "reading_force",
           "reading force",
           "the load cell's converter misses codes: it reads 1.4 N for what is less than e off it",
           "both"),
    Effect("sensors_on_battery", "dev", "sensors", "1", 0.0136, 0.9, "reading_current",
           "time current reading",
           "both current sensors run on a battery that runs down: i(1 − e t/60 s)", "both"),
    Effect("worked_by_load", "dev", "phase", "K", 3.01, 15.0, "transformation_shift",
           "force time",
           "changes of load leave dislocations: both thresholds − e(1 − exp(−∫|dF|/1 N))"),
    Effect("warm_latent", "dev", "phase", "1", 0.861, 2.0, "heat_into_wire",
           "fraction_rate wire",
           "the transformation's heat depends on its temperature: L[1 + e(T − 37 °C)/10 K]"),
    Effect("chilled_on_one_side", "dev", "phase", "mm", 2.64, 12.0, "recoverable_strain",
           "wire water current",
           "coils against the tube are chilled on their free side only, and bend open: deflection "
           "+ e(T − T_w)/10 K"),
    Effect("heavy_pulley", "dev", "mechanics", "N", 0.0534, 0.3, "force_cell_on_x",
           "velocity",
           "a heavy pulley turns with the tendon: against x by e a/20 mm/s², a its acceleration",
           "both"),
    Effect("braked_vane", "dev", "mechanics", "N", 0.227, 1.5, "force_cell_on_x",
           "velocity displacement",
           "a magnet brakes a vane on the tendon that passes it: against x by "
           "e exp[−((x − c)/2 mm)²] v/5 mm/s", "both"),
    Effect("tube_under_pressure", "dev", "mechanics", "mm", 1.98, 8.0, "recoverable_strain",
           "duty",
           "a spring's anchor stands on its tube, which lengthens as it is pumped: deflection + "
           "e q², q the flow's share"),
)  # fmt: skip
