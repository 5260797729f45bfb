"""Many designs of counter-masses on one motion: ``balance sweep`` against MuJoCo's ``mj_inverse``, a design at a time.

    python -m benchmarks.designs [--designs 10000] [--samples 200] [--peer-designs 50] [--rounds 5]

The peer sets the mass of each counter-mass body and calls ``mj_inverse`` at every sample of the same closed trajectory,
its soft constraints off. It runs some of the designs and is scaled up; what both found for these, the peak and the RMS
of the shaking force, is compared first. The simulations that ours starts from are in its time.
"""

import argparse
import statistics
import time
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable

import mujoco
import numpy as np

from balance.arrays import Floats
from balance.balancing.sweep import Grid, Problem, Variable
from balance.closure import Closure
from balance.mechanism.mjcf_parser import load_mechanism
from balance.motion.motion_files import load_motion

FORCE = frozenset({"force"})
SITES = ("counter_A0A", "counter_B0B")
REQUIRED = {"peak and RMS": 2000, "RMS alone": 5000}
"""How many times faster than the peer."""
AGREEMENT = 1e-9
"""Largest difference from the peer, relative."""


class Peer:
    """The manipulator with a body at each site, in MuJoCo."""

    def __init__(self, problem: Problem) -> None:
        root = ElementTree.fromstring(problem.mechanism.text)
        for body in list(root.iter("body")):
            for site in [site for site in body.findall("site") if site.get("name") in SITES]:
                disc = ElementTree.SubElement(body, "body", name=f"disc_{site.get('name')}", pos=site.get("pos", ""))
                ElementTree.SubElement(disc, "inertial", pos="0 0 0", mass="1", diaginertia="1e-9 1e-9 1e-9")
        self.model = mujoco.MjModel.from_xml_string(ElementTree.tostring(root, encoding="unicode"))
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        self.model.opt.gravity[:] = 0.0
        for body in problem.mechanism.own_mass:
            self.model.body(body).mass[:] = problem.mechanism.mass(body)
        self.data = mujoco.MjData(self.model)
        names = [self.model.joint(i).name for i in range(self.model.njnt)]
        self.order = [names.index(name) for name in problem.mechanism.coordinates]
        self.bodies = [self.model.body(f"disc_{name}").id for name in SITES]
        self.trajectory = Closure(problem.mechanism).follow(problem.samples)

    def levels(self, masses: Floats) -> tuple[Floats, Floats]:
        """Peak and RMS [N] of the shaking force of designs (n, sites) [kg], (n,) each."""
        model, data, order = self.model, self.data, self.order
        squares = np.empty((len(masses), len(self.trajectory.time)))
        for k, design in enumerate(masses):
            model.body_mass[self.bodies] = design
            for i, (q, v, a) in enumerate(zip(self.trajectory.q, self.trajectory.v, self.trajectory.a, strict=True)):
                data.qpos[order], data.qvel[order], data.qacc[order] = q, v, a
                mujoco.mj_inverse(model, data)
                mujoco.mj_rnePostConstraint(model, data)
                force = data.cfrc_int[1, 3:]
                squares[k, i] = force @ force
        return np.sqrt(squares.max(axis=1)), np.sqrt(squares.mean(axis=1))


def timed(work: Callable[[], object]) -> float:
    """Seconds that ``work`` takes."""
    started = time.perf_counter()
    work()
    return time.perf_counter() - started


def main() -> None:
    """Compare what both find, then time them in turn."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--designs", type=int, default=10_000)
    parser.add_argument("--samples", type=int, default=200)
    parser.add_argument("--peer-designs", type=int, default=50)
    parser.add_argument("--rounds", type=int, default=5)
    given = parser.parse_args()
    side = int(np.sqrt(given.designs))
    variables = tuple(Variable(name, "mass", np.linspace(0.1, 30.0, side)) for name in SITES)
    designs = Grid(variables).designs(slice(0, side * side))
    motion = load_motion("x")
    samples = motion.sample(given.samples / motion.duration)
    mechanism = load_mechanism("parallelogram-6bar").with_payload({"platform": 5.0})
    problems = {name: Problem(mechanism, samples, peaks=name != "RMS alone", quantities=FORCE) for name in REQUIRED}
    peer = Peer(problems["RMS alone"])
    some = np.random.default_rng(1).choice(len(designs), given.peer_designs, replace=False)
    peak, rms = peer.levels(designs[some])
    ours = problems["peak and RMS"].results(variables, designs)
    apart = max(
        float(np.abs(ours["peak_F_N"][some] / peak - 1.0).max()), float(np.abs(ours["rms_F_N"][some] / rms - 1.0).max())
    )
    print(f"{len(designs)} designs x {len(samples.time)} samples; both agree to {apart:.1g}")
    if not apart < AGREEMENT:
        raise SystemExit(f"the results differ by {apart:.3g}: expected at most {AGREEMENT:g}")
    for name, problem in problems.items():
        ratios = []
        for _ in range(given.rounds):
            theirs = timed(lambda: peer.levels(designs[some])) * len(designs) / len(some)
            ratios.append(theirs / timed(lambda p=problem: p.results(variables, designs)))  # type: ignore[misc]
        print(f"{name}: {statistics.median(ratios):.0f} times mj_inverse (needs {REQUIRED[name]}); {sorted(ratios)}")


if __name__ == "__main__":
    main()
