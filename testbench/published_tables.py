"""Published tables of reductions (``datasets/published``), with the numbers as printed."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import ConfigDict, Field, Strict

from balance import datasets
from balance.errors import DataError, suggestion
from balance.input_files import Table, Text, json_document, model_from_table, read_text
from balance.results import Key

from .errors import AnalysisError

CONDITIONS = ("payload_kg", "motion", "peak_acceleration_g", "peak_acceleration_rad_s2")
"""Columns of a table's conditions, as in a run table."""
AXES = ("x_axis", "y_axis", "z_axis")
Printed = tuple[float | str | None, ...]
"""A printed condition, in the order of CONDITIONS: payload [kg], motion, peak acceleration [g0], or [rad/s2]."""
LABEL_STEP_KG = 0.01
"""Step of printed payloads [kg]: 1.451 kg is printed as 1.45, 3.4116 kg as 3.41."""
ORIGINAL_LOGS = "The original logs of the manipulator tests are not available: only these printed numbers are."
NO_ORIGINALS = "The original logs of the manipulator tests are not available: what is shown for them here is simulated."
"""Note with reductions of simulated runs of that manipulator."""
MANIPULATOR = "parallelogram-6bar"
"""Beginning of the names of the mechanisms that model it."""
_EXTREMES = "force_x_motion_5kg_3g"
"""Key of the force sensors' extremes in a file of published numbers."""
PAYLOAD_KG, MOTION, PEAK_G = 5.0, "x", 3.0


@dataclass(frozen=True)
class ForceExtremes:
    """Smallest and largest force of the sensors in one condition [N], and the acceleration's printed reduction [%]."""

    without: tuple[float, float]
    balanced: tuple[float, float]
    acceleration_percent: float

    @classmethod
    def of(cls, tests: Mapping[str, Any], acceleration_percent: float | None) -> "ForceExtremes | None":
        """From the tests in a file of published numbers; None where it has no such extremes."""
        if _EXTREMES not in tests or acceleration_percent is None:
            return None
        ends = [tuple(map(float, tests[_EXTREMES][f"{name}_min_max_N"])) for name in ("unbalanced", "balanced")]
        (low, high), (low_with, high_with) = ends
        return cls((low, high), (low_with, high_with), acceleration_percent)

    @property
    def reductions(self) -> dict[str, float]:
        """Reduction of each amplitude that the extremes define [%]."""
        (low, high), (low_with, high_with) = self.without, self.balanced
        return {
            "peak_to_peak": _reduction(high - low, high_with - low_with),
            "positive_peak": _reduction(high, high_with),
            "negative_peak": _reduction(-low, -low_with),
        }

    @property
    def spans(self) -> tuple[float, float]:
        """Peak to peak, without counter-masses and with [N]."""
        return self.without[1] - self.without[0], self.balanced[1] - self.balanced[0]

    def contradiction(self) -> str:
        """How the force and the acceleration of one condition disagree, in printed numbers."""
        reductions, (low, high), (low_with, high_with) = self.reductions, self.without, self.balanced
        return (
            f"Two printed numbers of one condition ({PAYLOAD_KG:g} kg, {MOTION}, {PEAK_G:g} g0) disagree: the base's "
            f"acceleration along {MOTION} is reduced by {self.acceleration_percent:.1f} %, the force between mechanism "
            f"and base by {reductions['peak_to_peak']:.1f} % peak to peak ({self.spans[0]:.1f} to "
            f"{self.spans[1]:.2f} N). Its positive peak goes from {high:.1f} to {high_with:.1f} N, a reduction of "
            f"{reductions['positive_peak']:.1f} %, its negative one from {low:.1f} to {low_with:.2f} N, "
            f"a reduction of {reductions['negative_peak']:.1f} %."
        )


