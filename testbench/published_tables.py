"""Published tables of reductions (``datasets/published``), with the numbers as printed."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import ConfigDict, Field

from balance import datasets
from balance.errors import DataError
from balance.input_files import Table, Text, json_document, model_from_table, read_text
from balance.results import Key

from .errors import AnalysisError

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
    """A published table: reductions [%] by axis, by payload as printed [kg], motion and peak acceleration [g0]."""

    name: Annotated[str, Key()]
    source: Annotated[str, Key()]
    definition: Annotated[str, Key()]
    """How amplitudes were taken, by the source."""
    rows: dict[tuple[float, str, float], dict[str, float]]
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

    def reduction(self, payload_kg: float, motion: str, peak_acceleration_g: float, axis: str) -> float | None:
        """The printed reduction [%] of a condition and axis; None if there is none. Payloads match rounded."""
        for (printed_kg, printed_motion, acceleration), axes in self.rows.items():
            near = abs(payload_kg - printed_kg) <= LABEL_STEP_KG / 2.0
            if near and printed_motion == motion and abs(acceleration - peak_acceleration_g) < 1e-6:
                return axes.get(axis)
        return None


class ReductionsTable(Table):
    """Printed reductions: a row a condition."""

    definition: Text
    """How amplitudes were taken, by the source."""
    columns: Annotated[list[Text], Field(min_length=4)]
    """Names of the columns: payload [kg], motion, peak acceleration [g0], then ``x_axis`` and so on."""
    rows: Annotated[list[list[float | str]], Field(min_length=1)]
    """Payload [kg], motion, peak acceleration [g0], and the reduction along each axis [%], as printed."""

    @property
    def by_condition(self) -> dict[tuple[float, str, float], dict[str, float]]:
        """Reductions [%] by axis, by payload [kg], motion and peak acceleration [g0]."""
        axes = [column.removesuffix("_axis") for column in self.columns[3:]]
        return {
            (float(payload), str(motion), float(peak)): dict(zip(axes, map(float, percents), strict=True))
            for payload, motion, peak, *percents in self.rows
        }

    def _check(self) -> None:
        for i, row in enumerate(self.rows):
            if len(row) != len(self.columns):
                raise DataError(f"rows[{i}]: has {len(row)} values: expected {len(self.columns)}, one for each column")
            numbers = [isinstance(cell, float) and math.isfinite(cell) for cell in row]
            if numbers != [k != 1 for k in range(len(row))]:
                raise DataError(f"rows[{i}]: {row}: expected numbers, but for the motion, a name in the second column")


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
        extremes = ForceExtremes.of(table.tests, rows.get((PAYLOAD_KG, MOTION, PEAK_G), {}).get(MOTION))
    except (ValueError, KeyError, TypeError) as error:
        raise AnalysisError(f"{path.name}: tests.{_EXTREMES}: expected the least and the largest force [N]") from error
    return Published(path.stem, table.source, reductions.definition, rows, extremes)


def _reduction(without: float, balanced: float) -> float:
    return 100.0 * (1.0 - balanced / without)
