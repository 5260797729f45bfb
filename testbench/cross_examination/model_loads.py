"""What the model of the mechanism says a run's sensors should show, along the motion of its encoders.

Everything is on one coarse grid (RATE_HZ), below BAND_HZ: the motions excite little above, and the bodies' path is
closed once a run. The base is the rig's ``[bench]`` under the mechanism's shaking wrench, the mechanism locked at its
start; sensors between mechanism and base share that wrench by their stiffnesses.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from balance.arrays import Floats, Mask
from balance.closure import Closure, Trajectory
from balance.dynamics.inverse_dynamics import Response as Loads
from balance.dynamics.inverse_dynamics import driven_rates, simulate
from balance.dynamics.moving_base import BaseMotion, acceleration_in_body, locked_inertia
from balance.dynamics.regressor import driven_torque_regressor
from balance.errors import ModelError
from balance.mechanism.mechanism import Mechanism
from balance.motion import Samples

from ..errors import AnalysisError
from ..kinematics.encoder_motion import encoder_gaps, group_of_encoders, loaded_mechanism, point_path
from ..kinematics.gaps import gap_reach
from ..kinematics.smoothing_and_derivatives import (
    HIGHEST_CUTOFF,
    Grid,
    bridge_gaps,
    grid_of,
    low_pass,
    on_grid,
    smoothed_derivatives,
)
from ..loads.shaking_wrench import COMPONENTS
from ..rig import Column
from ..rig.sensors import AXES, Accelerometer, Encoder, Target, Torque, support_wrenches
from ..runs.si_run import SIRun

RATE_HZ = 250.0
"""Of the grid: six samples a period of BAND_HZ."""
BAND_HZ = 40.0
"""Low pass of readings and expectations [Hz]."""
POSITION_HZ = 80.0
"""Of the positions that the expectations are made of: twice the band, which leaves the band undistorted [Hz]."""
LEAST_SAMPLES = 64
"""Of the grid, below which nothing is compared."""
EDGE_S = 0.04
"""Left out at both ends, where low-passes start up [s]."""


@dataclass(frozen=True, eq=False)
class ModelledRun:
    """A run's motion by its encoders, and the mechanism as the run table states it."""

    run: SIRun
    unloaded: Mechanism
    mechanism: Mechanism
    """With the stated payload and counter-masses."""
    group: str
    """The group of the encoders, whose clock counts."""
    grid: Grid
    fine: Grid
    """Of the encoders themselves."""
    cutoff: float
    """Low pass of the positions [Hz]."""
    path: Trajectory
    valid: Mask
    """Samples that neither gaps nor the ends touch, (n,) [-]."""

    @classmethod
    def of(cls, run: SIRun, unloaded: Mechanism) -> "ModelledRun":
        """From a run's encoders. Raises AnalysisError where it has none, or the loops do not close."""
        columns, group = run.rig.columns_of(Encoder), group_of_encoders(run)
        time = run.instants(columns[0])
        fine, gaps = grid_of(time, f"{run.name}: encoders", bridged=True), encoder_gaps(run)
        # The grid of RATE_HZ, or the finer one where that has fewer samples, over the same time.
        step = max(1.0 / RATE_HZ, fine.step)
        coarse = Grid(fine.start, step, int((fine.count - 1) * fine.step / step + 1e-9) + 1)
        if coarse.count < LEAST_SAMPLES:
            raise AnalysisError(f"{run.name}: {coarse.count} samples of {RATE_HZ:g} Hz are too few to compare")
        cutoff = min(POSITION_HZ, HIGHEST_CUTOFF * fine.rate, HIGHEST_CUTOFF * coarse.rate)
        if cutoff < BAND_HZ:
            raise AnalysisError(
                f"{run.name}: encoders at {fine.rate:.4g} samples per second do not show {BAND_HZ:g} Hz"
            )
        whole = bridge_gaps(time, run.stacked(columns), fine.step)
        position = np.column_stack(
            [np.interp(coarse.time, fine.time, v) for v in low_pass(on_grid(*whole, fine), cutoff, fine.rate).T]
        )
        moved = smoothed_derivatives(position, cutoff, coarse.rate)
        samples = Samples(coarse.time, moved.q, moved.v, moved.a, tuple(column.component for column in columns))
        mechanism = loaded_mechanism(run, unloaded)
        path = Closure(unloaded).follow(samples)
        valid = gaps.valid_samples(coarse, gap_reach(BAND_HZ))
        edge = round(EDGE_S * coarse.rate)
        valid[:edge] = valid[len(valid) - edge :] = False
        return cls(run, unloaded, mechanism, group, coarse, fine, cutoff, path, valid)

    def smooth(self, values: Floats) -> Floats:
        """Values (n, ...) on the grid below BAND_HZ, (n, ...)."""
        return low_pass(values, BAND_HZ, self.grid.rate)

    @property
    def _payload_body(self) -> str:
        if not self.unloaded.payload_bodies:
            raise ModelError(f"{self.unloaded.name} names no payload body, whose path and torques would show it")
        return self.unloaded.payload_body

    @cached_property
    def place(self) -> Floats:
        """Path of the payload's centre, base axes, (n, 3) [m]. Raises ModelError without one payload body."""
        body = self._payload_body
        return point_path(self.unloaded, self.path, self.unloaded.body_index(body), self.unloaded.centre(body))

    def torque_columns(self, base: Floats | None) -> dict[str, Floats]:
        """Torques of the driven joints (n, joints) [N m, N] per what is mounted.

        ``model``: links and what else the file holds, without payload; ``payload``: per kg of it; by site: per kg of a
        counter-mass; ``base``: what all that the run table states adds as the base accelerates, ``base`` (n, 3) [m/s2].
        """
        mechanism, path = self.unloaded, self.path
        rates = driven_rates(mechanism, path.per_drive, mechanism.driven)
        body = self._payload_body
        masses = {"payload": mechanism.with_payload({body: 2.0}).pi - mechanism.with_payload({body: 1.0}).pi}
        masses |= {s: mechanism.with_counter_mass({s: 1.0}).pi - mechanism.pi for s in mechanism.counter_sites}
        masses["model"] = mechanism.with_payload({body: 1.0}).pi - masses["payload"]
        pi = np.column_stack(list(masses.values()))
        torque = driven_torque_regressor(mechanism, path.q, path.v, path.a, rates) @ pi
        found, still = dict(zip(masses, np.moveaxis(torque, 2, 0), strict=True)), np.zeros_like(path.v)
        found["base"] = np.zeros(torque.shape[:2])
        for axis, moved in enumerate(() if base is None else base.T):
            pull = replace(mechanism, gravity=np.eye(3)[axis])
            weight = driven_torque_regressor(pull, path.q, still, still, rates) @ self.mechanism.pi
            found["base"] -= moved[:, None] * weight
        return found

    @cached_property
    def loads(self) -> Loads:
        """Shaking wrench and torques of the drives, the base at rest."""
        return simulate(self.mechanism, self.path)

    @cached_property
    def wrench(self) -> Floats:
        """Shaking wrench about the base frame's origin, (n, 6) [N, N m]."""
        return np.hstack([self.loads.force, self.loads.moment])

    @cached_property
    def base(self) -> BaseMotion:
        """Motion of the base as the rig's ``[bench]`` describes it."""
        stand = self.run.rig.bench.elastic(locked_inertia(self.mechanism, self.path.q[0]))
        return stand.respond(self.wrench, self.grid.step)

    def expected_readings(self, group: str) -> list[tuple[list[Column], Floats]]:
        """What the sensors of a group should show: the channels of each and their expected values (n, k) [SI]."""
        run, found = self.run, []
        rig, wrench = run.rig, self.wrench
        for name, sensor in rig.of_kind(Accelerometer).items():
            columns = _recorded(run, list(sensor.columns(name)), group)
            if not columns:
                continue
            point = np.array(sensor.position)
            if sensor.attached_to != "base":
                still = np.zeros((self.grid.count, 6))
                mounted = self.unloaded.anchor(sensor.attached_to, point)
                values = acceleration_in_body(self.unloaded, self.path, still, mounted)
            elif rig.bench.is_stated:
                values = self.base.acceleration_at(point)
            else:
                continue
            found.append((columns, values[:, [AXES.index(c.component) for c in columns]]))
        for name, share in support_wrenches(rig.supports).items():
            support = rig.supports[name]
            columns = _recorded(run, list(support.columns(name)), group)
            if len(columns) == len(support.measured):
                loads = (wrench @ share.T)[:, [COMPONENTS.index(m) for m in support.measured]]
                if support.crosstalk is not None and not run.has_matrix(columns[0]):
                    loads = loads @ np.array(support.crosstalk).T
                found.append((columns, loads))
        drives = _recorded(run, [c for c in rig.columns_of(Torque) if c.component in self.loads.torque], group)
        if drives:
            found.append((drives, np.column_stack([self.loads.torque[c.component] for c in drives])))
        commanded = _recorded(run, rig.columns_of(Target), group)
        if commanded and len(self.unloaded.payload_bodies) == 1:
            moved = np.gradient(np.gradient(self.place, self.grid.step, axis=0), self.grid.step, axis=0)
            found.append((commanded, moved[:, [AXES.index(c.component) for c in commanded]]))
        return [(columns, self.smooth(values)) for columns, values in found]


def _recorded(run: SIRun, columns: list[Column], group: str) -> list[Column]:
    return columns if all(run.holds(column, group) for column in columns) else []
