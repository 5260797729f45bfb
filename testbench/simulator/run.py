"""One run of the bench: the mechanism moves, its shaking wrench moves the base.

``simulate_run`` makes it without anything random, ``disturbed`` adds what shakes the bench besides. What the rig's
``[bench]`` does not state is left out: see ``Bench``. Left out in any case: flexible links, play and ripple of gears,
what the drives' control does (the joints follow the command), and what is of second order in the base's motion.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from balance.arrays import Floats
from balance.closure import Closure, Trajectory
from balance.dynamics.inverse_dynamics import Response, simulate
from balance.dynamics.moving_base import BaseMotion, ElasticBase, first_moment, locked_inertia, times
from balance.errors import DataError
from balance.mechanism.mechanism import Mechanism
from balance.motion import Samples
from balance.motion.motion_files import load_motion

from ..campaign_plan import PlannedRun
from ..errors import RigError
from ..rig import Rig
from ..rig.bench import Bench, Rotor
from ..rig.support_loads import elastic_base
from . import added_bodies, disturbances, moving_base_coupling, structural_response
from .added_bodies import with_planes
from .moving_base_coupling import Coupling, torque_of_base

RATE_HZ = 10_000.0
"""Of the simulation [Hz], or twice that of the fastest logger: the loggers interpolate between its samples."""
Point = tuple[float, float, float]


@dataclass(frozen=True)
class BenchRun:
    """What happened on the bench, from the start of the motion, or a lead before it, until the loggers stop."""

    mechanism: Mechanism
    """With its payload and counter-masses, planes and rotors, and gravity as it is on the tilted base."""
    command: Samples
    trajectory: Trajectory
    response: Response
    """With the moment of the rotors."""
    carried: Floats
    """Inertia of the mechanism about the base frame's origin, (6, 6)."""
    base: ElasticBase
    motion: BaseMotion
    """Of the base."""
    gravity: Floats = field(default_factory=lambda: np.zeros(3))
    """Gravity that the base turns in, (3,) [m/s2]; zero where the rig leaves it out."""
    at_rest: Floats = field(default_factory=lambda: np.zeros(3))
    """What accelerometers that were zeroed level show at rest on the tilted base, base axes, (3,) [m/s2]."""
    coupling: Coupling | None = None
    """None: the mechanism's inertia is that at the start."""
    rotors: Mapping[str, Rotor] = field(default_factory=dict)
    """Of the motors, by joint."""
    rough: Floats | None = None
    """What the mechanism exerts on the base beyond wrench and weight, (n, 6) [N, N m]."""
    elastic: Mapping[Point, Floats] = field(default_factory=dict)
    """What the frame's modes add to the acceleration of points of the base, (n, 3) [m/s2]."""

    @property
    def time(self) -> Floats:
        """Uniform, zero where the motion starts, (n,) [s]."""
        return self.command.time

    @property
    def step(self) -> float:
        """Between two samples [s]."""
        return float(self.time[1] - self.time[0])

    @cached_property
    def wrench(self) -> Floats:
        """Shaking wrench about the base frame's origin, (n, 6) [N, N m]."""
        return np.hstack([self.response.force, self.response.moment])

    @cached_property
    def transmitted(self) -> Floats:
        """What the mechanism exerts on the moving base beyond its weight at rest, about its origin, (n, 6) [N, N m].

        w - M_mechanism x'', and what the rig states of weight, coupling and roughness.
        """
        if self.coupling is None:
            found = self.wrench - times(self.carried, self.motion.acceleration)
        else:
            found = self.wrench - self.coupling.reaction(self.motion)
        if np.any(self.gravity):
            found = found + moving_base_coupling.wandering(self.response.weight_moment) + self._turned_weight
        return found if self.rough is None else found + self.rough

    @property
    def _turned_weight(self) -> Floats:
        first = first_moment(self.carried if self.coupling is None else self.coupling.inertia)
        place = np.broadcast_to(first, (len(self.time), 3))
        return moving_base_coupling.turned_weight(
            self.gravity, place, self.mechanism.total_mass, self.motion.displacement
        )

    @cached_property
    def felt(self) -> Floats:
        """Accelerations of the base as accelerometers feel them, tilt in gravity included, (n, 6) [m/s2, rad/s2]."""
        turned = moving_base_coupling.apparent_gravity(self.gravity, self.motion.displacement) + self.at_rest
        return self.motion.acceleration + np.hstack([turned, np.zeros_like(turned)])

    @cached_property
    def torque(self) -> Mapping[str, Floats]:
        """Torque of each driven joint on its body, (n,) [N m, N]; with the base's share where the rig couples them."""
        still = self.response.torque
        if self.coupling is None:
            return still
        field = self.motion.acceleration.copy()
        field[:, :3] += moving_base_coupling.apparent_gravity(self.gravity, self.motion.displacement)
        turning, driven = self.motion.velocity[:, 3:], tuple(still)
        more = torque_of_base(self.mechanism, self.trajectory, self.rotors, field, turning, driven)
        return {joint: torque + more[joint] for joint, torque in still.items()}


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


