"""Candidate effects of the alloy's phases and of the mechanics around the springs."""

from __future__ import annotations

from sim_device.plant import kernel as k
from sim_device.plant.effects.record import Effect, EffectParameter, about, either, half

_MOVES = ("temperature", "displacement", "force")
_TENDON = ("displacement", "force")
_PAIR = (("fixture", ("antagonistic",)),)
_MOVED = (("fixture", ("antagonistic", "stretch")),)
_OTSUKA = "K. Otsuka, X. Ren, Prog. Mater. Sci. 50 (2005) 511-678"
_EGGELER = "G. Eggeler et al., Mater. Sci. Eng. A 378 (2004) 24-33"
_FRICTION = "B. Armstrong-Hélouvry, P. Dupont, C. Canudas de Wit, Automatica 30 (1994) 1083-1138"

PHASE: tuple[Effect, ...] = (
    Effect(
        "minor_loop",
        "partial transformations follow another law",
        "phase",
        "ratios of Eqs (11), (13) raised to 1 + κ p, p the untransformed share when the leg began;"
        " a share m of the wire rests until the outer curve reaches its fraction",
        (
            EffectParameter("kappa", k.E_MINOR, "1", -0.9, 3, 0.8, either(0.6), "κ"),
            EffectParameter("memory", k.E_MEMORY, "1", 0, 1, 0.5, half(0.5), "share m"),
        ),
        _MOVES,
        ("temperature_spread", "transformation_fatigue"),
        "first-order reversal curves",
        "I. D. Mayergoyz, Mathematical Models of Hysteresis, Springer 1991",
        law=True,
    ),
    Effect(
        "transformation_fatigue",
        "transformation temperatures and strain change with each cycle",
        "phase",
        "A_S, A_F, M_S, M_F → … + s n;  δ_L → δ_L (1 − l n), n = ½ ∫|dξ|",
        (
            EffectParameter(
                "shift_K", k.E_SHIFT, "K", -2, 2, -0.3, either(0.2), "shift s of a cycle"
            ),
            EffectParameter(
                "shrink", k.E_SHRINK, "1", 0, 0.05, 0.003, half(0.003), "loss l of a cycle"
            ),
        ),
        _MOVES,
        ("ambient_drift", "residual_elongation", "minor_loop"),
        "the same cycle first and last",
        _EGGELER,
    ),
    Effect(
        "r_phase",
        "an intermediate R-phase on cooling",
        "phase",
        "austenite → R from M_S + a to M_S + a − w on cooling; δ += ε δ_L q, R += ρ q R0",
        (
            EffectParameter(
                "strain", k.E_R_STRAIN, "1", -0.5, 0.5, 0.03, either(0.03), "ε, share of δ_L"
            ),
            EffectParameter(
                "resistivity", k.E_R_OHM, "1", -0.3, 0.3, 0.08, either(0.08), "rise ρ of R"
            ),
            EffectParameter(
                "above_K", k.E_R_ABOVE, "K", 0, 30, 8, about(8), "a, its start above M_S", None
            ),
            EffectParameter("width_K", k.E_R_WIDTH, "K", 1, 30, 6, about(6), "w, its width", None),
        ),
        ("voltage", "temperature", "displacement", "force"),
        ("phase_resistivity", "minor_loop"),
        "slow cooling, voltage and displacement together",
        _OTSUKA,
    ),
    Effect(
        "unified_kinetics",
        "one law for twinned and detwinned martensite, which remembers where it turned",
        "phase",
        "ξ from a = (T − A_S − τ/C_A)/(A_F − A_S) and c = (M_S + (τ − τ_0)/C_M − T)/(M_S − M_F),"
        " τ_0 at F0, on curves that mix f with a logistic one (share t), scaled to pass through"
        " earlier turns; of what forms or is there, 1 − f(b) is detwinned",
        (
            EffectParameter(
                "on",
                k.E_UNIFIED,
                "1",
                0,
                1,
                1,
                half(1),
                "this law instead of the paper's",
                switch=True,
            ),
            EffectParameter("tails", k.E_TAILS, "1", 0, 1, 0.5, about(0.4), "share t", None),
        ),
        _MOVES,
        ("minor_loop",),
        "first-order reversal curves at two preloads",
        "D. C. Lagoudas et al., Int. J. Plasticity 32-33 (2012) 155-183; S. E. Zirka, Y. I. Moroz,"
        " IEEE Trans. Magn. 31 (1995) 3509-3511",
        law=True,
    ),
    Effect(
        "stress_latent",
        "latent heat depends on stress",
        "phase",
        "L → L [1 + λ (τ − τ_0)/100 MPa], τ_0 at F0",
        (
            EffectParameter(
                "slope", k.E_LATENT_STRESS, "1", -1, 3, 0.8, either(0.6), "λ per 100 MPa"
            ),
        ),
        _MOVES,
        ("tube_wall",),
        "length of the transformation plateau at two preloads",
        _OTSUKA,
    ),
)

