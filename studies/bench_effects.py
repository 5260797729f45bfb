"""What each effect of the deep rig does to the base's acceleration and to its reduction, one at a time and together.

Simulated without noise of sensors; 5 kg at 3 g0 with the built counter-masses and without; half of peak to peak, all
frequencies, at the base accelerometer of the rig.
"""

from collections.abc import Iterator

import numpy as np

from balance.mechanism.mjcf_parser import load_mechanism
from balance.units import G0
from testbench import rig as rigs
from testbench.campaign_plan import PlannedRun
from testbench.rig import Rig
from testbench.simulator.run import disturbed, simulate_run
from testbench.simulator.sensors import base_acceleration
from testbench.simulator.simulated_logs import lead_s

from .table import Row

PLAIN, DEEP = rigs.load_rig("parallelogram-6bar"), rigs.load_rig("parallelogram-6bar-deep")
MECHANISM = load_mechanism(PLAIN.mechanism)
BUILT = {"counter_A0A": 24.2626, "counter_B0B": 24.2626}
EFFECTS = ("coupling", "planes", "rotors", "weight", "floor", "roughness", "modes")
STILL = 1e-6
"""Amplitude below which symmetry keeps an axis still: there is no reduction [m/s2]."""


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


def study(count: int, brief: bool) -> Iterator[Row]:
    """Reductions by effect, motion and axis; briefly along x alone, plain and with all effects."""
    for names in ((), EFFECTS) if brief else ((), *((name,) for name in EFFECTS), EFFECTS):
        label = {(): "plain", EFFECTS: "all"}.get(names) or names[0]
        for motion in "x" if brief else "xy":
            without, built = (amplitudes(with_effects(names), masses, motion) for masses in ({}, BUILT))
            for axis, bare, balanced in zip("xyz", without.tolist(), built.tolist(), strict=True):
                if bare > STILL:
                    note = f"{balanced:.4f} of {bare:.4f} m/s2"
                    yield Row(f"{label}, motion {motion}, along {axis}", 100 * (1 - balanced / bare), "%", note=note)
