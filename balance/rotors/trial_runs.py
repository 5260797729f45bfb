"""Trial runs, and the correction weights that they give: what ``balance rotor influence`` takes.

A file (``datasets/rotors``) has the runs, or influence coefficients. It states how its phases and angles count, and of
every trial weight whether it ``stayed_on`` after its run. Here phase counts as lead of the vibration and weight angles
with the sense of rotation, whatever the file counts; ``in_file_sense`` and ``in_file_phase`` turn results back.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import AfterValidator, Field

from .. import datasets
from ..arrays import Complexes, Floats
from ..errors import DataError, UnitError
from ..estimation.estimate import standard_deviation_within
from ..input_files import (
    Distinct,
    Flag,
    FromText,
    Measured,
    Positive,
    Quantity,
    Table,
    Text,
    Vector,
    in_file,
    model_from_table,
    read_toml,
)
from ..results import Key, given
from ..units import dimension_of, parse, parse_uncertain
from .correction_uncertainty import (
    CorrectionUncertainty,
    covariance_of_runs,
    covariance_of_stated,
    propagate,
    reading_covariance,
)
from .influence_coefficients import (
    LEAST_EFFECT,
    Coefficients,
    Solution,
    influence_coefficients,
    solve_weights,
    weight_effect,
)

WEIGHT = ("mass", "first moment")
"""A weight is a mass at its plane's radius, or mass times radius."""
READING = ("length", "velocity", "acceleration")
"""What an instrument may read."""
_UNSTATED = "unstated"


class Reading(NamedTuple):
    """A reading of a sensor."""

    value: complex
    """Amplitude at its phase [m, m/s or m/s2]."""
    half: tuple[float, float] | None
    """Half widths of its 95 % interval, along and across it."""
    dimension: str


def _reading(text: str, _context: object) -> Reading:
    return Reading(*parse_uncertain(text, *READING), dimension_of(text, *READING))


def _speed(text: str) -> str:
    """A speed above zero, or ``unstated``."""
    try:
        if text != _UNSTATED and not parse(text, "angular velocity") > 0.0:
            raise UnitError(f"{text!r}: expected more than zero")
    except UnitError as error:
        raise ValueError(str(error)) from error
    return text


def _distinct_speeds(readings: dict[str, Any]) -> dict[str, Any]:
    """No two are one speed written in two ways: it has one reading of a sensor."""
    known: dict[str, float] = {}
    for text in readings:
        if text == _UNSTATED:
            continue
        speed = parse(text, "angular velocity")
        if same := [other for other, at in known.items() if np.isclose(speed, at, rtol=1e-9)]:
            raise ValueError(f"{text} is the same speed as {same[0]}: give its readings once")
        known[text] = speed
    return readings


Weight = Annotated[Measured[complex], Vector(*WEIGHT)]
Limit = Annotated[Measured[float], Quantity(*WEIGHT, above=0.0)]
Scale = Annotated[Measured[float], Quantity(*READING, above=0.0)]
Readings = Annotated[
    dict[
        Annotated[str, AfterValidator(_speed)],
        dict[str, Annotated[Reading, FromText(_reading, "170 um ± 2 um @ 112 deg ± 1 deg", READING)]],
    ],
    AfterValidator(_distinct_speeds),
]


class TrialPlaneTable(Table):
    """A plane that carries weights."""

    name: Text
    """Name of it."""
    limit: Limit | None = None
    """Largest weight that may be mounted [kg or kg m]."""


class SensorTable(Table):
    """Weight of a sensor, and how far its readings scatter."""

    name: Text
    """Name of it, as in the readings."""
    scale: Scale | None = None
    """Reading that counts as one, where sensors read several quantities."""
    weight: Positive | None = None
    """Weight of the squares of its readings."""
    within: Scale | None = None
    """Half the 95 % interval of each component of its readings, the same in every direction: 1.96 sigma."""


class RunTable(Table):
    """A run of the machine."""

    name: Text
    """Name of it."""
    weights: dict[str, Weight] | None = None
    """Trial weights put on for this run, by plane [kg or kg m]; none in the first run."""
    stayed_on: Flag | None = None
    """Whether the trial weights stayed on after this run."""
    readings: Readings
    """Readings by speed (``"2940 rpm"``, or ``unstated``) and sensor [m, m/s or m/s2]."""
    phases_alike: dict[str, Annotated[float, Quantity("angle", above=0.0)]] = Field(default_factory=dict)
    """Half the 95 % interval of the common-mode error of all phases at a speed, by speed [rad]."""

    def _check(self) -> None:
        if self.weights is not None and self.stayed_on is None:
            raise DataError(
                "stayed_on is missing: state whether this run's trial weight stayed on after it (true or false)"
            )
        if self.weights is None and self.stayed_on is not None:
            raise DataError("stayed_on: this run has no trial weights: leave it out")


