"""Effects on no list that are spent: only the quiz draws them.

Where a forcing at another place would leave less than one floor of ten, that place is right, too.
The load cell is beside X, so that a force between the springs has one place.
"""

from evaluation.plant.effect import FLOW, Effect

EFFECTS: tuple[Effect, ...] = (
    Effect("chattering_plug", "spent", "electrical", "1", 0.0128, 0.9, "driven_current",
           "velocity",
           "a loose heater plug chatters while its spring moves: I[1 − e |v|/(|v| + 2 mm/s)]"),
    Effect("peak_and_hold", "spent", "electrical", "1", 0.0106, 0.8, "driven_current",
           "current time",
           "a solenoid driver takes back what was above 0.8 A for 2.5 s: then I(1 − e), in 0.4 s, "
           "until it falls below"),
    Effect("textured_resistance", "spent", "electrical", "1", 0.0148, 0.2, "resistance",
           "force fraction",
           "turned martensite conducts worse: R[1 + e ξ Δs/0.05], Δs what was turned since the "
           "mount"),
    Effect("corroding_wire", "spent", "electrical", "1", 0.0163, 0.4, "resistance reading_voltage",
           "time wire",
           "warm wire corrodes and never heals: R[1 + e∫exp((T − 45 °C)/10 K)dt/30 s]"),
    Effect("misted_board", "spent", "electrical", "1", 0.0165, 0.5, "reading_voltage", "duty",
           "pumped water mists the sense amplifier: V(1 − e w), w → the flow's share in 3 s, "
           "and dries in 15 s"),
    Effect("lime_on_wire", "spent", "thermal", "1", 0.852, 8.0, "film", "time wire",
           "lime settles on warm wire and stays: film/[1 + e∫(T − 36 °C)⁺/10 K dt/20 s]"),
    Effect("shared_suction", "spent", "thermal", "1", 0.515, 0.95, FLOW, "other_duty duty",
           "one suction line: each pump draws air for the other, flow(1 − e a), a the other "
           "flow's share, fading in 6 s", "both"),
    Effect("tired_membrane", "spent", "thermal", "1", 0.512, 0.95, FLOW, "duty",
           "a pump's membrane softens as it works: flow(1 − e w), w → the flow's share in 10 s, "
           "back in 25 s", "one"),
    Effect("hose_on_heatsink", "spent", "thermal", "K", 5.1, 20.0, "inlet_water heat_into_water",
           "current other_current",
           "the feeding hose lies on the drivers' heat sink: T_in + e w, w → (I_x + I_y)/"
           "4 A in 15 s", "both"),
    Effect("dripping_outlet", "spent", "thermal", "W/K", 0.0821, 0.5, "heat_into_water",
           "other_duty other_wire water",
           "one outlet drips on the other tube: + e q(T_out − T_w), q the other flow's share",
           "across"),
    Effect("rod_in_coil", "spent", "thermal", "W/K", 0.13, 0.8, "heat_into_wire",
           "displacement wire",
           "a drawn-out coil narrows and grips a rod within: − e k(T − T_room), k from 0 at 1 mm "
           "of its own contraction to 1 at −4 mm", "one"),
    Effect("cycling_lamp", "spent", "thermal", "W", 0.803, 4.0, "heat_into_water ambient_air",
           "time", "a heat lamp shines on both tubes for 9 of every 24 s: + e on each", "both"),
    Effect("ripple_filter", "spent", "sensors", "s", 1.08, 4.0, "reading_rtd",
           "reading_rate wire_rate current reading",
           "an RTD's filter averages the longer the more its heater ripples: one pole of e I/4 A"),
    Effect("rtd_lead_on_neighbour", "spent", "sensors", "K", 3.46, 20.0, "reading_rtd",
           "other_wire",
           "an RTD's two wires run along the other tube: T + e w, w → its ΔT_w/20 K in 8 s",
           "across"),
    Effect("wide_index", "spent", "sensors", "mm", 0.757, 6.0, "reading_displacement",
           "displacement reading velocity",
           "a wide index mark resets the count: x + e from 1 mm past its middle on, until 1 mm "
           "before it", "both"),
    Effect("rectified_ripple", "spent", "sensors", "N", 0.0787, 0.6, "reading_force",
           "current other_current",
           "the load cell's amplifier rectifies chopped current: F + e Σ I(4 A − I)/4 A²",
           "both"),
    Effect("motor_beside_sensor", "spent", "sensors", "A", 0.0221, 0.6, "reading_current", "duty",
           "each current sensor sees the field of its pump's motor: i + e w, w the motor's speed",
           "both"),
    Effect("fading_latent", "spent", "phase", "1", 0.54, 0.9, "heat_into_wire",
           "fraction_rate transformed",
           "transforming wears the transformation's heat off: L[1 − e(1 − exp(−Σ|Δξ|/1.5))]"),
    Effect("bent_coils", "spent", "phase", "K", 1.58, 12.0, "transformation_shift", "displacement",
           "a coil drawn out is bent as well as twisted: both thresholds + e[(δ/25 mm)² − 1]"),
    Effect("lingering_stress", "spent", "phase", "K", 1.91, 12.0, "transformation_shift", "force",
           "stresses of the largest load linger: both thresholds + e(P − 1.35 N)⁺/0.4 N, P that "
           "load, fading in 25 s"),
    Effect("mobile_interfaces", "spent", "phase", "1", 0.163, 1.2, "recoverable_strain",
           "fraction_rate force",
           "moving interfaces soften the wire: elastic deflection[1 + e r/(r + 0.03/s)], r → "
           "|dξ/dt| in 0.3 s"),
    Effect("shrinking_tendon", "spent", "mechanics", "mm", 2.09, 10.0, "recoverable_strain",
           "water wire",
           "a polymer tendon shrinks in its tube's warm outlet: deflection − e w, w → ΔT_w/20 K "
           "in 3 s"),
    Effect("hanging_sponge", "spent", "mechanics", "N", 0.0357, 0.45, "force_cell_on_x",
           "duty other_duty time",
           "spilt water weighs a sponge on the tendon down: against x by e w, w gains both flows' "
           "share each 10 s and dries in 40 s", "both"),
    Effect("gripping_hose", "spent", "mechanics", "N", 0.0924, 0.9, "force_cell_on_x",
           "velocity duty other_duty",
           "hoses swell as they feed and rub on the tendon: e q v/(|v| + 0.5 mm/s), q both flows' "
           "share", "both"),
)  # fmt: skip

