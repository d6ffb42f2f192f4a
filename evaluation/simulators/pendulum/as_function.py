import math

from smad.simulators import Missing, simulator


def pendulum(t, inputs, values, start):
    angle, rate, angles = start["angle_rad"], start["angle_rad_rate"], []
    inertia = values["mass_kg"] * 0.5**2
    for torque in inputs["torque_N_m"].tolist():
        angles.append(angle)
        push = torque - values["damping"] * rate - 9.81 * 0.5 * values["mass_kg"] * math.sin(angle)
        rate += 0.01 * push / inertia
        stopped = 0.01 * values["friction_N_m"] / inertia
        rate -= min(max(rate, -stopped), stopped)
        angle += 0.01 * rate
    return {"angle_rad": angles}


PLANT = simulator(
    pendulum,
    parameters={"mass_kg": (1.0, 0.5, 2.0), "damping": (0.05, 0.0, 0.3)},
    effects={"friction_N_m": Missing(typical=0.05, high=0.5, places=("input_torque_N_m",))},
)
