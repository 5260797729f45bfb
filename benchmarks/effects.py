"""What each effect of the deep rig does to the base's acceleration and to its reduction, one at a time and together.

    python -m benchmarks.effects [--brief]

Simulated without noise of sensors; 5 kg at 3 g0 with the built counter-masses and without; half of peak to peak, all
frequencies, at the base accelerometer of the rig.
"""

import argparse
import time

import numpy as np

from balance.loading.loading import load_mechanism
from balance.quantities import G0
from testbench import rig as rigs
from testbench.bench.recorded import lead_s
from testbench.bench.run import disturbed, simulate_run
from testbench.bench.sensors import base_acceleration
from testbench.plan import PlannedRun
from testbench.rig import Rig

PLAIN, DEEP = rigs.load("parallelogram-6bar"), rigs.load("parallelogram-6bar-deep")
MECHANISM = load_mechanism(PLAIN.mechanism)
BUILT = {"counter_A0A": 24.2626, "counter_B0B": 24.2626}
EFFECTS = ("coupling", "planes", "rotors", "weight", "floor", "roughness", "modes")


def with_effects(names: tuple[str, ...]) -> Rig:
    """The plain rig with some effects of the deep one."""
    bench = PLAIN.bench.model_copy(update={name: getattr(DEEP.bench, name) for name in names})
    return PLAIN.model_copy(update={"bench": bench})


def amplitudes(rig: Rig, masses: dict[str, float], motion: str) -> np.ndarray:
    """Half of peak to peak at the base accelerometer, x, y, z [m/s2]."""
    planned = PlannedRun("r", 5.0, masses, motion, 3.0 * G0, 1)
    run = disturbed(simulate_run(rig, MECHANISM, planned, lead_s(rig)), rig, (1, 1))
    seen = base_acceleration(rig.base_accelerometers["base_acc"], run)
    return np.array([np.ptp(seen[axis]) / 2.0 for axis in "xyz"])


def main() -> None:
    """Print a table; ``--brief``: along x alone, plain and with all effects."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--brief", action="store_true", help="along x alone, plain and with all effects")
    brief = parser.parse_args().brief
    print(f"{'':10} {'':6} {'without [m/s2]':>24} {'with [m/s2]':>24} {'fell by [%]':>21}   time")
    for names in ((), EFFECTS) if brief else ((), *((name,) for name in EFFECTS), EFFECTS):
        rig = with_effects(names)
        for motion in "x" if brief else "xy":
            start = time.perf_counter()
            without, built = amplitudes(rig, {}, motion), amplitudes(rig, BUILT, motion)
            took = (time.perf_counter() - start) / 2.0
            cells = [" ".join(f"{v:7.4f}" for v in values) for values in (without, built)]
            # an axis that symmetry keeps still has no reduction
            fell = " ".join(
                f"{100 * (1 - b / a):6.1f}" if a > 1e-6 else "     -" for a, b in zip(without, built, strict=True)
            )
            label = {(): "plain", EFFECTS: "all"}.get(names, names[0] if names else "")
            print(f"{label:10} {motion:6} {cells[0]:>24} {cells[1]:>24} {fell:>21}   {took:.2f} s")


if __name__ == "__main__":
    main()
