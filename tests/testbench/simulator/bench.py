"""The shipped bench, with more stated of it where a test wants more, and its runs, each simulated once."""

import numpy as np

from balance.mechanism.mjcf_parser import load_mechanism
from testbench.campaign_plan import PlannedRun
from testbench.rig import Rig, load_rig
from testbench.rig.bench import Bench
from testbench.rig.sensors import wrench_transport
from testbench.simulator.run import BenchRun, simulate_run
from testbench.simulator.sensors import true_signals

RIG, MECHANISM = load_rig("parallelogram-6bar"), load_mechanism("parallelogram-6bar")
EXACT = {"counter_A0A": 24.276118, "counter_B0B": 24.276118}
BUILT = {"counter_A0A": 24.2626, "counter_B0B": 24.2626}
_RUNS: dict[str, BenchRun] = {}


def benched(**settings) -> Rig:
    """The shipped rig with more in its bench."""
    stated = Bench.model_validate(settings)
    return RIG.model_copy(update={"bench": RIG.bench.model_copy(update={k: getattr(stated, k) for k in settings})})


def run(rig: Rig = RIG, masses=None, motion: str = "x", acceleration: float = 29.43) -> BenchRun:
    """The 5 kg run of the published table, by default without counter-masses along x at 3 g0."""
    key = repr((rig.bench, masses or {}, motion, acceleration))
    if key not in _RUNS:
        _RUNS[key] = simulate_run(rig, MECHANISM, PlannedRun("r", 5.0, masses or {}, motion, acceleration, 1))
    return _RUNS[key]


def supported(done: BenchRun, rig: Rig = RIG):
    """Wrench about the origin that the channels of all force sensors add up to, (n, 6) [N, N m]."""
    seen, total = true_signals(rig, done), np.zeros((len(done.time), 6))
    for name, sensor in rig.supports.items():
        load = np.zeros((len(done.time), 6))
        for column in sensor.columns(name):
            load[:, ("Fx", "Fy", "Fz", "Mx", "My", "Mz").index(column.component)] = seen[column.channel]
        total += load @ wrench_transport(np.array(sensor.position)).T
    return total
