"""One run of the bench: the mechanism moves, its shaking wrench moves the base.

``simulate_run`` makes it without anything random, ``disturbed`` adds floor and roughness. Effects that the rig's
``[bench]`` does not state are neglected (see ``Bench``), and in any case second order in the base's motion.

Elastic modes of the frame are lightly damped oscillators m (e'' + 2 z w e' + w^2 e) = psi W, W the mechanism's wrench
on the base and psi the mode's shape where it acts; a sensor where the shape is s has the additional acceleration s e''.
The shapes are those of the free frame, so that the modes do not change its rigid-body motion.
"""

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from balance.arrays import Floats
from balance.closure import Closure, Trajectory
from balance.dynamics.inverse_dynamics import Response, driven_rates
from balance.dynamics.moving_base import (
    BaseMotion,
    ElasticBase,
    apparent_gravity,
    first_moment,
    gravity_in_tilted_axes,
    linear_response,
    locked_inertia,
    times,
)
from balance.errors import DataError
from balance.mechanism.mechanism import Mechanism
from balance.motion import Motion, Samples
from balance.motion.motion_files import load_motion

from ..campaign_plan import PlannedRun
from ..errors import RigError
from ..rig import Rig
from ..rig.bench import Bench, Mode, Rotor
from . import added_bodies, disturbances, moving_base_coupling
from .added_bodies import with_planes
from .bench_dynamics import BenchDynamics, Contact, shaking
from .drive_trains import DriveTrains, motor_side, with_motor_sides
from .elastic_joints import is_elastic, with_elastic_joints, with_elastic_links
from .moving_base_coupling import Coupling, base_motion_loads, base_motion_torque

RATE_HZ = 10_000.0
"""Least rate of the simulation; twice that of the fastest logger where that is more: loggers interpolate [Hz]."""
Point = tuple[float, float, float]
_IMMOVABLE = 1e9
"""By how much a fixed base is heavier and stiffer than one that moves: its motion is so much smaller."""
_SAMPLED = ("time", "position", "velocity", "acceleration")


@dataclass(frozen=True)
class BenchRun:
    """The bench from the start of the motion, or a lead before it, until the loggers stop."""

    mechanism: Mechanism
    """With payload, counter-masses, planes and rotors, in the gravity of the tilted base."""
    command: Samples
    trajectory: Trajectory
    response: Response
    """Shaking force and moment, rotors included, and torques."""
    mechanism_inertia: Floats
    """Of the locked mechanism about the base frame's origin, (6, 6) [kg, kg m, kg m2]."""
    base: ElasticBase
    motion: BaseMotion
    """Of the base."""
    gravity: Floats = field(default_factory=lambda: np.zeros(3))
    """Gravity in which the base turns, (3,) [m/s2]; zero where the rig neglects it."""
    tilt_offset: Floats = field(default_factory=lambda: np.zeros(3))
    """Reading at rest, on the tilted base, of accelerometers that were zeroed level, base axes, (3,) [m/s2]."""
    coupling: Coupling | None = None
    """None for a mechanism that is locked at its start."""
    rotors: Mapping[str, Rotor] = field(default_factory=dict)
    """Rotors of the motors by joint."""
    roughness: Floats | None = None
    """Random wrench of drives and joints on the base, (n, 6) [N, N m]."""
    modal_acceleration: Mapping[Point, Floats] = field(default_factory=dict)
    """Acceleration by the frame's modes at points of the base, (n, 3) [m/s2]."""
    drives: DriveTrains | None = None
    """Transmissions and controls; None where all joints follow the command."""
    rider: Floats | None = None
    """Inertia of what rides on the force sensors, about the base frame's origin, (6, 6) [kg, kg m, kg m2]."""

    @property
    def time(self) -> Floats:
        """Uniform time, zero where the motion starts, (n,) [s]."""
        return self.command.time

    @property
    def step(self) -> float:
        """Step of time [s]."""
        return float(self.time[1] - self.time[0])

    @cached_property
    def wrench(self) -> Floats:
        """Shaking wrench about the base frame's origin, (n, 6) [N, N m]."""
        return np.hstack([self.response.force, self.response.moment])

    @cached_property
    def transmitted_wrench(self) -> Floats:
        """Wrench on the moving base beyond the weight at rest, about its origin, (n, 6) [N, N m].

        w - M_mechanism x'', with weight, coupling and roughness where the rig states them.
        """
        if self.coupling is None:
            found = self.wrench - times(self.mechanism_inertia, self.motion.acceleration)
        else:
            found = self.wrench - self.coupling.reaction(self.motion)
        if np.any(self.gravity):
            found = found + moving_base_coupling.weight_wrench_change(self.response.weight_moment) + self._turned_weight
        return found if self.roughness is None else found + self.roughness

    @cached_property
    def supported_wrench(self) -> Floats:
        """What the force sensors carry: ``transmitted_wrench`` less what accelerates the rider, (n, 6) [N, N m]."""
        found = self.transmitted_wrench
        if self.rider is None:
            return found
        found = found - times(self.rider, self.motion.acceleration)
        place, moved = np.broadcast_to(first_moment(self.rider), (len(self.time), 3)), self.motion.displacement
        return found + moving_base_coupling.tilted_weight_wrench(self.gravity, place, self.rider[0, 0], moved)

    @property
    def _turned_weight(self) -> Floats:
        first = first_moment(self.mechanism_inertia if self.coupling is None else self.coupling.inertia)
        place = np.broadcast_to(first, (len(self.time), 3))
        return moving_base_coupling.tilted_weight_wrench(
            self.gravity, place, self.mechanism.total_mass, self.motion.displacement
        )

    @cached_property
    def sensed_acceleration(self) -> Floats:
        """Accelerations of the base as accelerometers sense them, tilt in gravity included, (n, 6) [m/s2, rad/s2]."""
        turned = apparent_gravity(self.gravity, self.motion.displacement) + self.tilt_offset
        return self.motion.acceleration + np.hstack([turned, np.zeros_like(turned)])

    @cached_property
    def torque(self) -> Mapping[str, Floats]:
        """Torque of each motor at its joint, (n,) [N m, N]; with the base's motion where the rig couples them."""
        found = {name: torque for name, torque in self.response.torque.items() if not is_elastic(name)}
        if self.coupling is not None:
            turning = [k for k, name in enumerate(self.response.torque) if name in found]
            rates = driven_rates(self.mechanism, self.trajectory.per_drive, tuple(self.response.torque))
            loads = base_motion_loads(self.mechanism, self.trajectory, self.rotors, rates[:, :, turning])
            field = self.motion.acceleration.copy()
            field[:, :3] += apparent_gravity(self.gravity, self.motion.displacement)
            more = base_motion_torque(loads, field, self.motion.velocity[:, 3:])
            found = {name: found[name] + more[:, k] for k, name in enumerate(found)}
        return found if self.drives is None else self.drives.motor_torque(found)

    def shown(self, joint: str) -> Floats:
        """Angle or travel of a joint as its encoder shows it, which turns with the motor, (n,) [rad, m]."""
        side = motor_side(joint)
        name = side if side in self.mechanism.coordinates else joint
        return self.trajectory.q[:, self.mechanism.coordinate_index(name)]


