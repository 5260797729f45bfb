"""MuJoCo as the referee of a mechanism on a moving base: nonlinear, spatial, with a free joint under the base."""

import xml.etree.ElementTree as ElementTree

import mujoco
import numpy as np

from balance import datasets
from balance.dynamics.inverse_dynamics import driven_rates
from testbench.rig import Rig
from testbench.simulator.run import BenchRun

KEPT = ("mass", "pos", "diaginertia")


def model_text(rig: Rig, payload: float, masses: dict[str, float]) -> str:
    """The manipulator's own file with a free base, payload, counter-masses in their planes, and rotors."""
    root = ElementTree.fromstring((datasets.ROOT / "mechanisms" / "parallelogram-6bar.xml").read_text("utf-8"))
    for part in ("keyframe", "actuator", "equality"):
        root.remove(root.find(part))
    bench, base = rig.bench, root.find("worldbody/body")
    ElementTree.SubElement(base, "freejoint", name="free")
    _inertial(base, bench.mass, bench.centre, bench.inertia)
    for body in list(base.iter("body"))[1:]:
        own = body.find("inertial")
        if body.get("name") == "platform":
            ratio = payload / float(own.get("mass"))
            own.set("diaginertia", " ".join(repr(ratio * float(x)) for x in own.get("diaginertia").split()))
            own.set("mass", repr(payload))
        x, y, z = (float(v) for v in own.get("pos").split())
        own.set("pos", f"{x!r} {y!r} {z + bench.planes.get(body.get('name'), 0.0)!r}")
        for site in body.findall("site"):
            if mass := masses.get(site.get("name")):
                x, y, z = (float(v) for v in site.get("pos").split())
                disc = ElementTree.SubElement(
                    body, "body", pos=f"{x!r} {y!r} {z + bench.planes.get(site.get('name'), 0.0)!r}"
                )
                k2 = mass * 0.06**2
                _inertial(disc, mass, (0, 0, 0), (k2 / 2, k2 / 2, k2))
    for joint, rotor in bench.rotors.items():
        body = ElementTree.SubElement(base, "body", name=f"rotor_{joint}")
        axis = " ".join(str(x) for x in rotor.axis)
        ElementTree.SubElement(body, "joint", name=f"rotor_{joint}", type="hinge", axis=axis)
        _inertial(body, 1e-9, (0, 0, 0), (rotor.inertia,) * 3)
    return ElementTree.tostring(root, encoding="unicode")


def _inertial(body, mass, centre, inertia):
    values = zip(KEPT, ((mass,), centre, inertia), strict=True)
    ElementTree.SubElement(body, "inertial", {key: " ".join(repr(float(x)) for x in v) for key, v in values})


class FreeBase:
    """Inverse dynamics along a run: what the mounts must give, and what the motors must."""

    def __init__(self, rig: Rig, run: BenchRun, payload: float, masses: dict[str, float], gravity) -> None:
        self.rig, self.run = rig, run
        self.model = mujoco.MjModel.from_xml_string(model_text(rig, payload, masses))
        self.model.opt.gravity[:] = gravity
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        self.data = mujoco.MjData(self.model)

    def linear(self, samples) -> tuple[np.ndarray, np.ndarray]:
        """The loads to first order in the base's motion: half the difference of there and back, and those at rest."""
        there, back, still = (self.loads(samples, share) for share in (1.0, -1.0, 0.0))
        return tuple(0.5 * (a - b) + c for a, b, c in zip(there, back, still, strict=True))

    def loads(self, samples, share: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
        """Wrench on base and mechanism about the base's origin, world axes, (k, 6), and drive torques, (k, dof).

        ``share``: of the base's motion; 0 as if it stood still.
        """
        run, m = self.run, self.run.motion
        rates = driven_rates(run.mechanism, run.trajectory.per_drive, tuple(run.response.torque))
        wrenches, torques = [], []
        for i in samples:
            x, v, a = (share * s[i] for s in (m.displacement, m.velocity, m.acceleration))
            force = self._inverse(x, v, a, i)
            wrenches.append(np.r_[force[:3], self._turned(x, force[3:6])])
            joints = np.array([force[self._dof(name)] for name in run.mechanism.coordinates])
            torques.append(rates[i].T @ joints + self._rotor_torques(force, tuple(run.response.torque)))
        return np.array(wrenches), np.array(torques)

    def _inverse(self, x, v, a, i):
        """Small turns: rate and second rate of the rotation vector are those of the base."""
        angle = np.linalg.norm(x[3:])
        axis = x[3:] / angle if angle else np.array([1.0, 0.0, 0.0])
        d = self.data
        d.qpos[:3], d.qvel[:6], d.qacc[:6] = x[:3], v, a
        mujoco.mju_axisAngle2Quat(d.qpos[3:7], axis, angle)
        path = self.run.trajectory
        for k, name in enumerate(self.run.mechanism.coordinates):
            self._set(name, path.q[i, k], path.v[i, k], path.a[i, k])
            if rotor := self.rig.bench.rotors.get(name):
                self._set(f"rotor_{name}", *(rotor.ratio * s[i, k] for s in (path.q, path.v, path.a)))
        mujoco.mj_inverse(self.model, d)
        return d.qfrc_inverse.copy()

    def _turned(self, x, vector):
        """From the base's axes to the world's."""
        return vector + np.cross(x[3:], vector)

    def _dof(self, name: str) -> int:
        return int(self.model.joint(name).dofadr[0])

    def _set(self, name: str, q: float, v: float, a: float) -> None:
        joint = self.model.joint(name)
        self.data.qpos[joint.qposadr[0]], self.data.qvel[joint.dofadr[0]], self.data.qacc[joint.dofadr[0]] = q, v, a

    def _rotor_torques(self, force, driven):
        rotors = self.rig.bench.rotors
        return np.array([rotors[j].ratio * force[self._dof(f"rotor_{j}")] if j in rotors else 0.0 for j in driven])
