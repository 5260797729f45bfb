"""Two independent engines, MuJoCo and Pinocchio, as referees of wrench and torque on the same MJCF."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping

import mujoco
import numpy as np
import pinocchio

from balance.arrays import Floats
from balance.closure import Closure, Trajectory
from balance.mechanism.mechanism import Mechanism
from balance.motion import Samples
from balance.motion.driven_coordinates import Drive


def random_motion(mechanism: Mechanism, count: int = 24, seed: int = 7) -> Trajectory:
    """Random loop-consistent states: positions of a walk, rates and second rates of the driven joints at random."""
    closure, rng = Closure(mechanism), np.random.default_rng(seed)
    joints = mechanism.driven or mechanism.coordinates
    position = Drive.of_joints(mechanism, joints).value(closure.engine, closure.states(count, seed).T).T
    rate, rate_of_rate = 3.0 * rng.normal(size=position.shape), 40.0 * rng.normal(size=position.shape)
    return closure.follow(Samples(np.arange(float(count)), position, rate, rate_of_rate, joints=joints))


def with_loads(
    text: str, payload: Mapping[str, float], counters: Mapping[str, float], gyration: Mapping[str, float]
) -> str:
    """The same loads written into the file: masses of bodies set, discs mounted at sites as bodies of their own."""
    root = ElementTree.fromstring(text)
    for body in list(root.iter("body")):
        own = body.find("inertial")
        if body.get("name") in payload:
            ratio = payload[body.get("name")] / float(own.get("mass"))
            own.set("mass", repr(payload[body.get("name")]))
            own.set("diaginertia", " ".join(repr(ratio * float(x)) for x in own.get("diaginertia").split()))
        for site in body.findall("site"):
            if mass := counters.get(site.get("name")):
                k2 = mass * gyration.get(site.get("name"), 0.0) ** 2
                disc = ElementTree.SubElement(body, "body", name=f"disc_{site.get('name')}", pos=site.get("pos"))
                inertia = f"{k2 / 2!r} {k2 / 2!r} {k2!r}"
                ElementTree.SubElement(disc, "inertial", pos="0 0 0", mass=repr(mass), diaginertia=inertia)
    return ElementTree.tostring(root, encoding="unicode")


class MujocoReferee:
    """MuJoCo's inverse dynamics with its soft constraints off, loops by its own kinematics.

    Dry friction is one of the constraints: it is added here.
    """

    def __init__(self, text: str, mechanism: Mechanism) -> None:
        self.model = mujoco.MjModel.from_xml_string(text)
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        self.data = mujoco.MjData(self.model)
        names = [self.model.joint(i).name for i in range(self.model.njnt)]
        self.order = [names.index(name) for name in mechanism.coordinates]
        self.driven = [mechanism.coordinates.index(joint) for joint in mechanism.driven or mechanism.coordinates]
        self.gravity = self.model.opt.gravity.copy()

    def response(self, q: Floats, v: Floats, a: Floats) -> tuple[Floats, Floats]:
        """Shaking wrench (6,) [N, N m] and torques of the driven joints [N m, N] at one state."""
        torque = self._inverse(q, v, a, self.gravity) + self.model.dof_frictionloss[self.order] * np.sign(v)
        self._inverse(q, v, a, np.zeros(3))
        mujoco.mj_rnePostConstraint(self.model, self.data)
        on_mechanism = self.data.cfrc_int[1]
        force, centre = -on_mechanism[3:], self.data.subtree_com[self.model.body_rootid[1]]
        return np.r_[force, np.cross(centre, force) - on_mechanism[:3]], self.allowed(q).T @ torque

    def _inverse(self, q: Floats, v: Floats, a: Floats, gravity: Floats) -> Floats:
        self.model.opt.gravity[:] = gravity
        self.data.qpos[self.order], self.data.qvel[self.order], self.data.qacc[self.order] = q, v, a
        mujoco.mj_inverse(self.model, self.data)
        return self.data.qfrc_inverse[self.order].copy()

    def allowed(self, q: Floats) -> Floats:
        """Rates of all coordinates per rate of the driven ones, from MuJoCo's Jacobians, (nv, dof)."""
        rows = self.loop_jacobian(q)
        if not len(rows):
            return np.eye(len(self.order))
        _, size, directions = np.linalg.svd(rows)
        free = directions[int((size > 1e-8 * size[0]).sum()) :].T
        return free @ np.linalg.inv(free[self.driven])

    def loop_jacobian(self, q: Floats, dot: Floats | None = None) -> Floats:
        """Jacobian of all site loops, or its rate at velocity ``dot``, (rows, nv)."""
        self.data.qpos[self.order] = q
        self.data.qvel[self.order] = 0.0 if dot is None else dot
        mujoco.mj_forward(self.model, self.data)
        blocks = []
        for k in range(self.model.neq):
            first, second = (self._point(site, dot) for site in self._sites(k))
            weld = self.model.eq_type[k] == mujoco.mjtEq.mjEQ_WELD
            blocks.append((first - second)[: 6 if weld else 3])
        return np.concatenate([np.empty((0, len(q))), *blocks])[:, self.order] if blocks else np.empty((0, len(q)))

    def _sites(self, k: int) -> tuple[int, int]:
        return int(self.model.eq_obj1id[k]), int(self.model.eq_obj2id[k])

    def _point(self, site: int, dot: Floats | None) -> Floats:
        turning, moving = np.zeros((3, self.model.nv)), np.zeros((3, self.model.nv))
        point, body = self.data.site_xpos[site], self.model.site_bodyid[site]
        compute = mujoco.mj_jac if dot is None else mujoco.mj_jacDot
        compute(self.model, self.data, moving, turning, point, body)
        return np.concatenate([moving, turning])

    def gap(self, q: Floats) -> float:
        """How far MuJoCo finds the loops' sites apart [m]."""
        self.data.qpos[self.order] = q
        mujoco.mj_kinematics(self.model, self.data)
        at = self.data.site_xpos
        gaps = [np.abs(at[a] - at[b]).max() for a, b in map(self._sites, range(self.model.neq))]
        return max(gaps, default=0.0)