_GONE = """
absorbing_hold adaptive_filter aged_segment ageing_at_rest air_cushion ammeter_average
amplifier_near_rail annealed_spring arrest_memory attracting_turns austenite_softening
beating_bridges beating_gears bent_guide bimetal_cutout boiling_out_gas bowed_scale bracket_growth
bracket_on_hoses braked_vane breathing_tube bridge_leakage bridge_on_pump_supply bubbles_of_filling
cell_guide_friction cell_shock cell_span_drift chilled_on_one_side clamp_slip clapeyron_bend
clinging_coils clip_drawn_to_coils clip_polarisation clip_tension clogged_strainer
clouding_inhibitor coarse_driver coarse_scale coasting_pump cogging_wheel cohering_crimp
coil_contact coil_expansion coil_in_field coil_opening coil_pitch_film coils_on_wall cold_reference
converter_carry core_at_low_field core_remanence counted_motors coupling_creep cracked_end
cracking_valve crackling_wire creeping_austenite creeping_crimp creeping_tie crowded_bus curing_glue
cyclic_softening cycling_chiller damped_cell damping_martensite dead_leg decoupled_rotor deep_cooled
deformed_martensite detwin_recovery dirty_strip dragged_cable dragged_head drawn_again
drawn_from_depth drifting_zero driver_crosstalk driver_fan driver_foldback driver_on_return
driver_small_signal drooping_hold drying_bearing eased_turning elastocaloric electrolysis_gas
electron_wind electroplastic encoder_eccentricity encoder_in_field evaporating_spill
fan_on_other_motor fanned_by_tendon fatigued_rtd film_tripping first_nuclei flexed_lead
flow_interlock folding_leaf following_twins force_frame_warming force_hysteresis frame_growth
frame_touch fraying_lead freed_by_pumps freed_interfaces freewheeling_choke fretted_crimp
friction_heat galvanic_clip gas_coat gas_plug gate_refresh ghost_of_rtd ghosting_multiplexer
graded_wire grain_slopes gripped_ends hall_on_hose hall_zero_drift hammered_variants
hasty_transmitter heavy_core heavy_pulley hiccuping_fuse hose_slug hose_under_tendon hoses_on_cell
hoses_side_by_side hot_clips hot_crimp humming_coils hurried_cooling hydrogen_uptake idle_windup
induced_heat intake_on_tendon iron_beside_tendon isothermal_martensite jets_on_clip kicked_amplifier
kinked_hose knocked_transmitter knot_tightening lagging_stress lasting_swirl latent_of_rest
lazy_setpoint leached_ions lead_in_outlet lead_inductance leads_along_neighbour leaking_foot_valve
leaking_insulation lifted_outlet lip_seal loose_axle loose_bolt loosening_crimp lost_counts
lost_frames magnet_near_hall martensite_stabilisation massive_clamp melting_gel metal_yoke
missing_codes motor_lead_on_rtd motor_under_tube mux_ghosting narrow_return narrowing_loop
neighbour_field oblique_pull other_pump_shakes oval_pulley overheated_nuclei overlapping_pulses
overload_stop overloaded_cell overshooting_hall overturning_water parting_strand peak_voltmeter
phase_fronts phase_heat_capacity pinned_fronts pitted_guide plastic_ratchet plied_tendon
plug_under_tension polled_pump precipitation premartensitic_peak pressed_crimp pressed_tube
pressure_stiffening pulses_in_amplifier pump_bourdon pump_cavitation pump_ground_lift
pump_load_droop pump_stiction pump_supply_sag pump_vibration pump_waste_heat pwm_counts
quenched_martensite rail_kick range_switching rate_overshoot ratiometric_reference
relaxing_back_stress relaxing_lattice relaxing_strap relay_chiller relief_of_martensite relief_valve
remanent_core resettable_fuse resonant_filter resting_austenite return_beside_intake
reversal_miscount reverse_flow reverting_remnants ringing_loop ripple_heating rocking_anchor
roller_pulses rtd_binding rtd_bow rtd_current_pickup rtd_flow_self_heating rtd_joints rtd_off_coil
rtd_on_straining_wire rtd_report_band rtd_seepage rtd_strain rtd_wandering rtd_warmup rubber_anchor
rubber_buffer rubbing_cable running_siphon running_varnish scanned_rtd scattering_fronts
scattering_interfaces seated_end sensors_on_battery setpoint_ground settling_encoder
settling_interfaces shaft_bending shaft_imbalance shaken_interfaces shared_base shared_power_limit
shared_return shed_oxide shifted_lagging shifting_pin shorted_coils shorted_turns shrunk_sleeve
shunt_on_tube shunt_self_heating silt_on_still_coils sinking_level skewed_guide sleeping_encoder
slewing_transmitter sliding_clip sliding_sleeve slipping_ferrule slow_clock snapping_bellows
soaked_rtd soaking_sense soft_start soft_tape soft_zener softening_hose splice_over_pulley
spool_buildup sprayed_clamp squeezed_rtd starting_pumps sticking_element sticking_rotor stiff_grease
stiff_matrix stiffening_austenite stirred_up_flakes stirring_coils strained_rtd strainer_clogging
stress_in_resistance stressed_hall strobed_sense sucked_through_tee supply_beat swallowed_pulses
sweating_tube swelling_seal swinging_fan swinging_reel tapered_drum tapering_guard tarnished_crimp
taut_lead tendon_angle tendon_log_creep tendon_stray_current tendon_twist tendon_wetting
thermosiphon thrifty_converter tired_battery torn_line touching_tubes tracking_decoder tube_buckling
tube_kink tube_relaxation tube_swelling tube_thermal_push tube_under_pressure tube_wall_heat
tubes_over_supply tugged_trimmer turned_resists two_phase_softening two_way_memory
unsynchronised_clock variant_creep walking_anchor warm_backwash warm_cartridge warm_core warm_latent
warm_martensite warm_slip_bands warm_viscosity warmed_amplifier warmed_divider warmed_scale
water_cooled_driver water_hammer water_shunt wax_melting wax_thermostat wet_jacket wire_strain_gauge
worked_by_load worked_resistance worn_end_switch worn_slip_ring wrong_bit wrong_table_entry
yielding_austenite yielding_bracket zero_tracking
"""

DROPPED = frozenset(_GONE.split())
"""Names that have been in the table and whose physics is gone: they are not used again."""
