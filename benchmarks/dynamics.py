"""Closure, shaking wrench and drive torque of a trajectory: ``balance`` against a Python loop over Pinocchio, in turn.

    python -m benchmarks.dynamics [--samples 100000] [--peer-samples 4000] [--rounds 5] [--tuned]

The peer closes the loops by Newton's method, each sample starting from the one before, with rank-safe least squares on
all constraint rows; then it calls ``rnea``, projects the torques on the loops and takes the wrench from the rate of
momentum. It builds no regressor. With ``--tuned`` it starts from a Taylor series and inverts a fixed set of independent
rows. It runs on a stretch of the samples and is scaled up; what both found is compared first, on that stretch.
"""

import argparse
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pinocchio

from balance.arrays import Floats
from balance.closure import Closure
from balance.dynamics.inverse_dynamics import simulate
from balance.mechanism.mechanism import Mechanism
from balance.mechanism.mjcf_parser import load_mechanism
from balance.mechanism.tape import compiled_loop
from balance.motion import Samples
from balance.motion.motion_files import load_motion

REQUIRED = {"serial-1r": 20, "serial-2r": 20, "serial-3r": 20, "four-bar": 120, "parallelogram-6bar": 120,
            "parallelogram-6bar-full": 120}  # fmt: skip
"""Mechanisms, and how many times faster than the peer they must be."""
AGREEMENT = 1e-9
"""Largest difference from the peer, relative to the largest value of each quantity."""
CLOSED = 1e-12
"""Residual at which the peer stops [m, rad]."""
RANK = 1e-9
"""Relative size of a singular value that the peer takes for zero."""
_UPRIGHT = np.eye(3)
_WORLD = pinocchio.LOCAL_WORLD_ALIGNED


