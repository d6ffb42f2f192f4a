"""Candidate effects of the mechanics around the springs."""

from __future__ import annotations

from sim_device.plant.effects.record import Y_SHARE, Effect, about, either, half, shape, strength

_PAIR = (("fixture", ("antagonistic",)),)
_MOVED = (("fixture", ("antagonistic", "stretch")),)
_EGGELER = "G. Eggeler et al., Mater. Sci. Eng. A 378 (2004) 24-33"
_FRICTION = "B. Armstrong-Hélouvry, P. Dupont, C. Canudas de Wit, Automatica 30 (1994) 1083-1138"

MECHANICS: tuple[Effect, ...] = (
    Effect(
        name="tube_friction",
        title="the spring rubs in its tube",
        subsystem="mechanics",
        places=("force_cell_on_x", "force_cell_on_y"),
        equation="sticks while |F_X − F_Y| ≤ (F_c + μ F) [1 + s exp(−|v|/v_s)], v the speed at"
        " which the springs would move it, and slips to F_c + μ F; F_r = a F_X + (1 − a) F_Y",
        parameters=(
            strength("coulomb_N", "N", (0, 0.08, 1), half(0.08), "constant part F_c",
                     term="coulomb"),
            strength("proportional", "1", (0, 0.05, 0.5), half(0.05), "part μ of tension",
                     term="proportional_friction"),
            shape("stribeck", "1", (0, 0.2, 2), about(0.2), "excess s at rest", term="stribeck"),
            shape("velocity_m_s", "m/s", (1e-5, 1e-3, 0.1), about(1e-3), "Stribeck speed v_s",
                  term="stribeck_speed"),
            shape("sensor_on_x", "1", (0, 0.5, 1), about(0.5), "a, X's share of the reading"),
        ),
        signals=("temperature", "displacement", "force"),
        confused_with=("encoder_backlash", "viscous_drag", "minor_loop"),
        separated_by="reversals at two preloads: the constant part stays, the proportional part"
        " grows",
        reference=_FRICTION,
        needs=_MOVED,
    ),
    Effect(
        name="viscous_drag",
        title="water in the tube drags on the coils",
        subsystem="mechanics",
        places=("force_cell_on_x", "force_cell_on_y"),
        equation="F_X − F_Y = c w u̇, w the filled share",
        parameters=(
            strength("coefficient_N_s_m", "N s/m", (0, 40, 500), half(40),
                     "coefficient c, mean of both tubes", term="drag"),
            Y_SHARE,
        ),
        signals=("temperature", "displacement", "force"),
        confused_with=("tube_friction", "channel_delay"),
        separated_by="the same fast move wet and dry",
        reference=_FRICTION,
        needs=_MOVED,
    ),
    Effect(
        name="tendon_slack",
        title="the tendon straightens before it carries load",
        subsystem="mechanics",
        places=("recoverable_strain",),
        equation="δ_X + δ_Y + s [exp(−F0/F_s) − exp(−F/F_s)] = 2 δ0",
        parameters=(
            strength("slack_m", "m", (0, 3e-3, 0.02), half(3e-3), "slack s", term="tendon_slack"),
            shape("force_N", "N", (0.05, 0.5, 5), about(0.5), "force F_s", term="slack_force"),
        ),
        signals=("displacement", "force"),
        confused_with=("tendon_compliance", "force_offset"),
        separated_by="cold, quasi-static pull through zero force",
        reference="toe region of a fibre's load-extension curve; exponential form chosen here",
        needs=_PAIR,
    ),
    Effect(
        name="tendon_compliance",
        title="the tendon stretches",
        subsystem="mechanics",
        places=("recoverable_strain",),
        equation="δ_X + δ_Y + c (F − F0) = 2 δ0",
        parameters=(
            strength("compliance_m_N", "m/N", (0, 2e-3, 0.02), half(2e-3), "compliance c",
                     term="tendon_compliance"),
        ),
        signals=("displacement", "force"),
        confused_with=("tendon_slack", "tube_stiffness"),
        separated_by="block one spring and pull on the other",
        reference="Hooke's law of the tendon; the paper, section 3.1, neglects it",
        needs=_PAIR,
    ),
    Effect(
        name="tube_stiffness",
        title="the tube is a spring in parallel",
        subsystem="mechanics",
        places=("force_cell_on_x", "force_cell_on_y"),
        equation="F = F_spring + k_p (δ − δ0)",
        parameters=(
            strength("stiffness_N_m", "N/m", (0, 6, 100), half(6), "stiffness k_p",
                     term="tube_stiffness"),
            Y_SHARE,
        ),
        signals=("displacement", "force"),
        confused_with=("force_gain", "tendon_compliance", "cold_ends"),
        separated_by="cold stretch with and without the tube",
        reference="the paper, section 6: interaction between the silicone tube and the SMA spring",
        needs=_MOVED,
    ),
    Effect(
        name="residual_elongation",
        title="the spring keeps a little elongation from each cycle",
        subsystem="mechanics",
        places=("recoverable_strain",),
        equation="δ += e n, n = ½ ∫|dξ|: some tens of cycles, since nothing levels off",
        parameters=(
            strength("per_cycle_m", "m", (-1e-3, 1e-4, 1e-3), either(1e-4), "e of a cycle",
                     term="elongation"),
            Y_SHARE,
        ),
        signals=("displacement", "force"),
        confused_with=("transformation_fatigue", "encoder_slip"),
        separated_by="the same cycle first and last, displacement at rest",
        reference=_EGGELER,
    ),
)  # fmt: skip