@dataclass(frozen=True)
class Published:
    """A published table: reductions [%] by axis, by condition as printed."""

    name: Annotated[str, Key()]
    source: Annotated[str, Key()]
    definition: Annotated[str, Key()]
    """How amplitudes were taken, by the source."""
    rows: dict[Printed, dict[str, float]]
    """Reductions [%] by axis, of each condition."""
    force_extremes: ForceExtremes | None = None
    """Extremes of the force sensors that are printed with the table."""

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes for who reads the table."""
        logs = (ORIGINAL_LOGS,) if self.name == "kiper2019" else ()
        if self.force_extremes is None:
            return logs
        return (
            *logs,
            f"{self.force_extremes.contradiction()} testbench predict names what can reconcile them, and what cannot.",
        )

    def condition(self, *stated: object) -> Printed | None:
        """The printed condition that the ``stated`` one is, in the order of CONDITIONS; None if there is none.

        Payloads match rounded; what the table leaves empty, or has no column for, must not be stated.
        """
        return next((printed for printed in self.rows if _is(printed, stated)), None)

    def reduction(
        self, payload_kg: float | None, motion: str, peak_g: float | None, axis: str, peak_rad_s2: float | None = None
    ) -> float | None:
        """The printed reduction [%] of a condition and axis; None if there is none."""
        printed = self.condition(payload_kg, motion, peak_g, peak_rad_s2)
        return None if printed is None else self.rows[printed].get(axis)


def _is(printed: Printed, stated: Sequence[object]) -> bool:
    """Whether two conditions are the same, in the order of CONDITIONS, numbers but for how they are rounded."""
    return all(
        abs(one - other) <= within if isinstance(one, float) and isinstance(other, float | int) else one == other
        for one, other, within in zip(printed, stated, (LABEL_STEP_KG / 2.0, 0.0, 1e-6, 1e-6), strict=False)
    )


class ReductionsTable(Table):
    """Printed reductions: a row a condition."""

    definition: Text
    """How amplitudes were taken, by the source."""
    columns: list[Text]
    """Names of the columns: of a run table's ``payload_kg``, ``motion``, ``peak_acceleration_g``,
    ``peak_acceleration_rad_s2`` those that its conditions state, then ``x_axis`` and so on."""
    rows: Annotated[list[list[Annotated[float, Strict()] | str | None]], Field(min_length=1)]
    """The condition, and the reduction along each axis [%], as printed; null where none is."""

    @property
    def by_condition(self) -> dict[Printed, dict[str, float]]:
        """Reductions [%] by axis, by condition."""
        found: dict[Printed, dict[str, float]] = {}
        for row in self.rows:
            cells = dict(zip(self.columns, row, strict=True))
            axes = {name.removesuffix("_axis"): cell for name, cell in cells.items() if name not in CONDITIONS}
            found[tuple(map(cells.get, CONDITIONS))] = {a: x for a, x in axes.items() if isinstance(x, float)}
        return found

    def _check(self) -> None:
        for k, name in enumerate(self.columns):
            if name not in (known := [*CONDITIONS, *AXES]):
                raise DataError(f"columns: {name!r}: expected some of {', '.join(known)}{suggestion(name, known)}")
            if name in self.columns[:k]:
                raise DataError(f"columns: {name!r} is there twice: remove one")
        if "motion" not in self.columns or not set(self.columns) - set(CONDITIONS):
            raise DataError("columns: expected motion, and an axis such as x_axis")
        for i, row in enumerate(self.rows):
            if len(row) != len(self.columns):
                raise DataError(f"rows[{i}]: has {len(row)} values: expected {len(self.columns)}, one for each column")
            for name, cell in zip(self.columns, row, strict=True):
                least, most = (-math.inf, 100.0) if name in AXES else (0.0, math.inf)
                number = isinstance(cell, float) and math.isfinite(cell) and least <= cell <= most
                if not (isinstance(cell, str) and cell if name == "motion" else cell is None or number):
                    numbers = "a number of at most 100 [%], or null" if name in AXES else "a number from 0 on, or null"
                    expected = "the name of a motion" if name == "motion" else numbers
                    raise DataError(f"rows[{i}]: {name}: {cell!r}: expected {expected}")
        stated = [tuple(map(dict(zip(self.columns, row, strict=True)).get, CONDITIONS)) for row in self.rows]
        for i, one in enumerate(stated):
            if again := [k for k in range(i) if _is(stated[k], one)]:
                raise DataError(f"rows[{i}]: the condition of rows[{again[0]}]: expected each once, payloads rounded")


class PublishedTable(Table):
    """A published table of reductions, JSON; keys that are not listed here are notes."""

    model_config = ConfigDict(extra="ignore")

    source: Text
    """Where it was published."""
    acceleration_amplitude_reduction_percent: ReductionsTable
    """The table."""
    tests: dict[str, Any] = Field(default_factory=dict)
    """About the tests; ``force_x_motion_5kg_3g``: printed extremes of the force sensors [N]."""


def load_published(name: str) -> Published:
    """A shipped table by name, such as ``kiper2019``, or a file of the same form. Raises AnalysisError for another."""
    try:
        path = datasets.find_dataset(name, "published", ".json")
        document = json_document(read_text(path), path.name)
    except DataError as error:
        raise AnalysisError(str(error)) from error
    table = model_from_table(PublishedTable, document, path.name, AnalysisError)
    reductions = table.acceleration_amplitude_reduction_percent
    rows = reductions.by_condition
    try:
        extremes = ForceExtremes.of(table.tests, rows.get((PAYLOAD_KG, MOTION, PEAK_G, None), {}).get(MOTION))
    except (ValueError, KeyError, TypeError) as error:
        raise AnalysisError(f"{path.name}: tests.{_EXTREMES}: expected the least and the largest force [N]") from error
    return Published(path.stem, table.source, reductions.definition, rows, extremes)


def _reduction(without: float, balanced: float) -> float:
    return 100.0 * (1.0 - balanced / without)
