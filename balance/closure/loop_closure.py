"""Closing a mechanism's loops: its degrees of freedom, closed configurations, and whole trajectories.

Loops of planar and parallelogram mechanisms are redundant: a fixed set of independent rows is solved, all are checked.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from ..arrays import Floats, Indices
from ..errors import ClosureError
from ..mechanism.loop_constraints import Coupling, Loop
from ..mechanism.mechanism import Mechanism
from ..mechanism.pinocchio_engine import PinocchioEngine
from ..motion import Samples
from ..motion.driven_coordinates import Drive
from .assembly import CLOSED_LIMIT, RANK_LIMIT, Configuration, nearest_closed, starts
from .newton import LoopSystem, loop_scales
from .trajectory import Trajectory, follow

FAR = 0.2
"""How far a configuration of a file may be from closed before the name of its branch says so [rad, m]."""
_FURTHER_STARTS = 4
"""Starts that are tried where the loops do not close from the file's configuration."""
_STARTS = 60
"""Random starts from which assembly branches are sought."""
_SAME = 1e-4
"""Distance up to which two configurations are one [rad, m]."""


class Closure:
    """Closes a mechanism's loops.

    ``home`` (nv,) [rad, m] is the closed configuration at its keyframe, ``rows`` the independent constraint rows,
    ``dof`` the degrees of freedom, ``length`` [m] a length of the mechanism, ``scales`` (nv,) that of a slide and 1 rad
    of what turns, ``engine`` its Pinocchio model with data.
    """

    def __init__(self, mechanism: Mechanism, search: bool = False) -> None:
        """Close the home configuration. Raises ClosureError if that cannot be done, or if it is singular.

        With ``search``, what closes only from other starts than the file's configuration is closed from one of them.
        """
        self.mechanism = mechanism
        self._fixed: dict[tuple[str, ...], Closure] = {}
        self.engine = PinocchioEngine(mechanism)
        # A length of the mechanism: the largest distance within a body, from its joint to other joints and sites [m].
        # Where a slide stands is none, nor where the base frame has its origin.
        places = [(joint.parent, joint.position) for joint in mechanism.tree.joints if joint.revolute]
        places += [(site.body, site.position) for site in mechanism.sites.values()]
        steps = [np.linalg.norm(place) for parent, place in places if parent >= 0]
        base = np.array([place for parent, place in places if parent < 0]).reshape(-1, 3)
        steps += [np.linalg.norm(base - place, axis=1).max() for place in base]
        self.length = float(max(steps, default=0.0)) or 1.0
        self.scales = np.where(self.engine.turning, 1.0, self.length)
        self.home = self._closed_home(search)
        self.rows = independent_rows(self._jacobians(self.home[None])[0])
        self.dof = mechanism.tree.size - len(self.rows)
        near = self._near_home()
        if near is not None and len(independent_rows(self._jacobians(near[None])[0])) > len(self.rows):
            name, branch = self.mechanism.name, self.mechanism.branch
            raise ClosureError(
                f"{name} is singular at {branch!r}: its branches meet there; give another closed configuration as "
                "<keyframe><key name='home' qpos='...'/>, of a URDF as home in its YAML file"
            )

    @cached_property
    def idle(self) -> tuple[str, ...]:
        """Coordinates of the idle freedoms, one each: those that move no centre of mass while the motors stand still.

        Such as a rod that spins about the line through its two ball joints; a wheel on a bearing is none. None where
        every freedom would be one.
        """
        found = self._idle(Drive.of_joints(self.mechanism, self.mechanism.driven))
        return found if len(found) < self.dof else ()

    def without_idle(self) -> "Closure":
        """The same with its idle freedoms fixed as at home; itself where there are none."""
        return self._with_fixed(self.idle)

    def follow(self, samples: Samples, drive: Drive | None = None, near: Trajectory | None = None) -> Trajectory:
        """Close the mechanism at every sample of a motion of its driven coordinates.

        ``near`` is a trajectory of as many samples close by, from which each is closed at once, without continuation.
        Raises ClosureError, naming the time, where it cannot be closed, is singular, or changes its branch.
        """
        samples.check()
        drive = drive or samples.drive(self.mechanism)
        if drive.size != self.dof:
            idle = self._idle(drive)
            if drive.size + len(idle) == self.dof:
                return replace(self._with_fixed(idle).follow(samples, drive, near), idle=idle)
            free = [name for name in self._free(drive) if name not in idle]
            raise ClosureError(
                f"{self.mechanism.name} has {self.dof} degree{'s' * (self.dof != 1)} of freedom"
                f"{', idle ' + ', '.join(idle) if idle else ''}, but the motion drives {drive.size}: "
                f"{', '.join(drive.names)}{'; nothing moves ' + ', '.join(free) if free else ''}"
            )
        if not self.mechanism.loops and drive.point is None:
            order = np.argsort(drive.indices)
            q, v, a = (
                np.ascontiguousarray(x[:, order]) for x in (samples.position, samples.velocity, samples.acceleration)
            )
            per_drive = np.broadcast_to(np.eye(drive.size)[:, list(drive.indices)], (len(q), drive.size, drive.size))
            return Trajectory(self.mechanism.name, samples.time, q, v, a, per_drive, 0.0, 1.0, self.mechanism.branch)
        system = LoopSystem(self.mechanism, self.engine, self.home, self.length, self.scales, drive)
        return follow(system, samples, near)

    def states(self, count: int, seed: int = 0, step: float = 0.15) -> Floats:
        """Closed configurations of the home branch, well apart from singular ones, (count, nv) [rad, m].

        A random walk that keeps its heading: tangent steps of ``step`` [rad, lengths of the mechanism], each projected
        back, refused near a singularity.
        """
        rng = np.random.default_rng(seed)
        reach = 0.2 * self._singular_values(self.home[None])[0]
        q, found, heading = self.home, [self.home], np.zeros_like(self.home)
        for _ in range(40 * count):
            if len(found) == count:
                return np.array(found)
            tangent = self.tangents(q[None])[0] / self.scales[:, None]
            heading = tangent @ (tangent.T @ heading + 0.5 * rng.normal(size=tangent.shape[1]))
            heading /= max(float(np.linalg.norm(heading)), 1e-12)
            trial = self._stepped(q, step * heading)
            if trial is None or self._singular_values(trial[None])[0] < reach:
                heading = -heading
                continue
            q = trial
            found.append(q)
        raise ClosureError(f"{self.mechanism.name} has no room to move about {self.mechanism.branch!r}")

    def _near_home(self) -> Floats | None:
        """A closed configuration in general position near home, (nv,) [rad, m]; None where there is none."""
        return self._stepped(self.home, 0.02 * self.velocities(self.home[None])[0] / self.scales)

    def _stepped(self, q: Floats, step: Floats) -> Floats | None:
        """The closed configuration a ``step`` (nv,) [rad, lengths of the mechanism] from ``q``; None where it is not
        near."""
        trial, residual = nearest_closed(self.engine, q + step * self.scales, self.length)
        far = np.linalg.norm((trial - q) / self.scales) >= 2 * np.linalg.norm(step)
        return None if far or residual > CLOSED_LIMIT * self.length else trial

    def velocities(self, q: Floats, seed: int = 0) -> Floats:
        """Random velocities that the loops allow at closed configurations ``q``, (n, nv) [rad/s, m/s]."""
        sizes = np.random.default_rng(seed).normal(size=(len(q), self.dof))
        return np.asarray(np.einsum("nij,nj->ni", self.tangents(q), sizes))

    def tangents(self, q: Floats) -> Floats:
        """Directions that the loops allow at closed configurations ``q`` (n, nv), (n, nv, dof) [rad, m].

        Orthonormal in units of ``scales``, so that metres and millimetres give the same.
        """
        free = np.linalg.svd(self._jacobians(q))[2][:, len(self.rows) :].transpose(0, 2, 1)
        return np.asarray(free * self.scales[:, None])

    def rays(self, headings: Floats, step: float, travel: float) -> Floats:
        """Closed configurations on ways from home that start along ``headings`` (k, nv), (n, nv) [rad, m].

        At the middles of steps of ``step`` of the fastest joint, up to ``travel`` [rad, lengths of the mechanism]; each
        heading is the one before, projected. A way ends at a joint's limit, or where loops are five times nearer to
        singular than at home. They do not depend on the order of joints, bodies and loops. Home alone if there is none.
        """
        headings, scale = headings / self.scales, self.scales
        low, high = self.mechanism.limits.T
        reach = 0.2 * self._singular_values(self.home[None])[0]
        q, found = np.tile(self.home, (len(headings), 1)), list[Floats]()
        for length in [0.5 * step, *[step] * (round(travel / step) - 1)]:
            tangents = self.tangents(q) / scale[:, None]
            headings = np.einsum("nid,nd->ni", tangents, np.einsum("njd,nj->nd", tangents, headings))
            fastest = np.abs(headings).max(axis=1)
            q, headings, fastest = (x[fastest > RANK_LIMIT] for x in (q, headings, fastest))
            ahead = length * headings / fastest[:, None]
            near = [nearest_closed(self.engine, one, self.length) for one in q + ahead * scale]
            trial = np.array([one for one, _ in near]).reshape(q.shape)
            closed = np.array([gap for _, gap in near]) <= CLOSED_LIMIT * self.length
            far = np.linalg.norm((trial - q) / scale, axis=1) > 2.0 * np.linalg.norm(ahead, axis=1)
            inside = ((trial >= low) & (trial <= high)).all(axis=1)
            stays = closed & ~far & inside & (self._singular_values(trial) >= reach)
            q, headings = trial[stays], ((trial - q) / scale)[stays]
            found.append(q)
        states = np.concatenate(found)
        return states if len(states) else self.home[None]

    def _singular_values(self, q: Floats) -> Floats:
        """Smallest of those that redundancy leaves, of all rows, at configurations (n, nv), (n,)."""
        rank = len(self.rows)
        return np.linalg.svd(self._jacobians(q), compute_uv=False)[:, rank - 1] if rank else np.full(len(q), np.inf)

    def _jacobians(self, q: Floats) -> Floats:
        """Of the loops, (n, rows, nv), at configurations (n, nv), in the scales of rows and coordinates [-]."""
        rows = loop_scales(self.mechanism, self.scales, self.length)[:, None]
        found = [self.engine.constraint_jacobian(state) * self.scales / rows for state in q]
        return np.array(found).reshape(len(q), len(rows), q.shape[1])

    def _idle(self, drive: Drive) -> tuple[str, ...]:
        """Coordinates of the freedoms that move neither ``drive``, nor a centre of mass, nor a counter-mass's site.

        Of what loops hold: a wheel that turns freely about its centre would be turned with what it is mounted on.
        """
        model, bodies, joints = self.mechanism, self.mechanism.tree.bodies, self.mechanism.tree.joints
        ends = [end.joint for loop in model.loops if isinstance(loop, Loop) for end in (loop.first, loop.second)]
        held = set[int]()
        while ends := [joint for joint in ends if joint >= 0]:
            held.update(ends)
            ends = [joints[joint].parent for joint in ends]
        places = [(joint, row[1:4] / row[0]) for joint, row in zip(bodies, model.parameters, strict=True) if row[0] > 0]
        places += [
            (bodies[site.body], site.position) for site in map(model.site, model.counter_sites) if site.body >= 0
        ]
        return self._free(drive, places, [k for k in range(len(joints)) if k not in held])

    def _free(
        self, drive: Drive, places: Sequence[tuple[int, Floats]] = (), still: Sequence[int] = ()
    ) -> tuple[str, ...]:
        """Coordinates that can move with ``drive``, ``places``, points of joints' frames [m], and others ``still``.

        One for each freedom that is there at home and near it too.
        """
        if drive.size >= self.dof:
            return ()

        def directions(q: Floats) -> Floats:
            fixed = [self.engine.point(q, *place)[1] / self.length for place in places]
            rates = drive.rates(self.engine, q) / drive.scales(self.scales, self.length)[:, None]
            rows = np.concatenate([rates, *fixed]) * self.scales
            others = self._jacobians(q[None])[0][self.rows], np.eye(len(q))[list(still)]
            _, sizes, turned = np.linalg.svd(np.concatenate([rows, *others]))
            return turned[int((sizes > RANK_LIMIT * sizes.max(initial=0.0)).sum()) :].T

        found, near = directions(self.home), self._near_home()
        if not found.shape[1] or near is None or directions(near).shape != found.shape:
            return ()
        return tuple(self.mechanism.coordinates[k] for k in independent_rows(found))

    def _with_fixed(self, names: tuple[str, ...]) -> "Closure":
        """The same with some coordinates fixed as at home."""
        if names and names not in self._fixed:
            at = {name: self.mechanism.coordinate_index(name) for name in names}
            ties = [Coupling(name, k, None, np.zeros(5), (float(self.home[k]), 0.0)) for name, k in at.items()]
            self._fixed[names] = Closure(replace(self.mechanism, home=self.home, loops=(*self.mechanism.loops, *ties)))
        return self._fixed[names] if names else self

    def residual(self, q: Floats) -> Floats:
        """Largest loop residual over all rows, (n,) [m, rad], at the configurations ``q`` (n, nv) [rad, m]."""
        return np.array([np.abs(self.engine.constraint_residual(state)).max(initial=0.0) for state in q])

    def configurations(self) -> list[Configuration]:
        """The closed configurations with the driven coordinates as at home, or as many others that leave no freedom.

        Home is A. They are sought from random starts, so that one may be missed; each was found, and differs.
        """
        home, turning, fixed = self.home, self.engine.turning, self.independent_coordinates()
        free = np.setdiff1d(np.arange(len(home)), fixed)
        found = [(0.0, home, float(self.residual(home[None])[0]))]
        for start in starts(self.mechanism, self.length, _STARTS) if len(free) else ():
            start[fixed] = home[fixed]
            q, residual = nearest_closed(self.engine, start, self.length, free)
            if residual > CLOSED_LIMIT * self.length:
                continue
            q = q - 2 * np.pi * np.round((q - home) / (2 * np.pi)) * turning
            apart = q - np.array([other for _, other, _ in found])
            apart = np.where(turning, np.remainder(apart + np.pi, 2 * np.pi) - np.pi, apart)
            if (np.abs(apart).max(axis=1) > _SAME).all():
                found.append((float(np.abs(q - home).max()), q, residual))
        found.sort(key=lambda one: one[0])
        return [
            Configuration(chr(ord("A") + k % 26) + (str(k // 26) if k >= 26 else ""), q, residual, far)
            for k, (far, q, residual) in enumerate(found)
        ]

    def independent_coordinates(self) -> Indices:
        """Indices of the driven coordinates, or of as many others that leave no freedom, (dof,)."""
        mechanism = self.mechanism
        fixed = np.array([mechanism.coordinate_index(name) for name in mechanism.driven], dtype=np.intp)
        free = self.tangents(self.home[None])[0] / self.scales[:, None]
        rates = np.linalg.svd(free[fixed], compute_uv=False)
        if len(fixed) != self.dof or not (rates > RANK_LIMIT * np.linalg.norm(free, axis=1).max(initial=0.0)).all():
            fixed = independent_rows(free)
        return fixed

    def _closed_home(self, search: bool) -> Floats:
        """The closed configuration nearest to that of the file; with ``search``, else nearest to a start around it."""
        model, limit = self.mechanism, CLOSED_LIMIT * self.length
        home, residual = nearest_closed(self.engine, model.home, self.length)
        if residual > limit:
            others = (nearest_closed(self.engine, q, self.length) for q in starts(model, self.length, _FURTHER_STARTS))
            elsewhere = next((q for q, gap in others if gap <= limit), None)
            if elsewhere is None or not search:
                cure = "" if elsewhere is None else "; from other starts they close: balance assemble lists where"
                raise ClosureError(
                    f"{model.name} cannot be closed from {model.branch!r}: the loops "
                    f"({', '.join(loop.name for loop in model.loops)}) stay {residual:.3g} m apart{cure}"
                )
            home = elsewhere
        far = float(np.abs(home - model.home).max(initial=0.0))
        if far > FAR:
            self.mechanism = replace(model, branch=f"{model.branch}, closed {far:.3g} rad or m from it")
        return home


def independent_rows(matrix: Floats) -> Indices:
    """Indices (rank,) of a largest set of independent rows of ``matrix`` (rows, nv) [-, m].

    Rows are taken largest first, and their directions removed from the others (Gram-Schmidt with pivoting).
    """
    rest, chosen = matrix.copy(), np.empty(0, dtype=np.intp)
    largest = np.linalg.norm(rest, axis=1).max(initial=0.0)
    while len(chosen) < min(matrix.shape):
        size = np.linalg.norm(rest, axis=1)
        best = int(np.argmax(size))
        if not size[best] > RANK_LIMIT * largest:
            break
        direction = rest[best] / size[best]
        rest -= np.outer(rest @ direction, direction)
        rest[best] = 0.0
        chosen = np.append(chosen, best)
    return np.sort(chosen)
