"""Sheets of trial runs, or of influence coefficients: what ``balance rotor influence`` takes.

A sheet says how its phases and angles count: ``phase = "lead" | "lag"``, ``angles = "with rotation" | "against
rotation"``; and of every trial weight whether it ``stayed_on`` after its run.
"""

from pathlib import Path

import numpy as np

from .. import datasets, influence
from ..arrays import Floats
from ..errors import DataError
from ..intervals import deviation
from ..sheet import Sheet, dimension_of, quantity
from .moduli import Complexes
from .runs import Run, Runs, TrialPlane
from .sensors import READING, Half, Sensors, covariances

WEIGHT = ("mass", "first moment")
"""A weight is a mass at its plane's radius, or mass times radius."""
METRICS = ("peak", "peak_to_peak", "rms")
"""What a reading's amplitude may be."""
_UNSTATED = "unstated"


def load(name: str | Path) -> Runs:
    """Load a shipped sheet of trial runs by name, or a TOML file. Raises DataError, naming run and key."""
    path = datasets.find(name, "rotors", ".toml")
    if path.suffix.lower() != ".toml":
        raise DataError(f"{path.name}: expected a TOML sheet of trial runs")
    return from_sheet(Sheet.load(path))


def from_sheet(sheet: Sheet) -> Runs:
    """Build the runs from a sheet."""
    if "masses" in sheet:
        raise DataError(f"{sheet.where} is a sheet of a rotor's masses: use 'balance rotor correct'")
    phase = sheet.text("phase", among=("lead", "lag"))
    angles = sheet.text("angles", among=("with rotation", "against rotation"))
    reader = _Reader(sheet, phase == "lag", angles == "against rotation")
    planes = reader.planes()
    runs = reader.runs() if "runs" in sheet else ()
    given = None if runs else reader.coefficients()
    least_effect = sheet.positive("least_effect") if "least_effect" in sheet else influence.LEAST_EFFECT
    published = reader.published()
    result = Runs(
        sheet.text("name", sheet.where.removesuffix(".toml")),
        sheet.text("source", ""),
        phase,
        angles,
        sheet.text("amplitude", _UNSTATED, among=METRICS),
        planes,
        tuple(reader.rows),
        reader.factors(),
        reader.reading,
        reader.weight,
        runs,
        given,
        least_effect,
        published,
        sheet.text("note", ""),
        reader.given_errors,
    )
    sheet.finish()
    return result


