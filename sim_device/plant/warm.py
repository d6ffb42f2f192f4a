"""Run the kernel once, at installation: without a library of C, numba compiles it then."""

from sim_device.plant import Drive, Inputs, Plant, Replay, load_parameters, simulate


def warm() -> None:
    """Run a moment of the plant and a moment of replay; the compiled code is kept on disk.

    Where, and until when, says `sim_device.plant.kernel.compiled`.
    """
    import numpy as np

    from sim_device.plant.many import PlantArray

    parameters = load_parameters("A")
    plant = Plant(parameters)
    plant.advance(Drive(), 0.01)
    plant.read()
    plant.energy  # noqa: B018  (compiles what it needs)
    setup = Replay(Inputs(t_s=np.zeros(1), i_A=np.zeros((1, 2)), pump_duty=np.zeros((1, 2)))).setup(
        parameters
    )
    PlantArray(1, setup).advance(0.01)
    t_s = np.linspace(0.0, 0.02, 3)
    inputs = Inputs(t_s=t_s, i_A=np.zeros((3, 2)), pump_duty=np.zeros((3, 2)))
    simulate(parameters, inputs, effects={"unified_kinetics": {}})
    Replay(inputs).setup(parameters).film_W_per_m_K(310.0, 300.0, 1.0)


if __name__ == "__main__":
    warm()
