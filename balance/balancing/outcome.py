"""What a way of balancing leaves and costs on a motion."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ..arrays import Floats
from ..dynamics.inverse_dynamics import Response


@dataclass(frozen=True)
class Outcome:
    """Residual force and moment, drive torque, and what was added."""

    name: str
    force: Floats
    """Shaking force that is left, base axes, weight excluded, (n, 3) [N]."""
    moment: Floats
    """Shaking moment about the base's origin that is left, (n, 3) [N m]."""
    torque: Mapping[str, Floats]
    """Torque of each motor, all that it drives included, (n,) [N m]."""
    added_mass: float = 0.0
    """[kg]"""
    added_inertia: float = 0.0
    """About the axes of the bodies that carry it [kg m2]."""
    needs: Mapping[str, float] = field(default_factory=dict)
    """What else the method asks for, unit in the name."""
    note: str = ""
    """How it is built, or what it leaves and why."""

    @classmethod
    def of(cls, name: str, response: Response, mass: float = 0.0, inertia: float = 0.0, note: str = "") -> "Outcome":
        """A mechanism's own response."""
        return cls(name, response.force, response.moment, response.torque, mass, inertia, {}, note)

    @property
    def force_rms(self) -> float:
        """Root mean square of the force's size [N]."""
        return _rms(np.linalg.norm(self.force, axis=1))

    @property
    def force_peak(self) -> float:
        """Largest size of the force [N]."""
        return float(np.linalg.norm(self.force, axis=1).max())

    @property
    def moment_rms(self) -> float:
        """Root mean square of the moment's size [N m]."""
        return _rms(np.linalg.norm(self.moment, axis=1))

    @property
    def moment_peak(self) -> float:
        """Largest size of the moment [N m]."""
        return float(np.linalg.norm(self.moment, axis=1).max())

    def torque_rms(self) -> dict[str, float]:
        """Root mean square of each motor's torque [N m]."""
        return {joint: _rms(values) for joint, values in self.torque.items()}

    def torque_peak(self) -> dict[str, float]:
        """Largest size of each motor's torque [N m]."""
        return {joint: float(np.abs(values).max()) for joint, values in self.torque.items()}


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))