class _Reader:
    """Reads one sheet: its planes first, then rows in the order in which the first run names them."""

    def __init__(self, sheet: Sheet, lag: bool, against: bool) -> None:
        self.sheet, self.lag, self.against = sheet, lag, against
        self.names: list[str] = []
        self.rows: list[tuple[str, str]] = []
        self.dimensions: dict[str, str] = {}
        self.weight = ""
        self.sensors = Sensors(sheet)
        self.given_errors: Floats | None = None

    def planes(self) -> tuple[TrialPlane, ...]:
        found = []
        for item in self.sheet.sheets("planes"):
            name = item.text("name")
            limit = self._magnitude(item, "limit") if "limit" in item else np.inf
            item.finish()
            found.append(TrialPlane(name, limit))
        self.names = [plane.name for plane in found]
        return tuple(found)

    def runs(self) -> tuple[Run, ...]:
        """Runs in their order; weights that stayed on are on in the next."""
        on = np.zeros(len(self.names), dtype=complex)
        found: list[Run] = []
        for item in self.sheet.sheets("runs"):
            run = self._run(item, on, first=not found)
            found.append(run)
            on = run.weights if run.stayed_on else on
        if bare := [run.name for run in found if (run.errors is None) != (found[0].errors is None)]:
            raise DataError(
                f"{self.sheet.where}: readings of run {bare[0]!r} and of run {found[0].name!r} do not both have "
                "intervals: give all of them one, or none"
            )
        return tuple(found)

    def _run(self, item: Sheet, on: Complexes, first: bool) -> Run:
        name = item.text("name")
        trial, stayed = np.zeros_like(on), None
        if "weights" in item:
            if first:
                raise item.refuse("weights", "are in the first run: expected the rotor as it is, without trial weights")
            trial = self._weights(item.sheet("weights"))
            if "stayed_on" not in item:
                raise item.refuse(
                    "stayed_on", "is missing: say whether this run's trial weight stayed on after it (true or false)"
                )
            stayed = item.flag("stayed_on")
        readings, errors = self._readings(item.sheet("readings"), first)
        shared = self._shared(item.sheet("phases_alike"), errors is not None) if "phases_alike" in item else {}
        item.finish()
        return Run(name, on + trial, trial, stayed, readings, errors, shared)

    def _shared(self, table: Sheet, stated: bool) -> dict[str, float]:
        """Deviation of the error that all phases at a speed share, by speed [rad]."""
        if not stated:
            raise DataError(f"{table.where} goes with intervals of the readings, which are not given")
        for speed in table.keys():  # noqa: SIM118
            if speed not in {at for _, at in self.rows}:
                raise table.refuse(speed, "is no speed of this run's readings")
        return {v: deviation(table.quantity(v, "angle", positive=True)) for v in table.keys()}  # noqa: SIM118

    def _weights(self, table: Sheet) -> Complexes:
        for key in table.keys():  # noqa: SIM118
            self._check_plane(table, key)
        values = [self._weight(table, name) if name in table else 0j for name in self.names]
        if not any(values):
            raise DataError(f"{table.where}: expected a trial weight above zero in one of {', '.join(self.names)}")
        return np.array(values)

    def _readings(self, speeds: Sheet, first: bool) -> tuple[Complexes, Floats | None]:
        """Readings (rows,) and their covariances (rows, 2, 2), where their intervals are stated."""
        found: dict[tuple[str, str], tuple[complex, Half | None]] = {}
        self._check_speeds(speeds)
        for speed in speeds.keys():  # noqa: SIM118
            table = speeds.sheet(speed)
            for sensor in table.keys():  # noqa: SIM118
                found[sensor, speed] = self._reading(table, sensor)
        if first:
            self.rows = list(found)
        if not found or set(found) != set(self.rows):
            odd = sorted({f"{sensor} at {speed}" for sensor, speed in set(found) ^ set(self.rows)})
            raise DataError(f"{speeds.where}: {odd[0] if odd else 'nothing'} is not read in every run alike")
        values, halves = np.array([found[row][0] for row in self.rows]), [found[row][1] for row in self.rows]
        return values, covariances(values, halves, speeds.where, [f"{sensor} at {v}" for sensor, v in self.rows])

    def coefficients(self) -> influence.Coefficients:
        """Coefficients and readings that the sheet gives, by speed and sensor, a list in the order of the planes."""
        if "coefficients" not in self.sheet:
            raise self.sheet.refuse("runs", "are missing (or coefficients and initial)")
        initial, errors = self._readings(self.sheet.sheet("initial"), first=True)
        self.weight = self.weight or dimension_of(f"1 {self.sheet.text('per')}", *WEIGHT)
        per = quantity(f"1 {self.sheet.text('per')}", self.weight)
        speeds = self.sheet.sheet("coefficients")
        matrix = [[c / per for c in self._coefficient_row(speeds.sheet(v), sensor)] for sensor, v in self.rows]
        speeds.finish()
        if errors is not None:
            exact = np.zeros((len(self.names), *errors.shape))
            self.given_errors = np.concatenate([errors[None], exact])
        return influence.Coefficients(initial, np.array(matrix), 0.0)

    def _coefficient_row(self, table: Sheet, sensor: str) -> list[complex]:
        found = table.value(sensor)
        if not isinstance(found, list) or len(found) != len(self.names):
            raise table.refuse(sensor, f"is {found!r}: expected one coefficient for each of {', '.join(self.names)}")
        row = Sheet({str(i): item for i, item in enumerate(found)}, f"{table.where}, {sensor}")
        values = [row.vector(str(i), self.dimensions[sensor]) for i in range(len(found))]
        turned = np.array(values).conj() if self.lag else np.array(values)
        return [complex(value) for value in turned] if self.lag == self.against else self._refuse_mixed(table)

    def _refuse_mixed(self, table: Sheet) -> list[complex]:
        raise DataError(
            f"{table.where}: coefficients whose phases and weight angles count in opposite senses have no one meaning: "
            "give phase = 'lead' with angles = 'with rotation', or 'lag' with 'against rotation'"
        )

    def factors(self) -> Floats:
        """Factor of each row: its sensor's, times the root of its speed's weight."""
        sensors = self.sensors.factors(self.dimensions)
        speeds = self.sheet.sheet("speed_weights") if "speed_weights" in self.sheet else Sheet({}, "")
        for speed in speeds.keys():  # noqa: SIM118
            if speed not in {s for _, s in self.rows}:
                raise speeds.refuse(speed, "is no speed of this sheet")
        weights = {speed: speeds.positive(speed) for speed in speeds.keys()}  # noqa: SIM118
        return np.array([sensors[sensor] * weights.get(speed, 1.0) ** 0.5 for sensor, speed in self.rows])

    @property
    def reading(self) -> str:
        """The one dimension of all readings, or ``mixed``."""
        kinds = set(self.dimensions.values())
        return kinds.pop() if len(kinds) == 1 else "mixed"

    def published(self) -> dict[str, complex]:
        if "published" not in self.sheet:
            return {}
        table = self.sheet.sheet("published")
        for key in table.keys():  # noqa: SIM118
            self._check_plane(table, key)
        return {key: table.vector(key, self.weight) for key in table.keys()}  # noqa: SIM118

    def _check_plane(self, table: Sheet, name: str) -> None:
        if name not in self.names:
            raise table.refuse(name, f"is no plane of this sheet: there are {', '.join(self.names)}")

    def _check_speeds(self, table: Sheet) -> None:
        """Speeds are positive, and no two are one speed written in two ways: it has one reading of a sensor."""
        known: dict[str, float] = {}
        for speed in table.keys():  # noqa: SIM118
            if speed == _UNSTATED:
                continue
            value = Sheet({speed: speed}, table.where).quantity(speed, "angular velocity", positive=True)
            if same := [other for other, at in known.items() if np.isclose(value, at, rtol=1e-9)]:
                raise table.refuse(speed, f"is the same speed as {same[0]}: give its readings once")
            known[speed] = value

    def _reading(self, table: Sheet, sensor: str) -> tuple[complex, Half | None]:
        dimension = dimension_of(str(table.value(sensor)), *READING)
        if self.dimensions.setdefault(sensor, dimension) != dimension:
            raise table.refuse(sensor, f"is a {dimension} here and a {self.dimensions[sensor]} in another run")
        found, half = table.uncertain(sensor, dimension)
        return found.conjugate() if self.lag else found, half or self.sensors.within(sensor)

    def _weight(self, table: Sheet, key: str) -> complex:
        self._dimension(table, key)
        found = table.vector(key, self.weight)
        return found.conjugate() if self.against else found

    def _magnitude(self, table: Sheet, key: str) -> float:
        self._dimension(table, key)
        return table.quantity(key, self.weight, positive=True)

    def _dimension(self, table: Sheet, key: str) -> None:
        """All weights of a sheet are masses, or all are mass times radius."""
        dimension = dimension_of(str(table.value(key)), *WEIGHT)
        self.weight = self.weight or dimension
        if dimension != self.weight:
            raise table.refuse(key, f"is a {dimension}, others are a {self.weight}: give all alike")