def payload_body(mechanism: Mechanism, named: str | None = None) -> str:
    """The body whose mass is the payload, the one that the mechanism's file names. Raises RigError for another one."""
    own = mechanism.payload_body
    if named not in {None, own}:
        raise RigError(f"payload_body is {named!r}, but the payload of {mechanism.name} is {own!r}")
    return own


def simulate_run(
    rig: Rig,
    mechanism: Mechanism,
    planned: PlannedRun,
    lead: float = 0.0,
    motion: Motion | None = None,
    rate: float | None = None,
) -> BenchRun:
    """Simulate a planned run: ``mechanism`` with the payload and the counter-masses of ``planned``.

    ``lead`` [s] is the rest before the motion, at times below zero. ``motion`` is that of ``planned`` where it is known
    already, such as one stored with a run; else it is looked for in the rig's folder, and among the shipped ones.
    ``rate`` [Hz] is that of the simulation, by default ``rate_hz``. Raises RigError for what cannot be simulated.
    """
    bench = rig.bench
    with _named(rig):
        loaded = _loaded(mechanism, bench, planned)
    try:
        moved_by = planned_samples(rig, planned, motion or planned_motion(rig, planned.motion), rate)
    except DataError as error:
        raise RigError(f"motion {planned.motion!r} of run {planned.name}: {error}") from error
    # The motion with rest before it, and after it as long as the bench takes to settle.
    step = float(moved_by.time[1])
    before, after = round(lead / step), round(bench.settling / step)
    width = ((before, after), (0, 0))
    command = Samples(
        np.arange(-before, len(moved_by.time) + after) * step,
        np.pad(moved_by.position, width, mode="edge"),
        np.pad(moved_by.velocity, width),
        np.pad(moved_by.acceleration, width),
        moved_by.joints,
        moved_by.point,
        moved_by.axes,
    )
    trajectory = Closure(mechanism).follow(command)
    with _named(rig):
        run = _moved(bench, loaded, command, trajectory, mechanism.gravity)
        if not bench.modes:
            return run
        return replace(run, modal_acceleration=_modal_acceleration(rig, run.transmitted_wrench, run.step))


