"""Candidate effects of the driver and of the springs as resistors."""

from __future__ import annotations

from sim_device.plant import kernel as k
from sim_device.plant.effects.record import Y_SHARE, Effect, EffectParameter, about, either, half

ELECTRICAL: tuple[Effect, ...] = (
    Effect(
        "driver_gain",
        "gain error of the current driver",
        "actuator",
        "I = (1 + g) I_c",
        (
            EffectParameter("gain", k.E_GAIN, "1", -0.3, 0.3, 0.06, either(0.05), "gain error g"),
            Y_SHARE,
        ),
        ("current", "voltage", "temperature", "displacement", "force"),
        ("contact_resistance", "convection_exponent", "phase_resistivity"),
        "compare commanded with measured current on a staircase",
        "definition of a gain error; measured current against commanded current",
    ),
    Effect(
        "driver_lag",
        "lag of the current driver",
        "actuator",
        "τ dI/dt = I_c − I",
        (
            EffectParameter("tau_s", k.E_LAG_S, "s", 0, 1, 0.1, half(0.1), "time constant τ"),
            Y_SHARE,
        ),
        ("current", "voltage", "temperature", "displacement", "force"),
        ("channel_delay", "rtd_lag"),
        "pseudo-random current steps shorter than a second",
        "K. Ogata, Modern Control Engineering (first-order lag)",
        law=True,
    ),
    Effect(
        "driver_saturation",
        "driver or supply runs out of headroom towards the largest current",
        "actuator",
        "I = I_c/[1 + (I_c/I_s)^n]^(1/n), (I_max/I_s)^n = (1 − s)^−n − 1, so that I = (1 − s) I_max"
        " at I_c = I_max of the parameter file",
        (
            EffectParameter(
                "deficit", k.E_DEFICIT, "1", 0, 0.9, 0.1, half(0.1), "missing share s at I_max"
            ),
            EffectParameter(
                "sharpness", k.E_SHARPNESS, "1", 2, 40, 6, about(6), "n; a clip when large", None
            ),
            Y_SHARE,
        ),
        ("current", "voltage", "temperature", "displacement", "force"),
        ("driver_gain",),
        "a staircase of currents up to I_max: the top steps fall short, by ever more",
        "C. Rapp, Proc. 2nd European Conf. on Satellite Communications, Liège 1991, ESA SP-332,"
        " 179-184 (soft limiter of power amplifiers); used here for a current source",
    ),
    Effect(
        "phase_resistivity",
        "resistance depends on temperature and phase",
        "electrical",
        "R = R0 [1 + α (T − T_ref) + β (½ − ξ)]",
        (
            EffectParameter(
                "alpha_1_K", k.E_OHM_ALPHA, "1/K", -5e-3, 5e-3, 8e-4, either(1e-3), "slope α with T"
            ),
            EffectParameter(
                "beta", k.E_OHM_BETA, "1", -0.5, 0.5, -0.15, either(0.15), "slope β with phase"
            ),
        ),
        ("voltage", "temperature", "displacement", "force"),
        ("contact_resistance", "driver_gain", "r_phase"),
        "sweep temperature slowly at a small sensing current and look at V/I",
        "N. Ma, G. Song, H.-J. Lee, Smart Mater. Struct. 13 (2004) 777 (cited by the paper)",
    ),
    Effect(
        "contact_resistance",
        "resistance of leads and crimps in the voltage reading",
        "electrical",
        "V = I (R + R_c)",
        (
            EffectParameter(
                "resistance_Ohm", k.E_CONTACT_OHM, "Ohm", 0, 0.5, 0.05, half(0.05), "R_c"
            ),
            Y_SHARE,
        ),
        ("voltage",),
        ("phase_resistivity",),
        "a current step read with four wires",
        "four-terminal sensing (Kelvin connection)",
    ),
    Effect(
        "current_offset",
        "offset of the current sensor",
        "sensors",
        "I_meas = I + I_o",
        (
            EffectParameter(
                "offset_A", k.E_I_OFFSET, "A", -0.3, 0.3, 0.03, either(0.03), "offset I_o"
            ),
            Y_SHARE,
        ),
        ("current",),
        ("driver_gain",),
        "read the sensor at zero current",
        "definition of a zero offset",
    ),
)