class TrialRunsTable(Table):
    """Trial runs, or influence coefficients and the readings as found."""

    name: Text | None = None
    """Name of it."""
    source: str = ""
    """Where it is from."""
    note: str = ""
    """A note that is shown with the results."""
    phase: Literal["lead", "lag"]
    """Whether phases of readings count as lead or lag."""
    angles: Literal["with rotation", "against rotation"]
    """Whether angles of weights count with the rotation or against it."""
    amplitude: Literal["peak", "peak_to_peak", "rms"] | None = None
    """What the amplitude of a reading is."""
    planes: Annotated[list[TrialPlaneTable], Field(min_length=1), Distinct]
    """Planes that carry weights."""
    sensors: Annotated[list[SensorTable], Distinct] = Field(default_factory=list)
    """Weights, scales and intervals of sensors."""
    runs: Annotated[list[RunTable], Distinct] = Field(default_factory=list)
    """Runs in their order, the first as found: without trial weights."""
    initial: Readings | None = None
    """Without runs: readings as found, by speed and sensor."""
    coefficients: dict[str, dict[str, list[Annotated[Measured[complex], Vector(*READING)]]]] | None = None
    """Without runs: influence coefficients by speed and sensor, one for each plane."""
    per: Text | None = None
    """Unit of weight that the coefficients are for, such as ``g mm``."""
    least_effect: Positive = LEAST_EFFECT
    """Least change, as a share of the reading, that trial weights must cause to be of use."""
    speed_weights: dict[str, Positive] = Field(default_factory=dict)
    """Weight of the squares of the readings at a speed."""
    published: dict[str, Weight] = Field(default_factory=dict)
    """Weights by plane that the source publishes [kg or kg m]."""

    def _check(self) -> None:
        stated = [key for key in ("initial", "coefficients", "per") if getattr(self, key) is not None]
        if self.runs and stated:
            raise DataError(f"gives both runs and {stated[0]}: expected runs, or coefficients, initial and per")
        if not self.runs and len(stated) < 3:
            raise DataError("runs are missing (or coefficients, initial and per)")


@dataclass(frozen=True)
class TrialRun:
    """One run of the machine."""

    name: str
    weights: Complexes
    """All weights that were on, (planes,) [kg or kg m]."""
    trial: Complexes
    """Those of them that were put on for this run, (planes,) [kg or kg m]."""
    stayed_on: bool | None
    """Whether they stayed on after it; None where nothing was put on."""
    readings: Complexes
    """Readings, (rows,) [m, m/s or m/s2]."""
    errors: Floats | None = None
    """Covariance of the components of each reading, (rows, 2, 2), where the file states their intervals."""
    common_phase: Mapping[str, float] = field(default_factory=dict)
    """Standard deviation of the common-mode error of all phases at a speed, by speed [rad]."""