class Peer:
    """Inverse dynamics of one mechanism, a sample at a time, as one writes it over Pinocchio."""

    def __init__(self, mechanism: Mechanism, samples: Samples, tuned: bool) -> None:
        self.tuned = tuned
        self.model = mechanism.pinocchio_model()
        self.ends = [
            tuple(self._frame(end.joint, end.position) for end in (loop.first, loop.second)) for loop in mechanism.loops
        ]
        self.point = self._point(mechanism, samples)
        self.joints = [mechanism.coordinate_index(joint) for joint in samples.joints]
        self.motors = [mechanism.coordinate_index(joint) for joint in mechanism.driven]
        self.data = self.model.createData()
        self.rows = Closure(mechanism).rows if tuned else slice(None)

    def _frame(self, coordinate: int, position: Floats) -> int:
        """A frame at a point of the body that moves with a coordinate."""
        name, placement = f"point {self.model.nframes}", pinocchio.SE3(np.eye(3), position)
        joint = self._owner(coordinate)
        return self.model.addFrame(pinocchio.Frame(name, joint, 0, placement, pinocchio.OP_FRAME))

    def _owner(self, coordinate: int) -> int:
        """The joint that has this coordinate, the universe for -1."""
        owners = [i for i in range(1, self.model.njoints) if self.model.idx_vs[i] <= coordinate]
        return owners[-1] if owners else 0

    def _point(self, mechanism: Mechanism, samples: Samples) -> int | None:
        if samples.joints:
            return None
        point = samples.drive(mechanism).point
        assert point is not None
        return self._frame(*point)

    def run(self, samples: Samples, q: Floats) -> tuple[Floats, Floats]:
        """Shaking wrench (n, 6) and drive torques (n, motors), starting near the configuration ``q``."""
        count = len(samples.time)
        wrench, torque = np.empty((count, 6)), np.empty((count, len(self.motors)))
        step = np.diff(samples.time, prepend=samples.time[0])
        v, a = np.zeros_like(q), np.zeros_like(q)
        for k in range(count):
            if self.ends or self.point is not None:
                guess = q + step[k] * (v + step[k] / 2 * a) if self.tuned else q
                q, v, a, rates = self._closed(guess, samples.position[k], samples.velocity[k], samples.acceleration[k])
                torque[k] = pinocchio.rnea(self.model, self.data, q, v, a) @ rates
            else:
                q, v, a = samples.position[k], samples.velocity[k], samples.acceleration[k]
                torque[k] = pinocchio.rnea(self.model, self.data, q, v, a)
            wrench[k] = self._wrench(q, v, a)
        return wrench, torque

    def _closed(
        self, q: Floats, target: Floats, rate: Floats, rate_of_rate: Floats
    ) -> tuple[Floats, Floats, Floats, Floats]:
        """Closed configuration, velocity, acceleration, and rates of all coordinates per rate of the motors."""
        for _ in range(20):
            gap, matrix = self._linearised(q, target)
            if np.abs(gap).max() < CLOSED:
                break
            step = np.linalg.solve(matrix, gap) if self.tuned else np.linalg.lstsq(matrix, gap, rcond=RANK)[0]
            q = q - step
        inverse = np.linalg.inv(matrix) if self.tuned else np.linalg.pinv(matrix, rcond=RANK)
        per_drive = inverse[:, -len(target) :]
        v = per_drive @ rate
        a = inverse @ self._demand(q, v, rate_of_rate)
        return q, v, a, per_drive @ np.linalg.inv(per_drive[self.motors])

    def _linearised(self, q: Floats, target: Floats) -> tuple[Floats, Floats]:
        """What is open, loops and drive, and its Jacobian, both on independent rows."""
        model, data = self.model, self.data
        pinocchio.computeJointJacobians(model, data, q)
        pinocchio.updateFramePlacements(model, data)
        gaps = [data.oMf[a].translation - data.oMf[b].translation for a, b in self.ends]
        blocks = [self._jacobian(a) - self._jacobian(b) for a, b in self.ends]
        if self.point is None:
            driven, moves = q[self.joints] - target, np.eye(model.nv)[self.joints]
        else:
            driven, moves = data.oMf[self.point].translation[:2] - target, self._jacobian(self.point)[:2]
        gap, matrix = np.concatenate(gaps)[self.rows], np.concatenate(blocks)[self.rows]
        return np.concatenate([gap, driven]), np.concatenate([matrix, moves])

    def _jacobian(self, frame: int) -> Floats:
        return pinocchio.getFrameJacobian(self.model, self.data, frame, _WORLD)[:3]

    def _demand(self, q: Floats, v: Floats, rate_of_rate: Floats) -> Floats:
        """Second rates that the joint accelerations must bring about, the velocity's share taken off."""
        pinocchio.forwardKinematics(self.model, self.data, q, v, np.zeros(self.model.nv))
        bias = np.concatenate([self._acceleration(b) - self._acceleration(a) for a, b in self.ends])[self.rows]
        own = np.zeros_like(rate_of_rate) if self.point is None else self._acceleration(self.point)[:2]
        return np.concatenate([bias, rate_of_rate - own])

    def _acceleration(self, frame: int) -> Floats:
        return pinocchio.getFrameClassicalAcceleration(self.model, self.data, frame, _WORLD).linear

    def _wrench(self, q: Floats, v: Floats, a: Floats) -> Floats:
        """Minus the rate of momentum, about the origin of the base frame."""
        rate = pinocchio.computeCentroidalMomentumTimeVariation(self.model, self.data, q, v, a)
        return -pinocchio.SE3(_UPRIGHT, self.data.com[0]).act(rate).vector


def motion_of(name: str, mechanism: Mechanism, count: int) -> Samples:
    """A motion of ``count`` samples: the manipulators' along x, a turn of the crank, sweeps of a chain's joints."""
    if name.startswith("parallelogram"):
        motion = load_motion("x")
        samples = motion.sample((count - 1) / motion.duration)
        return Samples(
            *(x[:count] for x in (samples.time, samples.position, samples.velocity, samples.acceleration)),
            point=samples.point,
        )
    time_s = np.linspace(0.0, 1.0, count)
    sweep, w = np.arange(1.0, len(mechanism.driven) + 1), 2 * np.pi
    if mechanism.loops:
        position, velocity, acceleration = 1.0 + w * time_s[:, None], np.full((count, 1), w), np.zeros((count, 1))
    else:
        angle = w * time_s[:, None] * sweep
        position, velocity, acceleration = np.sin(angle), w * sweep * np.cos(angle), -((w * sweep) ** 2) * np.sin(angle)
    return Samples(time_s, position, velocity, acceleration, joints=mechanism.driven)