MECHANICS: tuple[Effect, ...] = (
    Effect(
        "tube_friction",
        "the spring rubs in its tube",
        "mechanics",
        "|F_X − F_Y| ≤ (F_c + μ F) [1 + s exp(−|u̇|/v_s)], equal to it when moving;"
        " F_r = a F_X + (1 − a) F_Y",
        (
            EffectParameter(
                "coulomb_N", k.E_COULOMB, "N", 0, 1, 0.08, half(0.08), "constant part F_c"
            ),
            EffectParameter(
                "proportional", k.E_PROPORTIONAL, "1", 0, 0.5, 0.05, half(0.05), "part μ of tension"
            ),
            EffectParameter(
                "stribeck", k.E_STRIBECK, "1", 0, 2, 0.2, about(0.2), "excess s at rest", None
            ),
            EffectParameter(
                "velocity_m_s",
                k.E_STRIBECK_V,
                "m/s",
                1e-5,
                0.1,
                1e-3,
                about(1e-3),
                "Stribeck speed v_s",
                None,
            ),
            EffectParameter(
                "sensor_on_x", None, "1", 0, 1, 0.5, about(0.5), "a, X's share of the reading", None
            ),
        ),
        _MOVES,
        ("encoder_backlash", "viscous_drag", "minor_loop"),
        "reversals at two preloads: the constant part stays, the proportional part grows",
        _FRICTION,
        _MOVED,
    ),
    Effect(
        "viscous_drag",
        "water in the tube drags on the coils",
        "mechanics",
        "F_X − F_Y = c w u̇, w the filled share",
        (
            EffectParameter(
                "coefficient_N_s_m", k.E_DRAG, "N s/m", 0, 500, 40, half(40), "coefficient c"
            ),
        ),
        _MOVES,
        ("tube_friction", "channel_delay"),
        "the same fast move wet and dry",
        _FRICTION,
        _MOVED,
    ),
    Effect(
        "tendon_slack",
        "the tendon straightens before it carries",
        "mechanics",
        "δ_X + δ_Y + s [exp(−F0/F_s) − exp(−F/F_s)] = 2 δ0",
        (
            EffectParameter("slack_m", k.E_SLACK, "m", 0, 0.02, 3e-3, half(3e-3), "slack s"),
            EffectParameter(
                "force_N", k.E_SLACK_F, "N", 0.05, 5, 0.5, about(0.5), "force F_s", None
            ),
        ),
        _TENDON,
        ("tendon_compliance", "force_offset"),
        "cold, quasi-static pull through zero force",
        "toe region of a fibre's load-extension curve; exponential form chosen here",
        _PAIR,
    ),
    Effect(
        "tendon_compliance",
        "the tendon stretches",
        "mechanics",
        "δ_X + δ_Y + c (F − F0) = 2 δ0",
        (
            EffectParameter(
                "compliance_m_N", k.E_TENDON, "m/N", 0, 0.02, 2e-3, half(2e-3), "compliance c"
            ),
        ),
        _TENDON,
        ("tendon_slack", "tube_stiffness"),
        "block one spring and pull on the other",
        "Hooke's law of the tendon; the paper, section 3.1, neglects it",
        _PAIR,
    ),
    Effect(
        "tube_stiffness",
        "the tube is a spring in parallel",
        "mechanics",
        "F = F_spring + k_p (δ − δ0)",
        (EffectParameter("stiffness_N_m", k.E_TUBE_K, "N/m", 0, 100, 6, half(6), "stiffness k_p"),),
        _TENDON,
        ("force_gain", "tendon_compliance", "cold_ends"),
        "cold stretch with and without the tube",
        "the paper, section 6: interaction between the silicone tube and the SMA spring",
        _MOVED,
    ),
    Effect(
        "residual_elongation",
        "the spring keeps a little elongation from each cycle",
        "mechanics",
        "δ += e n, n = ½ ∫|dξ|",
        (
            EffectParameter(
                "per_cycle_m", k.E_ELONGATION, "m", -1e-3, 1e-3, 1e-4, either(1e-4), "e of a cycle"
            ),
        ),
        _TENDON,
        ("transformation_fatigue", "encoder_slip"),
        "the same cycle first and last, displacement at rest",
        _EGGELER,
    ),
)