def pinocchio_response(mechanism: Mechanism, trajectory: Trajectory) -> tuple[Floats, Floats]:
    """Shaking wrench (n, 6) and joint torques of the open tree (n, nv) by Pinocchio's rnea, a sample at a time."""
    model = mechanism.pinocchio_model()
    data, gravity = model.createData(), model.gravity.linear.copy()
    wrench, torque = np.empty((len(trajectory.q), 6)), np.empty_like(trajectory.q)
    for k, (q, v, a) in enumerate(zip(trajectory.q, trajectory.v, trajectory.a, strict=True)):
        model.gravity.linear = gravity
        losses = model.damping * v + mechanism.coulomb * np.sign(v)
        torque[k] = pinocchio.rnea(model, data, q, v, a) + losses
        model.gravity.linear = np.zeros(3)
        pinocchio.forwardKinematics(model, data, q, v, a)
        pinocchio.rnea(model, data, q, v, a)
        roots = [i for i in range(1, model.njoints) if model.parents[i] == 0]
        wrench[k] = -sum(data.oMi[i].act(data.f[i]).vector for i in roots)
    return wrench, torque


def pinocchio_energy(mechanism: Mechanism, trajectory: Trajectory) -> Floats:
    """Kinetic and potential energy along a trajectory by Pinocchio, (n,) [J]."""
    model = mechanism.pinocchio_model()
    data = model.createData()
    return np.array(
        [
            pinocchio.computeKineticEnergy(model, data, q, v) + pinocchio.computePotentialEnergy(model, data, q)
            for q, v in zip(trajectory.q, trajectory.v, strict=True)
        ]
    )


def relative(mine: Floats, other: Floats) -> float:
    """Largest difference over the largest value of the other."""
    return float(np.abs(np.asarray(mine) - other).max() / np.abs(other).max())
