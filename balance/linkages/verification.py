"""Check by dynamics: force, moment and drive torque of every stage, at constant and at varying input speed.

Independent of the method's own sums: every stage is a mechanism, and F = -dp/dt, M = -dL/dt over all its bodies. At
constant speed some errors of gears on the driven crank are invisible, so both are always run. Bodies that are stated to
turn together are checked first.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf

import numpy as np

from ..arrays import Floats, root_mean_square
from ..closure import Closure, Trajectory
from ..dynamics.inverse_dynamics import Response, simulate
from ..errors import ClosureError, ModelError
from ..mechanism.mechanism import Mechanism
from ..mechanism.mjcf_parser import mechanism_from_text
from ..motion import Samples
from .bearing_forces import BearingForces, bearing_forces
from .equivalence_method import LinkageBalance, composite_bodies
from .linkage import Linkage
from .mjcf_writer import geared_trajectory, linkage_mjcf, skeleton

COLUMNS = ("Fx_N", "Fy_N", "Mz_Nm", "torque_Nm")
"""Force, moment and drive torque along a motion."""
STAGES = ("before", "force", "complete")
"""Without counter-masses, with them, with them and gears."""
STATES = 8
"""Configurations, about the start, at which angular velocities are compared."""
VARIATION = 0.3
"""Amplitude of the varying speed, as a share of its mean."""
SAMPLES = 720
"""Instants of one turn."""
ROUNDING = 1e-13
"""Share of the largest of all runs and stages below which a force, moment or torque is zero."""


def check_turns(result: LinkageBalance) -> None:
    """Raise ModelError for bodies that are stated to turn together and do not, by velocities that the joints allow."""
    linkage = result.linkage
    if not linkage.turns_with:
        return
    mechanism = mechanism_from_text(linkage_mjcf(result, "before", together=False), linkage.name)
    closure = Closure(mechanism)
    rates = closure.velocities(closure.states(STATES, step=0.02))
    tree = skeleton(result, together=False)

    def spin(body: str) -> Floats:
        return rates[:, [mechanism.coordinate_index(joint) for joint in tree.turning(body)]].sum(axis=1)

    for first, second in linkage.turns_with:
        apart = float(np.abs(spin(first) - spin(second)).max())
        if apart > 1e-9 * float(np.abs(rates).max()):
            raise ModelError(
                f"turns_with: bodies {first} and {second} of {linkage.name} do not turn together: their angular "
                "velocities differ"
            )


@dataclass(frozen=True)
class SimulatedLinkage:
    """All stages along one motion of the driven joint."""

    trajectory: Trajectory
    """Of the linkage without gears."""
    drive: str
    responses: Mapping[str, Response]
    """By stage: before, force, complete, built."""
    bearings: Mapping[str, BearingForces | None]
    """Bearing and tooth forces by stage; None where it is statically indeterminate."""
    noise: Mapping[str, float]
    """Below this the largest force [N], moment and torque [N m] are zero."""

    def series(self, stage: str) -> dict[str, Floats]:
        """FX, FY [N], M about the base origin and drive torque [N m] over time, (n,) each."""
        response = self.responses[stage]
        columns = response.force[:, 0], response.force[:, 1], response.moment[:, 2], response.torque[self.drive]
        return dict(zip(COLUMNS, columns, strict=True))

    def rms(self, stage: str) -> dict[str, float]:
        """Root mean squares [N, N m]."""
        return {name: root_mean_square(values) for name, values in self.series(stage).items()}

    def residual(self, stage: str) -> dict[str, float]:
        """Largest force and moment as a share of before; infinite where they were zero before and are not now."""
        before, after = _largest(self.responses["before"]), _largest(self.responses[stage])
        shares = {}
        for name in ("force", "moment"):
            old, new, least = before[name], after[name], self.noise[name]
            shares[name] = new / old if old > least else 0.0 if new <= least else inf
        return shares


@dataclass(frozen=True)
class Verification:
    """A balanced linkage simulated."""

    constant: SimulatedLinkage
    varying: SimulatedLinkage
    mass: Mapping[str, float]
    """Moving mass by stage, of the counter-gears where it is given [kg]."""
    speed: float
    """Mean speed of the driven joint [rad/s]."""
    variation: float
    """Amplitude of the varying speed, as a share of its mean."""
    swings: bool = False
    """Whether the driven joint swings between two ends: its speed is then never constant, but harmonic."""

    @property
    def labels(self) -> tuple[str, str]:
        """Names of the two runs."""
        return ("harmonic swing", "uneven swing") if self.swings else ("constant input speed", "varying input speed")

    def penalty(self, stage: str) -> dict[str, float]:
        """Mass and RMS drive torque at constant and varying speed, as multiples of before."""
        runs = {"torque_constant_speed": self.constant, "torque_varying_speed": self.varying}
        before = {name: run.rms("before")["torque_Nm"] for name, run in runs.items()}
        torque = {
            name: run.rms(stage)["torque_Nm"] / before[name]
            for name, run in runs.items()
            if before[name] > run.noise["torque"]
        }
        return {"mass": self.mass[stage] / self.mass["before"], **torque}


def verify_linkage(
    result: LinkageBalance,
    speed: float | None = None,
    variation: float = VARIATION,
    count: int = SAMPLES,
    built: LinkageBalance | None = None,
) -> Verification:
    """Simulate a balanced linkage; ``speed`` of the driven joint [rad/s] defaults to the described one.

    ``built`` is the same linkage with what was built, as a stage of its own.
    Raises ModelError or ClosureError where it cannot be simulated, or bodies stated to turn together do not.
    """
    linkage = result.linkage
    speed = linkage.speed if speed is None else speed
    if not speed or linkage.drive is None:
        raise ModelError(f"{linkage.name}: name the driven joint and its speed: drive = 'A0', speed = '50 rpm'")
    most = "complete" if result.moment is not None else "force"
    stages = {stage: (result, stage) for stage in (STAGES if result.moment is not None else STAGES[:2])}
    stages |= {} if built is None else {"built": (built, most)}
    check_turns(result)
    models = {stage: mechanism_from_text(linkage_mjcf(*made), linkage.name) for stage, made in stages.items()}
    closure = Closure(models["before"])
    start = float(closure.home[models["before"].coordinate_index(linkage.drive)])
    paths = [
        _followed(closure, linkage, turn_samples(linkage, speed, share, start, count)) for share in (0.0, variation)
    ]
    runs = [
        {
            stage: geared_trajectory(made, path, models["before"], models[stage]) if kind == "complete" else path
            for stage, (made, kind) in stages.items()
        }
        for path in paths
    ]
    responses = [{stage: simulate(models[stage], path) for stage, path in run.items()} for run in runs]
    largest = [_largest(response) for run in responses for response in run.values()]
    noise = {name: ROUNDING * max(each[name] for each in largest) for name in largest[0]}
    constant, varying = (
        SimulatedLinkage(
            path, linkage.drive, response,
            {stage: _bearings(stages[stage][0], models[stage], each) for stage, each in run.items()}, noise,
        )
        for path, run, response in zip(paths, runs, responses, strict=True)
    )  # fmt: skip
    mass = {stage: moving_mass(*made) for stage, made in stages.items()}
    return Verification(constant, varying, mass, speed, variation, linkage.swing is not None)


def _bearings(result: LinkageBalance, model: Mechanism, path: Trajectory) -> BearingForces | None:
    """Forces in the bearings; None where equilibrium does not determine them."""
    try:
        return bearing_forces(result, model, path)
    except ModelError:
        return None


def _followed(closure: Closure, linkage: Linkage, motion: Samples) -> Trajectory:
    """The trajectory; where the driven joint cannot make its motion, the error names the key that helps."""
    try:
        return closure.follow(motion)
    except ClosureError as error:
        if closure.dof != 1:
            raise
        turns = "a joint that makes no full turns needs swing = ['20 deg', '80 deg']"
        hint = turns if linkage.swing is None else "give it a narrower swing"
        raise ClosureError(f"{error} ({linkage.drive} in rad); {hint}") from error


def turn_samples(linkage: Linkage, speed: float, variation: float, start: float, count: int) -> Samples:
    """One turn at speed w (1 + variation sin(w t)), or one swing to and fro, which is never of constant speed."""
    assert linkage.drive is not None
    time = np.arange(count) * 2 * np.pi / abs(speed) / count
    phase = speed * time
    turn = phase + variation * (1 - np.cos(phase))
    rate = speed * (1 + variation * np.sin(phase))
    rate_of_rate = speed**2 * variation * np.cos(phase)
    if linkage.swing is None:
        motion = start + turn, rate, rate_of_rate
    else:
        middle, half = sum(linkage.swing) / 2, (linkage.swing[1] - linkage.swing[0]) / 2
        swept = half * np.cos(turn) * rate_of_rate - half * np.sin(turn) * rate**2
        motion = middle + half * np.sin(turn), half * np.cos(turn) * rate, swept
    position, velocity, acceleration = (x[:, None] for x in motion)
    return Samples(time, position, velocity, acceleration, joints=(linkage.drive,))


def moving_mass(result: LinkageBalance, stage: str) -> float:
    """Mass of the linkage in a stage, of the counter-gears where it is given [kg]."""
    total = sum(piece.mass for pieces in composite_bodies(result, stage).values() for piece in pieces)
    gears = result.gears.values() if stage == "complete" else ()
    return float(total + sum(gear.counter_mass or 0.0 for gear in gears))


def counter_gears_without_mass(result: LinkageBalance) -> list[str]:
    """Gears whose counter-gear's mass is not given: ``moving_mass`` leaves it out."""
    return [name for name, gear in result.gears.items() if gear.counter_mass is None]


def _largest(response: Response) -> dict[str, float]:
    """Largest force [N], moment and drive torque [N m]."""
    torque = max(float(np.abs(values).max()) for values in response.torque.values())
    force, moment = (float(np.linalg.norm(values, axis=1).max()) for values in (response.force, response.moment))
    return {"force": force, "moment": moment, "torque": torque}