@dataclass(frozen=True)
class TrialRuns:
    """The trial runs of a file, in the sense of lead and with rotation."""

    name: Annotated[str, Key()]
    source: Annotated[str, Key(to=given)]
    phase: Annotated[str, Key()]
    """What the phases of the file count: ``lead`` or ``lag``."""
    angles: Annotated[str, Key()]
    """How the file counts weight angles: ``with rotation`` or ``against rotation``."""
    amplitude: Annotated[str, Key()]
    """Metric of the readings, such as ``peak_to_peak``."""
    planes: tuple[TrialPlaneTable, ...]
    rows: tuple[tuple[str, str], ...]
    """Sensor and speed of each row."""
    factors: Floats
    """Factor of each row in the cost, (rows,) [-] or, with scales, [1/r]."""
    reading: str
    """Dimension of the readings; ``mixed`` where sensors differ and each has its scale."""
    weight: str
    """Dimension of the weights: ``mass`` or ``first moment``."""
    runs: tuple[TrialRun, ...]
    """Empty where the file states the coefficients."""
    stated: Coefficients | None
    """Coefficients where the file states them."""
    least_effect: float
    published: Mapping[str, complex]
    """Weights by plane that the source publishes, in the sense of the file [kg or kg m]."""
    note: Annotated[str, Key(to=given)]
    stated_errors: Floats | None = None
    """Covariances of stated readings and coefficients, (planes + 1, rows, 2, 2), where intervals are stated."""

    @property
    def mounted(self) -> Complexes:
        """Weights that are still on after the last run, (planes,) [kg or kg m]."""
        on = np.zeros(len(self.planes), dtype=complex)
        for run in self.runs:
            on = on + (run.trial if run.stayed_on else 0.0)
        return on

    def coefficients(self) -> Coefficients:
        """Influence coefficients; a trial weight with too little effect is refused by name."""
        if self.stated is not None:
            return self.stated
        for run, effect in self.effects().items():
            if effect < self.least_effect:
                raise DataError(
                    f"{self.name}: the trial weight of run {run!r} changed no reading by more than "
                    f"{100 * effect:.1f} % (expected {100 * self.least_effect:g} %): too little effect to compute "
                    "from; repeat the run with a larger trial weight, or state a smaller least_effect in the file"
                )
        return influence_coefficients(*self._weights_and_readings())

    def _weights_and_readings(self) -> tuple[Complexes, Complexes]:
        """Weights (runs, planes) and readings (runs, rows) of all runs."""
        return np.array([run.weights for run in self.runs]), np.array([run.readings for run in self.runs])

    def uncertainty(self, solution: Solution) -> CorrectionUncertainty | None:
        """Intervals of a solution, by stated intervals of readings, else by repeated runs; None by neither."""
        if self.stated is not None:
            covariance = None if self.stated_errors is None else covariance_of_stated(self.stated_errors)
        else:
            errors = [run.errors for run in self.runs if run.errors is not None]
            modes = []
            for i, run in enumerate(self.runs):
                for speed, deviation in run.common_phase.items():
                    mode = np.zeros((len(self.runs), len(self.rows)))
                    mode[i] = [deviation * (at == speed) for _, at in self.rows]
                    modes.append(mode)
            stated = np.array(errors) if errors else None, np.array(modes) if modes else None
            covariance = covariance_of_runs(*self._weights_and_readings(), *stated)
        if covariance is None:
            return None
        return propagate(solution, covariance, lambda coefficients: self._solved(coefficients, solution.method))

    def effects(self) -> dict[str, float]:
        """Largest change of a reading by each trial weight, relative to the last run with the same other weights."""
        effects = {}
        for i, run in enumerate(self.runs):
            if run.stayed_on is None:
                continue
            others = run.weights - run.trial
            tiny = 1e-9 * float(np.abs(run.trial).max())
            before = [r for r in self.runs[:i] if np.allclose(r.weights, others, rtol=0.0, atol=tiny)]
            effects[run.name] = weight_effect(before[-1].readings * self.factors, run.readings * self.factors)
        return effects

    def solve(self, method: str) -> Solution:
        """Correction weights, in the sense of lead and with rotation."""
        return self._solved(self.coefficients(), method)

    def _solved(self, coefficients: Coefficients, method: str) -> Solution:
        limits = [np.inf if plane.limit is None else plane.limit.value for plane in self.planes]
        return solve_weights(coefficients, method, self.factors, limits)

    def in_file_sense(self, weights: Complexes) -> Complexes:
        """Weights (planes,) [kg or kg m] with their angles counted as the file counts them, of the same shape."""
        return weights if self.angles == "with rotation" else weights.conj()

    def in_file_phase(self, readings: Complexes) -> Complexes:
        """Readings (rows,) [m, m/s or m/s2] with their phases counted as the file counts them, of the same shape."""
        return readings if self.phase == "lead" else readings.conj()


def load_trial_runs(name: str | Path) -> TrialRuns:
    """Load shipped trial runs by name, or a TOML file. Raises DataError, naming run and key."""
    path = datasets.find_dataset(name, "rotors", ".toml")
    if path.suffix.lower() != ".toml":
        raise DataError(f"{path.name}: expected a TOML file of trial runs")
    return trial_runs_from_table(read_toml(path), path.name)


def trial_runs_from_table(content: Mapping[str, Any], source: str) -> TrialRuns:
    """Build the runs from the keys of their file, which messages call ``source``."""
    if "masses" in content:
        raise DataError(f"{source} is a file of a rotor's masses: use 'balance rotor correct'")
    table = model_from_table(TrialRunsTable, content, source)
    with in_file(source):
        return _Builder(table, source.removesuffix(".toml")).built()


