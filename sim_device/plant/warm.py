"""Compile the kernel once, at installation, so that the first run need not wait for it."""

from sim_device.plant import Drive, Inputs, Plant, load_parameters, simulate


def warm() -> None:
    """Run a moment of the plant and a moment of replay; the compiled code is kept on disk."""
    import numpy as np

    parameters = load_parameters("A")
    plant = Plant(parameters)
    plant.advance(Drive(), 0.01)
    plant.read()
    t_s = np.linspace(0.0, 0.02, 3)
    simulate(parameters, Inputs(t_s=t_s, i_A=np.zeros((3, 2)), pump_duty=np.zeros((3, 2))))


if __name__ == "__main__":
    warm()