def simulate_run(rig: Rig, mechanism: Mechanism, planned: PlannedRun, lead: float = 0.0) -> BenchRun:
    """Run the bench. ``mechanism`` comes without payload and counter-masses; those of ``planned`` are put on it.

    ``lead`` is how long the bench rests before the motion, at times below zero [s].
    """
    bench = rig.bench
    loaded = _loaded(mechanism, bench, planned)
    try:
        motion = load_motion(planned.motion).with_peak_acceleration(planned.peak_acceleration)
    except DataError as error:
        raise RigError(f"motion {planned.motion!r} of run {planned.name}: {error}") from error
    command = _settling(motion.sample(rate_hz(rig)), bench.settling, lead)
    trajectory = Closure(loaded).follow(command)
    response = _with_rotors(simulate(loaded, trajectory), loaded, bench, trajectory)
    carried = locked_inertia(loaded, trajectory.q[0])
    base = _standing(bench, carried, loaded)
    moved, coupling = _moved(bench, loaded, trajectory, response, base, carried)
    level = mechanism.gravity
    at_rest, turning = level - loaded.gravity, loaded.gravity if bench.weight else np.zeros(3)
    run = BenchRun(
        loaded, command, trajectory, response, carried, base, moved, turning, at_rest, coupling, bench.rotors
    )
    return replace(run, elastic=_elastic(rig, run.transmitted, run.step)) if bench.modes else run


def disturbed(run: BenchRun, rig: Rig, seed: tuple[int, int]) -> BenchRun:
    """The run with what else shakes the bench, drawn from ``seed``; the run itself where the rig states nothing."""
    drawn = disturbances.draw_disturbance(rig.bench, run.base, len(run.time), run.step, seed)
    if drawn is None:
        return run
    shaken = replace(run, motion=run.motion.plus(drawn.motion), rough=drawn.wrench)
    return replace(shaken, elastic=_elastic(rig, shaken.transmitted, run.step)) if rig.bench.modes else shaken


def _loaded(mechanism: Mechanism, bench: Bench, planned: PlannedRun) -> Mechanism:
    """The mechanism as it stands on the bench."""
    placed = added_bodies.with_rotors(with_planes(mechanism, bench.planes), bench.rotors)
    if any(bench.tilt):
        placed = replace(placed, gravity=moving_base_coupling.tilted(mechanism.gravity, np.array(bench.tilt)))
    loaded = placed.with_payload({payload_body(mechanism): planned.payload})
    return loaded.with_counter_mass(planned.counter_masses)


def _standing(bench: Bench, carried: Floats, mechanism: Mechanism) -> ElasticBase:
    """The base under what it carries; where the rig states the weight, with what that does to its stiffness."""
    base = elastic_base(bench, carried)
    if not bench.weight:
        return base
    added = moving_base_coupling.stiffness(bench.mounts, base.stiffness, base.mass, mechanism.gravity)
    return replace(base, stiffness=base.stiffness + added)


def _with_rotors(response: Response, mechanism: Mechanism, bench: Bench, trajectory: Trajectory) -> Response:
    if not bench.rotors:
        return response
    return replace(response, moment=response.moment - added_bodies.momentum(mechanism, bench.rotors, trajectory.a))


def _moved(
    bench: Bench, mechanism: Mechanism, trajectory: Trajectory, response: Response, base: ElasticBase, carried: Floats
) -> tuple[BaseMotion, Coupling | None]:
    """How the base moves under what the mechanism does."""
    wrench = np.hstack([response.force, response.moment])
    push = wrench + moving_base_coupling.wandering(response.weight_moment) if bench.weight else wrench
    step = float(trajectory.time[1] - trajectory.time[0])
    if bench.coupling == "locked":
        return base.respond(push, step), None
    pull = mechanism.gravity if bench.weight else np.zeros(3)
    coupling = Coupling.of(mechanism, trajectory, wrench, bench.rotors, pull)
    return coupling.respond(base, carried, push, step), coupling


def _elastic(rig: Rig, transmitted: Floats, step: float) -> dict[Point, Floats]:
    """What the modes add, by the place of the sensor. Raises RigError for a sensor that is not on the base."""
    known = rig.base_accelerometers
    for i, mode in enumerate(rig.bench.modes):
        if strange := [name for name in mode.at if name not in known]:
            raise RigError(
                f"bench.modes.{i}.at: no accelerometer {strange[0]!r} on the base: there are {', '.join(known)}"
            )
    added = structural_response.at_sensors(rig.bench.modes, transmitted, step)
    return {known[name].position: values for name, values in added.items()}


def rate_hz(rig: Rig) -> float:
    """Rate of the simulation for a rig [Hz]."""
    return max(RATE_HZ, 2.0 * max(logger.rate for logger in rig.loggers.values()))


def _settling(samples: Samples, seconds: float, lead: float) -> Samples:
    """Rest, the motion, then rest."""
    step = float(samples.time[1])
    before, after = round(lead / step), round(seconds / step)
    width = ((before, after), (0, 0))
    return Samples(
        np.arange(-before, len(samples.time) + after) * step,
        np.pad(samples.position, width, mode="edge"),
        np.pad(samples.velocity, width),
        np.pad(samples.acceleration, width),
        samples.joints,
        samples.point,
        samples.axes,
    )