def refuse_bench(rig: Rig, mechanism: Mechanism, planned: PlannedRun, samples: Samples) -> None:
    """Raise RigError, naming file and key, for a bench that cannot stand under a run where its ``samples`` begin."""
    start = replace(samples, **{name: getattr(samples, name)[:2] for name in _SAMPLED})
    with _named(rig):
        loaded = _loaded(mechanism, rig.bench, planned)
        dynamics = _dynamics(rig.bench, loaded, Closure(mechanism).follow(start), mechanism.gravity)
        dynamics.resolved(float(start.time[1] - start.time[0]))
        _modal_acceleration(rig, np.zeros((2, 6)), 1.0)


@contextmanager
def _named(rig: Rig) -> Iterator[None]:
    """Put the rig's file before what is wrong with its bench."""
    try:
        yield
    except RigError as error:
        raise RigError(f"{rig.source}: {error}") from error


def _moved(bench: Bench, loaded: Mechanism, command: Samples, rigid: Trajectory, level: Floats) -> BenchRun:
    """The bench along the trajectory of a mechanism that follows its command; ``level``: gravity on a level base."""
    dynamics = _dynamics(bench, loaded, rigid, level)
    base, drives, rotors = dynamics.base, dynamics.drives, dynamics.rotors
    if dynamics.coupling or drives or dynamics.contact:
        found = dynamics.solved()
        trajectory, response, motion = found.trajectory, found.response, found.motion
    else:
        trajectory, response = rigid, shaking(loaded, rigid, rotors)
        push = np.hstack([response.force, response.moment])
        push += moving_base_coupling.weight_wrench_change(response.weight_moment) if bench.weight else 0.0
        motion = base.respond(push, float(trajectory.time[1] - trajectory.time[0]))
    return BenchRun(
        loaded, command, trajectory, response, dynamics.carried, base, motion, dynamics.gravity, level - loaded.gravity,
        dynamics.coupling, rotors,
        drives=drives, rider=None if bench.rider is None else added_bodies.rider_inertia(bench.rider),
    )  # fmt: skip


def _dynamics(bench: Bench, loaded: Mechanism, rigid: Trajectory, level: Floats) -> BenchDynamics:
    """Base and drives along the trajectory of a mechanism that follows its command."""
    rotors, gravity = _rotors(bench), loaded.gravity if bench.weight else np.zeros(3)
    yields = bench.drives or bench.joints or bench.links
    drives = DriveTrains.of(loaded, bench.drives, rigid, bench.joints, bench.links) if yields else None
    command = drives.command if drives else rigid
    carried = locked_inertia(loaded, command.q[0])
    base = bench.elastic(carried, gravity)
    if bench.fixed:  # what moves it is nothing to it
        base = ElasticBase(_IMMOVABLE * base.mass, _IMMOVABLE * base.damping, _IMMOVABLE * base.stiffness)
    coupling = Coupling.of(loaded, command, rotors) if bench.coupling == "moving" else None
    contact = None if bench.contact is None else Contact.of(bench.mounts, base, level, bench.contact.friction)
    return BenchDynamics(loaded, command, rotors, base, carried, gravity, drives, coupling, contact)


def _rotors(bench: Bench) -> dict[str, Rotor]:
    """Rotors by the coordinate that they turn with: the motor side of a transmission."""
    elastic = {joint for joint, drive in bench.drives.items() if drive.transmission is not None}
    return {motor_side(joint) if joint in elastic else joint: rotor for joint, rotor in bench.rotors.items()}


def planned_motion(rig: Rig, name: str) -> Motion:
    """A motion of the rig's folder, else a shipped one. Raises DataError for neither."""
    own = [] if rig.folder is None else [rig.folder / name, rig.folder / f"{name}.toml"]
    path = next((path for path in own if path.is_file()), None)
    try:
        return load_motion(path or name)
    except DataError as error:
        if path or not own:
            raise
        raise DataError(f"expected {own[-1].name} in the rig's folder {rig.folder}: {error}") from error


def planned_samples(rig: Rig, planned: PlannedRun, motion: Motion, rate: float | None = None) -> Samples:
    """The motion with the planned peak acceleration, at the simulation's ``rate`` [Hz], or the one for the rig.

    Raises DataError for a peak of another kind than the motion's, and for a rate that does nothing or is too low.
    """
    return _with_peak(motion, planned).sample_as_asked(rate, rate_hz(rig))


