"""Effects of no list whose sealed bank was opened last: they have joined development banks.

Where a forcing at another place would leave less than one floor of ten, that place is right, too.
The load cell is beside X, so that a force between the springs has one place.
"""

from evaluation.plant.effect import FLOW, Effect

EFFECTS: tuple[Effect, ...] = (
    Effect("hiccuping_fuse", "dev", "electrical", "1", 0.00784, 0.9, "driven_current",
           "current time",
           "an electronic fuse counts heat: after every 20 A²s it holds back for 1.5 s: I(1 − e)"),
    Effect("flow_interlock", "dev", "electrical", "1", 0.0111, 0.9, "driven_current",
           "duty current time",
           "a flow switch that falls back late holds its heater down: I(1 − e) until 2 s after its "
           "pump has fallen below a tenth of full speed", "one"),
    Effect("healing_defects", "dev", "electrical", "1", 0.0365, 0.6,
           "resistance reading_voltage",
           "fraction time fraction_rate",
           "martensite that forms leaves defects, which heal: R(1 + e d), d gains Δξ⁺, and fades "
           "in 10 s"),
    Effect("rms_voltmeter", "dev", "electrical", "1", 0.00563, 0.5,
           "reading_voltage resistance",
           "reading current",
           "a voltmeter of means sees some of the chopped voltage's RMS: V + e[(V · 12 V)^½ − V]"),
    Effect("air_in_pump_head", "dev", "thermal", "1", 0.545, 0.95, FLOW, "duty time",
           "air gathers in a pump's head at part load: flow(1 − e a), a → 1 in 5 s at 0.05–0.85 of "
           "full speed, and → 0 in 0.5 s above"),
    Effect("filling_return_pot", "dev", "thermal", "1", 0.468, 0.9, FLOW,
           "duty other_duty time",
           "both tubes empty into a pot with a narrow drain: flow(1 − e l), l gains both flows' "
           "share less √l each 6 s", "both"),
    Effect("float_valve", "dev", "thermal", "K", 3.68, 20.0, "inlet_water heat_into_water",
           "duty other_duty time",
           "a float valve refills the vessel below the inlet's sensor with cold water: T_in − e r, "
           "r gains 1 after every 8 s of one tube's full flow, and fades in 8 s", "both"),
    Effect("rusty_feed", "dev", "thermal", "1", 0.863, 12.0, "film", "duty time",
           "what is pumped leaves rust on the coil: film/[1 + e∫q dt/20 s], q the flow's share"),
    Effect("tube_against_frame", "dev", "thermal", "W/K", 0.0546, 2.0, "heat_into_water",
           "force water",
           "its spring's pull presses a tube against the frame: − e g(T_w − T_room), g from 0 at "
           "1.24 N to 1 at 1.64 N", "one"),
    Effect("plume_of_other_tube", "dev", "thermal", "W", 0.428, 10.0, "heat_into_water",
           "other_wire time",
           "warm air rises from one tube to the other: + e p, p → that one's ΔT_w⁺/10 K in 5 s",
           "across"),
    Effect("strap_between_ends", "dev", "thermal", "W/K", 0.0704, 1.0,
           "heat_into_wire recoverable_strain",
           "other_wire wire",
           "a copper strap joins both springs' ends at the outlets: + e(T_other − T) there",
           "both"),
    Effect("rtd_leads_past_magnet", "dev", "sensors", "K", 4.16, 20.0, "reading_rtd",
           "velocity",
           "an RTD's leads move past a magnet, whose voltage its transmitter takes for warmth: "
           "T + e v/5 mm/s, v the speed of its own contraction"),
    Effect("blanked_transmitter", "dev", "sensors", "s", 0.892, 8.0, "reading_rtd",
           "current reading_rate time",
           "an RTD's transmitter ignores what comes while its heater switches: it shows its last "
           "value for e from each change of that current by 0.5 A on"),
    Effect("lever_on_encoder", "dev", "sensors", "mm", 0.325, 6.0, "reading_displacement",
           "displacement reading",
           "a lever turns the encoder in place of a wheel: x + e(x/5 mm)³", "both"),
    Effect("soft_measuring_wheel", "dev", "sensors", "1", 0.106, 3.0, "reading_displacement",
           "force displacement velocity",
           "the tendon presses into the encoder's soft wheel: x + e∫(F − 1.24 N)/0.4 N dx",
           "both"),
    Effect("gradient_in_cell", "dev", "sensors", "N", 0.259, 0.9, "reading_force",
           "water wire time",
           "X's outlet warms the load cell unevenly, until warmth has spread: F + e(g − z), g its "
           "ΔT_w/20 K, z → g in 10 s", "both"),
    Effect("beating_carrier", "dev", "sensors", "N", 0.11, 0.9, "reading_force",
           "time current other_current",
           "the load cell's carrier beats with the chopped currents: F + e Σ I(4 A − I)/4 A² "
           "sin(2πt/5.5 s + c)", "both"),
    Effect("swaying_lead", "dev", "sensors", "1", 0.00781, 0.6, "reading_current",
           "displacement current reading",
           "a heater's lead sways with its spring before an open current sensor: i/(1 + e y/5 mm), "
           "y its own contraction"),
    Effect("dragging_interfaces", "dev", "phase", "K", 1.48, 8.0, "transformation_shift",
           "fraction_rate time",
           "interfaces that move fast drag solute along: A_s + e d, M_s − e d, d → r/(r + 0.05/s) "
           "in 3 s, r the rate |dξ/dt|"),
    Effect("load_on_austenite", "dev", "phase", "K", 2.2, 15.0, "transformation_shift",
           "force fraction",
           "stiffer austenite carries more than its share of the load: both thresholds + "
           "e(1 − ξ)(F − 1.24 N)/0.4 N"),
    Effect("rubbing_twins", "dev", "phase", "mm", 2.99, 6.0, "recoverable_strain",
           "force fraction",
           "martensite's twins rub as the load turns them: deflection + e ξ b, b by dF/0.25 N "
           "within ±1, over 0.3 s"),
    Effect("running_in_guide", "dev", "mechanics", "N", 0.154, 0.9, "force_cell_on_x",
           "velocity displacement time",
           "a new guide runs in: against x by e exp(−∫|dx|/30 mm) v/(|v| + 0.5 mm/s)", "both"),
    Effect("pushed_collar", "dev", "mechanics", "N", 0.0576, 0.9, "force_cell_on_x",
           "displacement velocity",
           "a clip on the tendon pushes a tight collar to and fro: against x by e within 0.3 mm, "
           "after 3 mm of play at each turn", "both"),
    Effect("pawl_on_rack", "dev", "mechanics", "N", 0.16, 0.9, "force_cell_on_x",
           "displacement velocity",
           "a pawl climbs a rack's teeth and is held off on the way back: against x by "
           "e frac(x/2.5 mm + c) v⁺/(v + 0.5 mm/s)", "both"),
)  # fmt: skip
