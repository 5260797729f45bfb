"""What the bench that a run's rig describes would show in the run's conditions: simulated anew, without noise."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from balance import datasets
from balance.arrays import Floats
from balance.loading.loading import load_mechanism
from balance.mechanism import Mechanism
from balance.quantities import G0

from .bench.run import BenchRun, simulate_run
from .bench.sampling import instants
from .bench.sensors import base_acceleration
from .errors import AnalysisError
from .plan import PlannedRun
from .reductions import percent
from .vibration import Measure

if TYPE_CHECKING:
    from .pairing import Pair
    from .rig import Rig

NOTHING = 1e-9
"""Amplitude below which a computed signal counts as zero [m/s2, N]."""


@dataclass
class Prediction:
    """Reductions that a rig and a mechanism lead to; each condition is simulated once."""

    rig: "Rig"
    mechanism: Mechanism
    measure: Measure
    _done: dict[object, tuple[dict[tuple[str, str], float], dict[str, float]]] = field(default_factory=dict)

    @classmethod
    def of(cls, rig: "Rig", measure: Measure, mechanism: str | None = None) -> "Prediction":
        """From a stored rig. What it names is looked up among the shipped mechanisms only: a stored run opens no file.

        ``mechanism`` is a name or file that a person gives instead.
        """
        if mechanism is None and rig.mechanism not in datasets.names("mechanisms", ".xml"):
            raise AnalysisError(
                f"the rig is for {rig.mechanism!r}, which is not shipped: give its file, --mechanism FILE"
            )
        return cls(rig, load_mechanism(mechanism or datasets.ROOT / "mechanisms" / f"{rig.mechanism}.xml"), measure)

    def reductions(self, pair: "Pair") -> tuple[dict[tuple[str, str], float | None], dict[str, float | None]]:
        """Reductions [%] of the base's vibration by (sensor, axis), and of the shaking force by axis."""
        with_masses, without = (self._amplitudes(pair, masses) for masses in (pair.counter_masses, {}))
        base = {place: percent([with_masses[0][place]], [without[0][place]]) for place in without[0]}
        force = {axis: percent([with_masses[1][axis]], [without[1][axis]]) for axis in without[1]}
        return base, force

    def _amplitudes(
        self, pair: "Pair", masses: dict[str, float]
    ) -> tuple[dict[tuple[str, str], float], dict[str, float]]:
        key = (pair.key, tuple(masses.items()))
        if key not in self._done:
            if pair.key.motion not in datasets.names("motions", ".toml"):
                raise AnalysisError(f"motion {pair.key.motion!r} is not shipped: the bench cannot repeat it")
            planned = PlannedRun(
                "anew", pair.key.payload_kg, masses, pair.key.motion, pair.key.peak_acceleration_g * G0, 1
            )
            run = simulate_run(self.rig, self.mechanism, planned)
            self._done[key] = self._base(run), self._force(run)
        return self._done[key]

    def _base(self, run: BenchRun) -> dict[tuple[str, str], float]:
        found: dict[tuple[str, str], float] = {}
        for name, sensor in self.rig.base_accelerometers.items():
            logger = self.rig.loggers[sensor.logger]
            true = instants(logger, float(run.time[-1]))[1]
            for axis, signal in base_acceleration(sensor, run).items():
                if axis in sensor.channels:
                    found[name, axis] = self._amplitude(np.interp(true, run.time, signal), logger.rate)
        return found

    def _force(self, run: BenchRun) -> dict[str, float]:
        rate = 1.0 / float(run.time[1])
        return {axis: self._amplitude(force, rate) for axis, force in zip("xyz", run.response.force.T, strict=True)}

    def _amplitude(self, signal: Floats, rate_hz: float) -> float:
        """Rounding errors of a signal that is zero by symmetry are no amplitude."""
        return self.measure.of(signal, rate_hz) if np.abs(signal).max() > NOTHING else 0.0