def _with_peak(motion: Motion, planned: PlannedRun) -> Motion:
    if planned.peak_acceleration is None:
        return motion
    turning = bool(motion.joints) and not any(motion.sliding)
    if planned.turning != turning:
        kind, example, column = (
            ("joints that turn", "60 rad/s^2", "peak_acceleration_rad_s2")
            if turning
            else ("a point or slides", "3 g0", "peak_acceleration_g")
        )
        raise DataError(
            f"moves {kind}: expected a peak acceleration such as {example!r} ({column} in a run table), or none "
            "for the file's own"
        )
    return motion.with_peak_acceleration(planned.peak_acceleration)


def disturbed(run: BenchRun, rig: Rig, seed: tuple[int, int]) -> BenchRun:
    """The run with floor and roughness drawn from ``seed``; the run itself where the rig states neither."""
    drawn = disturbances.draw_disturbance(rig.bench, run.base, len(run.time), run.step, seed)
    if drawn is None:
        return run
    shaken = replace(run, motion=run.motion.plus(drawn.motion), roughness=drawn.wrench)
    return (
        replace(shaken, modal_acceleration=_modal_acceleration(rig, shaken.transmitted_wrench, run.step))
        if rig.bench.modes
        else shaken
    )


def _loaded(mechanism: Mechanism, bench: Bench, planned: PlannedRun) -> Mechanism:
    """The mechanism on the bench: planes, motor sides, rotors, tilt, payload, counter-masses."""
    # Planes of bodies and sites [m]; a stack's centre is half its thickness farther out, away from the bodies.
    found = dict(bench.planes)
    for site, density in bench.stacks.items():
        face = found.get(site, 0.0)
        found[site] = face + math.copysign(0.5 * planned.counter_masses.get(site, 0.0) / density, face)
    carrying = {*planned.payloads, *bench.unstated_mass, *([] if planned.payload is None else mechanism.payload_bodies)}
    if both := sorted(carrying & set(bench.links)):
        raise RigError(
            f"bench.links.{both[0]}: carries a payload or unstated mass, which might be on either part: expected a "
            "body without; state what it carries at a site"
        )
    yielding = with_elastic_joints(with_planes(mechanism, found), bench.joints)
    sided = with_motor_sides(with_elastic_links(yielding, bench.links, found), bench.drives)
    placed = added_bodies.with_rotors(sided, _rotors(bench))
    if any(bench.tilt):
        placed = replace(placed, gravity=gravity_in_tilted_axes(mechanism.gravity, np.array(bench.tilt)))
    loaded = placed.with_payload(planned.payloads, planned.payload)
    for body, mass in bench.unstated_mass.items():
        if body not in loaded.own_mass:
            raise RigError(f"bench.unstated_mass: {mechanism.name} has no body {body!r}: {', '.join(loaded.own_mass)}")
        loaded = loaded.with_payload({body: loaded.mass(body) + mass})
    return loaded.with_counter_mass(planned.counter_masses)


def _modal_acceleration(rig: Rig, transmitted: Floats, step: float) -> dict[Point, Floats]:
    """Acceleration by the modes at each sensor's position. Raises RigError for a sensor that is not on the base."""
    known = rig.base_accelerometers
    for i, mode in enumerate(rig.bench.modes):
        if strange := [name for name in mode.at if name not in known]:
            raise RigError(
                f"bench.modes.{i}.at: no accelerometer {strange[0]!r} on the base: there are {', '.join(known)}"
            )
    added = modal_acceleration(rig.bench.modes, transmitted, step)
    return {known[name].position: values for name, values in added.items()}


def mode_acceleration(mode: Mode, wrench: Floats, step: float) -> Floats:
    """Acceleration e'' of a mode from rest under ``wrench`` (n, 6) [N, N m] in steps of ``step`` [s], (n,) [m/s2]."""
    omega = 2.0 * np.pi * mode.frequency
    push = wrench @ np.array([*mode.translation, *mode.rotation]) / mode.mass
    back = np.array([-(omega**2), -2.0 * mode.damping * omega])
    state = linear_response(np.array([[0.0, 1.0], back]), np.array([[0.0], [1.0]]), push[:, None], step)
    return push + state @ back


def modal_acceleration(modes: tuple[Mode, ...], wrench: Floats, step: float) -> dict[str, Floats]:
    """Acceleration of all modes at each sensor under ``wrench`` (n, 6) [N, N m], base axes, (n, 3) [m/s2]."""
    found: dict[str, Floats] = {}
    for mode in modes:
        moved = mode_acceleration(mode, wrench, step)[:, None]
        for sensor, shape in mode.at.items():
            found[sensor] = found.get(sensor, 0.0) + moved * np.array(shape)
    return found


def rate_hz(rig: Rig) -> float:
    """Rate of the simulation for a rig [Hz]."""
    return max(RATE_HZ, 2.0 * max(logger.rate for logger in rig.loggers.values()))
