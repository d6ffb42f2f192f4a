"""Does an effect at its typical strength show in a channel? `python -m … EFFECT CHANNEL`.

The kernel runs interpreted: twenty samples are quicker than compiling it once more.
"""

import os
import sys


def main(name: str, channel: str) -> int:
    """Return 0 if the channel differs from the plant without the effect."""
    from sim_device.plant import load_parameters, simulate
    from tests.sim_device.plant.cases import alternating

    inputs = alternating(seconds=0.2, amps=2.9)
    set_A = load_parameters("A")
    plain = simulate(set_A, inputs)
    with_it = simulate(set_A, inputs, effects={name: {}})
    same = bool((with_it[channel] == plain[channel]).all())
    return int(same)


if __name__ == "__main__":
    os.environ["NUMBA_DISABLE_JIT"] = "1"
    sys.exit(main(*sys.argv[1:]))