class _Builder:
    """Puts the runs of one file together; its rows are in the order in which the first run names them."""

    def __init__(self, table: TrialRunsTable, name: str) -> None:
        self.table, self.name = table, name
        self.lag, self.against = table.phase == "lag", table.angles == "against rotation"
        self.planes = [plane.name for plane in table.planes]
        self.within = {sensor.name: (sensor.within.value,) * 2 for sensor in table.sensors if sensor.within is not None}
        first = table.runs[0].readings if table.runs else table.initial or {}
        self.rows = [(sensor, speed) for speed, readings in first.items() for sensor in readings]
        self.dimensions = {sensor: reading.dimension for of in first.values() for sensor, reading in of.items()}
        self.weight = self._weight_dimension()

    def built(self) -> TrialRuns:
        """The runs."""
        table, runs = self.table, self._runs()
        stated, stated_errors = (None, None) if runs else self._coefficients()
        dimensions = set(self.dimensions.values())
        reading = dimensions.pop() if len(dimensions) == 1 else "mixed"
        published = {name: each.value for name, each in self._by_plane("published", table.published).items()}
        return TrialRuns(
            table.name or self.name, table.source, table.phase, table.angles, table.amplitude or _UNSTATED,
            tuple(table.planes), tuple(self.rows), self._factors(), reading, self.weight, runs, stated,
            table.least_effect, published, table.note, stated_errors,
        )  # fmt: skip

    def _weight_dimension(self) -> str:
        """The one dimension of all weights: they are masses, or mass times radius."""
        table = self.table
        stated: list[tuple[str, Measured[float] | Measured[complex]]] = []
        stated += [(f"planes ({plane.name}).limit", plane.limit) for plane in table.planes if plane.limit is not None]
        stated += [(f"runs ({r.name}).weights.{k}", v) for r in table.runs for k, v in (r.weights or {}).items()]
        stated += [(f"published.{key}", value) for key, value in table.published.items()]
        found = stated[0][1].dimension if stated else dimension_of(f"1 {table.per}", *WEIGHT)
        for key, weight in stated:
            if weight.dimension != found:
                raise DataError(f"{key}: is a {weight.dimension}, others are a {found}: give all of one dimension")
        return found

    def _by_plane(self, key: str, weights: Mapping[str, Measured[complex]]) -> Mapping[str, Measured[complex]]:
        if unknown := [name for name in weights if name not in self.planes]:
            raise DataError(f"{key}: {unknown[0]} is no plane of this file: there are {', '.join(self.planes)}")
        return weights

    def _runs(self) -> tuple[TrialRun, ...]:
        """Runs in their order; weights that stayed on are on in the next."""
        on = np.zeros(len(self.planes), dtype=complex)
        found: list[TrialRun] = []
        for i, table in enumerate(self.table.runs):
            with in_file(f"runs[{i}] ({table.name})"):
                run = self._run(table, on, first=not found)
            found.append(run)
            on = run.weights if run.stayed_on else on
        if bare := [run.name for run in found if (run.errors is None) != (found[0].errors is None)]:
            raise DataError(
                f"readings of run {bare[0]!r} and of run {found[0].name!r} do not both have intervals: give all of "
                "them one, or none"
            )
        return tuple(found)

    def _run(self, table: RunTable, on: Complexes, first: bool) -> TrialRun:
        trial = np.zeros_like(on)
        if table.weights is not None:
            if first:
                raise DataError("weights: are in the first run: expected the rotor as found, without trial weights")
            stated = self._by_plane("weights", table.weights)
            trial = np.array([stated[name].value if name in stated else 0j for name in self.planes])
            if not trial.any():
                raise DataError(f"weights: expected a trial weight above zero in one of {', '.join(self.planes)}")
            trial = trial.conj() if self.against else trial
        values, errors = self._readings(table.readings, "readings")
        with in_file("phases_alike"):
            if table.phases_alike and errors is None:
                raise DataError("needs intervals of the readings, which are not given")
            if unknown := set(table.phases_alike) - {speed for _, speed in self.rows}:
                raise DataError(f"{min(unknown)!r} is no speed of this run's readings")
        common = {speed: standard_deviation_within(half) for speed, half in table.phases_alike.items()}
        return TrialRun(table.name, on + trial, trial, table.stayed_on, values, errors, common)

    def _readings(self, speeds: Mapping[str, Mapping[str, Reading]], key: str) -> tuple[Complexes, Floats | None]:
        """Readings (rows,) and the covariances of their components (rows, 2, 2), None where no interval is stated."""
        found = {(sensor, speed): reading for speed, of in speeds.items() for sensor, reading in of.items()}
        if not found or set(found) != set(self.rows):
            odd = sorted(f"{sensor} at {speed}" for sensor, speed in set(found) ^ set(self.rows))
            which = odd[0] if odd else "nothing"
            raise DataError(f"{key}: {which} is not read in every run: give the same sensors and speeds in all")
        for (sensor, _), reading in found.items():
            if reading.dimension != self.dimensions[sensor]:
                raise DataError(
                    f"{key}: {sensor} is a {reading.dimension} here and a {self.dimensions[sensor]} in another run"
                )
        values = np.array([found[row].value for row in self.rows])
        values = values.conj() if self.lag else values
        stated = {row: half for row in self.rows if (half := found[row].half or self.within.get(row[0])) is not None}
        if not stated:
            return values, None
        if bare := [f"{sensor} at {speed}" for sensor, speed in self.rows if (sensor, speed) not in stated]:
            raise DataError(
                f"{key}: {bare[0]} has no interval, others have: write for example '170 um ± 2 um @ 112 deg ± 1 deg', "
                "or give its sensor a 'within', or leave all intervals out"
            )
        return values, np.array(
            [reading_covariance(complex(v), *stated[row]) for v, row in zip(values, self.rows, strict=True)]
        )

    def _coefficients(self) -> tuple[Coefficients, Floats | None]:
        """Coefficients and readings that the file gives; covariances of both, (planes + 1, rows, 2, 2)."""
        initial, errors = self._readings(self.table.initial or {}, "initial")
        if self.lag != self.against:
            raise DataError(
                "coefficients: phases and weight angles that count in opposite senses have no one meaning: give "
                "phase = 'lead' with angles = 'with rotation', or 'lag' with 'against rotation'"
            )
        stated = {(sensor, v): row for v, of in (self.table.coefficients or {}).items() for sensor, row in of.items()}
        if odd := sorted(f"{sensor} at {speed}" for sensor, speed in set(stated) ^ set(self.rows)):
            raise DataError(f"coefficients: {odd[0]} is not in both coefficients and initial")
        for sensor, speed in self.rows:
            row, key = stated[sensor, speed], f"coefficients.{speed}.{sensor}"
            if len(row) != len(self.planes):
                raise DataError(
                    f"{key}: has {len(row)} values: expected one coefficient for each of {', '.join(self.planes)}"
                )
            if other := [value.dimension for value in row if value.dimension != self.dimensions[sensor]]:
                raise DataError(f"{key}: is a {other[0]}: expected a {self.dimensions[sensor]}")
        per = parse(f"1 {self.table.per}", self.weight)
        matrix: Complexes = np.array([[each.value / per for each in stated[row]] for row in self.rows], dtype=complex)
        if errors is not None:
            errors = np.concatenate([errors[None], np.zeros((len(self.planes), *errors.shape))])
        return Coefficients(initial, matrix.conj() if self.lag else matrix, 0.0), errors

    def _factors(self) -> Floats:
        """Factor of each row: root of its sensor's weight, over its scale, times the root of its speed's weight."""
        weights, factors = self.table.speed_weights, dict.fromkeys(self.dimensions, 1.0)
        if unknown := set(weights) - {speed for _, speed in self.rows}:
            raise DataError(f"speed_weights: {min(unknown)!r} is no speed of this file")
        sensors = {sensor.name: sensor for sensor in self.table.sensors}
        for name in filter(sensors.__contains__, factors):
            table = sensors[name]
            for key, size in (("scale", table.scale), ("within", table.within)):
                if size is not None and size.dimension != self.dimensions[name]:
                    raise DataError(
                        f"sensors ({name}).{key}: is a {size.dimension}: expected a {self.dimensions[name]}"
                    )
            factors[name] = (table.weight or 1.0) ** 0.5 / (1.0 if table.scale is None else table.scale.value)
        if unknown := set(sensors) - set(factors):
            raise DataError(f"sensors: {min(unknown)!r}, which no run reads: there are {', '.join(factors)}")
        dimensions = sorted(set(self.dimensions.values()))
        scaled = {name for name, sensor in sensors.items() if sensor.scale is not None}
        if len(dimensions) > 1 and scaled != set(factors):
            raise DataError(
                f"sensors read {' and '.join(dimensions)}: give every sensor a scale, the reading that counts as one, "
                "or they cannot be compared"
            )
        return np.array([factors[sensor] * weights.get(speed, 1.0) ** 0.5 for sensor, speed in self.rows])
