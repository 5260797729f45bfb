"""One run of the bench without noise: the mechanism moves, its shaking wrench moves the base.

Left out in this form, and small beside what is there: the weight's moment, which wanders with the platform; Coriolis
forces of the moving base; flexible links and frame; what the drives' control does.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from balance.arrays import Floats
from balance.closure import Closure, Trajectory
from balance.dynamics import Response, simulate
from balance.errors import DataError
from balance.mechanism import Mechanism
from balance.motion import Motion, Samples

from ..errors import RigError
from ..plan import PlannedRun
from ..rig import Rig
from .base import Base, BaseMotion
from .carried import locked_inertia

RATE_HZ = 10_000.0
"""Of the simulation [Hz], or twice that of the fastest logger: the loggers interpolate between its samples."""


@dataclass(frozen=True)
class BenchRun:
    """What happened on the bench, from the start of the motion until the loggers stop."""

    mechanism: Mechanism
    """With its payload and counter-masses."""
    command: Samples
    trajectory: Trajectory
    response: Response
    carried: Floats
    """Inertia of the mechanism about the base frame's origin, (6, 6)."""
    base: Base
    motion: BaseMotion
    """Of the base."""

    @property
    def time(self) -> Floats:
        """Uniform, (n,) [s]."""
        return self.command.time

    @cached_property
    def wrench(self) -> Floats:
        """Shaking wrench about the base frame's origin, (n, 6) [N, N m]."""
        return np.hstack([self.response.force, self.response.moment])

    @cached_property
    def transmitted(self) -> Floats:
        """What the mechanism exerts on the moving base, about its origin, (n, 6) [N, N m]: w - M_mechanism x''."""
        return self.wrench - self.motion.acceleration @ self.carried.T


def payload_body(mechanism: Mechanism, named: str | None = None) -> str:
    """The body whose mass is the payload. A run records its payload's mass alone, so it must be the mechanism's own."""
    own = mechanism.payload_bodies
    if len(own) != 1:
        raise RigError(
            f"{mechanism.name} names {len(own)} bodies as its payload: expected one, by "
            '<custom><text name="payload" data="BODY"/></custom> in its file'
        )
    if named not in {None, own[0]}:
        raise RigError(f"payload_body is {named!r}, but the payload of {mechanism.name} is {own[0]!r}")
    return own[0]


def simulate_run(rig: Rig, mechanism: Mechanism, planned: PlannedRun) -> BenchRun:
    """Run the bench. ``mechanism`` comes without payload and counter-masses; those of ``planned`` are put on it."""
    loaded = mechanism.with_payload({payload_body(mechanism): planned.payload})
    loaded = loaded.with_counter_mass(planned.counter_masses)
    try:
        motion = Motion.load(planned.motion).with_peak_acceleration(planned.peak_acceleration)
    except DataError as error:
        raise RigError(f"motion {planned.motion!r} of run {planned.name}: {error}") from error
    command = _settling(motion.sample(rate_hz(rig)), rig.bench.settling)
    trajectory = Closure(loaded).follow(command)
    response = simulate(loaded, trajectory)
    carried = locked_inertia(loaded, trajectory.q[0])
    base = Base.of(rig.bench, carried)
    wrench = np.hstack([response.force, response.moment])
    moved = base.respond(wrench, float(command.time[1]))
    return BenchRun(loaded, command, trajectory, response, carried, base, moved)


def rate_hz(rig: Rig) -> float:
    """Rate of the simulation for a rig [Hz]."""
    return max(RATE_HZ, 2.0 * max(logger.rate for logger in rig.loggers.values()))


def _settling(samples: Samples, seconds: float) -> Samples:
    """The motion, then rest."""
    step = float(samples.time[1])
    more = round(seconds / step)
    time = np.arange(len(samples.time) + more) * step
    rest = np.zeros((more, samples.position.shape[1]))
    return Samples(
        time,
        np.concatenate([samples.position, rest + samples.position[-1]]),
        np.concatenate([samples.velocity, rest]),
        np.concatenate([samples.acceleration, rest]),
        samples.joints,
        samples.point,
        samples.axes,
    )
