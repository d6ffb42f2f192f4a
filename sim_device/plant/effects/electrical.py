"""Candidate effects of the driver and of the springs as resistors."""

from __future__ import annotations

from sim_device.plant.effects.record import Y_SHARE, Effect, about, either, half, shape, strength

ELECTRICAL: tuple[Effect, ...] = (
    Effect(
        name="driver_gain",
        title="gain error of the current driver",
        subsystem="actuator",
        places=("driven_current",),
        equation="I = (1 + g) I_c",
        parameters=(
            strength("gain", "1", (-0.3, 0.06, 0.3), either(0.05), "gain error g",
                     term="driver_gain"),
            Y_SHARE,
        ),
        signals=("current", "voltage", "temperature", "displacement", "force"),
        confused_with=("contact_resistance", "convection_exponent", "phase_resistivity"),
        separated_by="compare commanded with measured current on a staircase",
        reference="definition of a gain error; measured current against commanded current",
    ),
    Effect(
        name="driver_lag",
        title="lag of the current driver",
        subsystem="actuator",
        places=("driven_current",),
        equation="τ dI/dt = I_c − I",
        parameters=(
            strength("tau_s", "s", (0, 0.1, 1), half(0.1), "time constant τ", term="driver_lag"),
            Y_SHARE,
        ),
        signals=("current", "voltage", "temperature", "displacement", "force"),
        confused_with=("channel_delay", "rtd_lag"),
        separated_by="pseudo-random current steps shorter than a second",
        reference="K. Ogata, Modern Control Engineering (first-order lag)",
        law=True,
    ),
    Effect(
        name="driver_saturation",
        title="driver or supply runs out of headroom towards the largest current",
        subsystem="actuator",
        places=("driven_current",),
        equation="I = I_c/[1 + (I_c/I_s)^n]^(1/n), (I_max/I_s)^n = (1 − s)^−n − 1, so that I = (1"
        " − s) I_max"
        " at I_c = I_max of the parameter file",
        parameters=(
            strength("deficit", "1", (0, 0.1, 0.9), half(0.1), "missing share s at I_max",
                     term="driver_deficit"),
            shape("sharpness", "1", (2, 6, 40), about(6), "n; a clip when large",
                  term="driver_sharpness"),
            Y_SHARE,
        ),
        signals=("current", "voltage", "temperature", "displacement", "force"),
        confused_with=("driver_gain",),
        separated_by="a staircase of currents up to I_max: the top steps fall short, by ever more",
        reference="C. Rapp, Proc. 2nd European Conf. on Satellite Communications, Liège 1991, ESA"
        " SP-332,"
        " 179-184 (soft limiter of power amplifiers); used here for a current source",
    ),
    Effect(
        name="phase_resistivity",
        title="resistance depends on temperature and phase",
        subsystem="electrical",
        places=("resistance",),
        equation="R = R0 [1 + α (T − T_ref) + β (½ − ξ)]",
        parameters=(
            strength("alpha_1_K", "1/K", (-5e-3, 8e-4, 5e-3), either(1e-3), "slope α with T",
                     term="resistivity_T"),
            strength("beta", "1", (-0.5, -0.15, 0.5), either(0.15), "slope β with phase",
                     term="resistivity_xi"),
            Y_SHARE,
        ),
        signals=("voltage", "temperature", "displacement", "force"),
        confused_with=("contact_resistance", "driver_gain", "r_phase"),
        separated_by="sweep temperature slowly at a small sensing current and look at V/I",
        reference="N. Ma, G. Song, H.-J. Lee, Smart Mater. Struct. 13 (2004) 777 (cited by the"
        " paper)",
    ),
    Effect(
        name="contact_resistance",
        title="resistance of leads and crimps in the voltage reading",
        subsystem="electrical",
        places=("reading_voltage",),
        equation="V = I (R + R_c)",
        parameters=(
            strength("resistance_Ohm", "Ohm", (0, 0.05, 0.5), half(0.05), "R_c",
                     term="contact_resistance"),
            Y_SHARE,
        ),
        signals=("voltage",),
        confused_with=("phase_resistivity",),
        separated_by="a current step read with four wires",
        reference="four-terminal sensing (Kelvin connection)",
    ),
    Effect(
        name="current_offset",
        title="offset of the current sensor",
        subsystem="sensors",
        places=("reading_current",),
        equation="I_meas = I + I_o",
        parameters=(
            strength("offset_A", "A", (-0.3, 0.03, 0.3), either(0.03), "offset I_o",
                     term="current_offset"),
            Y_SHARE,
        ),
        signals=("current",),
        confused_with=("driver_gain",),
        separated_by="read the sensor at zero current",
        reference="definition of a zero offset",
    ),
)  # fmt: skip