@dataclass(frozen=True)
class Result:
    """Times of one mechanism."""

    name: str
    ours: float
    """Time a sample [s]."""
    peer: float
    """Time a sample [s]."""
    difference: float
    """Largest relative difference of wrench and torque."""

    @property
    def ratio(self) -> float:
        """How many times faster ours is."""
        return self.peer / self.ours


def compare(name: str, count: int, peer_count: int, rounds: int, tuned: bool) -> Result:
    """Compare results, then time both in turn; medians."""
    mechanism = load_mechanism(name)
    samples = motion_of(name, mechanism, count)
    first = max(0, (count - peer_count) // 2)
    part = slice(first, first + peer_count)
    stretch = Samples(
        *(x[part] for x in (samples.time, samples.position, samples.velocity, samples.acceleration)),
        samples.joints, samples.point, samples.axes,
    )  # fmt: skip
    peer = Peer(mechanism, samples, tuned)
    trajectory = Closure(mechanism).follow(samples)
    response = simulate(mechanism, trajectory)
    start = trajectory.q[part][0]
    wrench, torque = peer.run(stretch, start)
    mine = np.hstack([response.force, response.moment])[part], np.array(list(response.torque.values())).T[part]
    difference = max(_relative(a, b) for a, b in zip(mine, (wrench, torque), strict=True))
    ours, peers = [], []
    for _ in range(rounds):
        ours.append(_timed(lambda: simulate(mechanism, Closure(mechanism).follow(samples))) / count)
        peers.append(_timed(lambda: peer.run(stretch, start)) / len(stretch.time))
    return Result(name, statistics.median(ours), statistics.median(peers), difference)


def _relative(mine: Floats, other: Floats) -> float:
    return float(np.abs(mine - other).max() / np.abs(other).max())


def _timed(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def main(arguments: list[str] | None = None) -> int:
    """Print a line a mechanism; 1 where results differ or a ratio falls short."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.dynamics", description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--samples", type=int, default=100_000, help="samples of the trajectory")
    parser.add_argument("--peer-samples", type=int, default=4000, help="of these, samples that the peer computes")
    parser.add_argument("--rounds", type=int, default=5, help="times each runs; medians are shown")
    parser.add_argument("--only", nargs="*", default=list(REQUIRED), help="mechanisms")
    parser.add_argument("--tuned", action="store_true", help="a peer that predicts, and inverts independent rows")
    options = parser.parse_args(arguments)
    if compiled_loop() is None:
        print("numba (the extra 'compiled') is not installed: NumPy runs the kernel\n")
    print(
        f"Closure, wrench and drive torque of {options.samples} samples; Pinocchio's loop in Python on "
        f"{options.peer_samples} of them, scaled up\n\n"
        f"{'mechanism':<25}{'balance':>12}{'Pinocchio':>12}{'ratio':>9}{'required':>10}{'difference':>12}"
    )
    failed = False
    for name in options.only:
        result = compare(
            name, options.samples, min(options.peer_samples, options.samples), options.rounds, options.tuned
        )
        short = result.ratio < REQUIRED[name] or not result.difference < AGREEMENT
        failed |= short
        print(
            f"{name:<25}{result.ours * 1e6:>9.3f} us{result.peer * 1e6:>9.2f} us{result.ratio:>8.1f}x"
            f"{REQUIRED[name]:>9}x{result.difference:>12.1e}{'  too slow or different' if short else ''}"
        )
    return int(failed)


if __name__ == "__main__":
    raise SystemExit(main())