SENSORS: tuple[Effect, ...] = (
    Effect(
        "rtd_lag",
        "the RTD follows the wire late",
        "sensors",
        "τ dT_r/dt = T − T_r",
        (
            EffectParameter("tau_s", k.E_RTD_LAG_S, "s", 0, 5, 0.6, half(0.7), "time constant τ"),
            Y_SHARE,
        ),
        ("temperature",),
        ("channel_delay", "rtd_stem", "temperature_spread"),
        "heat at two rates: a lag grows with the rate, a delay does not",
        "J. V. Nicholas, D. R. White, Traceable Temperatures, 2nd ed., Wiley 2001",
        law=True,
    ),
    Effect(
        "rtd_offset",
        "constant error of the RTDs",
        "sensors",
        "T_r = T + T_o",
        (
            EffectParameter("offset_K", k.E_RTD_OFFSET, "K", -5, 5, 1.0, either(1.0), "offset T_o"),
            Y_SHARE,
        ),
        ("temperature",),
        ("rtd_stem", "reservoir_warming", "ambient_drift"),
        "rest isotherm: all RTDs at one temperature, nothing driven",
        "J. V. Nicholas, D. R. White, Traceable Temperatures, 2nd ed., Wiley 2001",
    ),
    Effect(
        "rtd_stem",
        "the RTD loses heat along its stem",
        "sensors",
        "T_r = T − ε (T − T_a)",
        (EffectParameter("share", k.E_RTD_STEM, "1", 0, 0.5, 0.08, half(0.08), "share ε"), Y_SHARE),
        ("temperature",),
        ("rtd_offset", "rtd_lag", "convection_exponent"),
        "two plateaus: an offset is the same on both, a stem error is proportional",
        "J. V. Nicholas, D. R. White, Traceable Temperatures, 2nd ed., Wiley 2001",
    ),
    Effect(
        "encoder_backlash",
        "play between tendon and encoder",
        "sensors",
        "u_r = play of width b on u",
        (EffectParameter("width_m", k.E_BACKLASH, "m", 0, 2e-3, 2e-4, half(2e-4), "width b"),),
        ("displacement",),
        ("tube_friction", "encoder_slip"),
        "force against displacement at a reversal: with backlash the force moves first",
        "I. D. Mayergoyz, Mathematical Models of Hysteresis, Springer 1991 (play operator)",
    ),
    Effect(
        "encoder_slip",
        "the tendon slips on the encoder",
        "sensors",
        "du_r = (1 − s) du for du > 0, du_r = du otherwise",
        (
            EffectParameter(
                "share", k.E_SLIP, "1", -0.2, 0.2, 0.02, either(0.02), "lost share s of travel"
            ),
        ),
        ("displacement",),
        ("encoder_backlash", "residual_elongation"),
        "the reading at rest before and after ten cycles",
        "belt and capstan slip; kinematic statement, no constitutive law",
    ),
    Effect(
        "force_offset",
        "zero error of the force sensor",
        "sensors",
        "F_r = F + F_o",
        (EffectParameter("offset_N", k.E_F_OFFSET, "N", -1, 1, 0.05, either(0.05), "offset F_o"),),
        ("force",),
        ("force_gain", "force_creep", "tendon_slack"),
        "hang a dead weight, and read with none",
        "OIML R 60, Metrological regulation for load cells",
    ),
    Effect(
        "force_gain",
        "gain error of the force sensor",
        "sensors",
        "F_r = (1 + g) F",
        (EffectParameter("gain", k.E_F_GAIN, "1", -0.7, 1.0, 0.04, either(0.03), "gain error g"),),
        ("force",),
        ("force_offset", "tube_stiffness"),
        "hang two dead weights",
        "OIML R 60, Metrological regulation for load cells",
    ),
    Effect(
        "force_creep",
        "the force sensor creeps under load",
        "sensors",
        "F_r = F + c (z − F0), τ dz/dt = F − z",
        (
            EffectParameter(
                "share", k.E_CREEP, "1", -0.5, 0.5, 0.04, either(0.03), "creep share c"
            ),
            EffectParameter(
                "tau_s", k.E_CREEP_S, "s", 1, 1000, 30, about(30), "time constant τ", None
            ),
        ),
        ("force",),
        ("force_gain", "force_offset"),
        "hold a force for minutes",
        "OIML R 60, Metrological regulation for load cells (creep)",
    ),
    Effect(
        "channel_delay",
        "sensor channels arrive late",
        "timing",
        "y_r(t) = y(t − d), one delay each for temperature, displacement and force",
        (
            EffectParameter(
                "temperature_s", k.E_DELAY_T, "s", 0, 1, 0.06, half(0.05), "delay of the RTDs"
            ),
            EffectParameter(
                "displacement_s", k.E_DELAY_U, "s", 0, 1, 0.06, half(0.05), "delay of the encoder"
            ),
            EffectParameter(
                "force_s", k.E_DELAY_F, "s", 0, 1, 0.06, half(0.05), "delay of the force"
            ),
        ),
        ("temperature", "displacement", "force"),
        ("rtd_lag", "driver_lag", "clock_skew"),
        "equal edges at start and end: a delay is the same at both, a skew grows",
        "definition of a transport delay",
        law=True,
    ),
    Effect(
        "clock_skew",
        "the sensors' clock runs slow against the board's",
        "timing",
        "y_r(t) = y(t − s t)",
        (
            EffectParameter(
                "ppm", k.E_SKEW_PPM, "ppm", 0, 2000, 300, half(200), "skew s in parts per million"
            ),
        ),
        ("temperature", "displacement", "force"),
        ("channel_delay",),
        "equal edges at start and end of a long run",
        "D. L. Mills, Computer Network Time Synchronization, CRC Press 2006",
    ),
)
