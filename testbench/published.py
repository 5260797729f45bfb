"""Printed tables of reductions (``datasets/published``), as printed."""

import json
import math
from dataclasses import dataclass

from balance import datasets
from balance.errors import DataError

from .errors import AnalysisError
from .publication.slide import MOTION, PAYLOAD_KG, PEAK_G, ForceSlide

LABEL_STEP_KG = 0.01
"""Payloads are printed to two decimals [kg]: 1.451 kg as 1.45, 3.4116 kg as 3.41."""
ORIGINAL_LOGS = "The original logs of the manipulator tests are not available: only these printed numbers are."
NO_ORIGINALS = "The original logs of the manipulator tests are not available: what is shown for them here is simulated."
"""Beside reductions of simulated runs of that manipulator."""
MANIPULATOR = "parallelogram-6bar"
"""Beginning of the names of the mechanisms that stand for it."""
_TABLE = "acceleration_amplitude_reduction_percent"


@dataclass(frozen=True)
class Published:
    """A printed table: reductions of amplitude [%] by payload as printed [kg], motion, peak acceleration [g0]."""

    name: str
    source: str
    definition: str
    """What the source says on how amplitudes were taken."""
    rows: dict[tuple[float, str, float], dict[str, float]]
    slide: ForceSlide | None = None
    """Extremes of force sensors that are printed beside the table."""

    @property
    def notes(self) -> tuple[str, ...]:
        """What a reader of the table must know."""
        logs = (ORIGINAL_LOGS,) if self.name == "kiper2019" else ()
        if self.slide is None:
            return logs
        return (*logs, f"{self.slide.contradiction()} testbench predict says what can reconcile them, and what cannot.")

    def reduction(self, payload_kg: float, motion: str, peak_acceleration_g: float, axis: str) -> float | None:
        """The printed reduction [%] of a condition and axis, or None if there is none.

        A payload has the label that is nearest to it, if it rounds to that label.
        """
        for (label, moved, acceleration), axes in self.rows.items():
            near = abs(payload_kg - label) <= LABEL_STEP_KG / 2.0
            if near and moved == motion and abs(acceleration - peak_acceleration_g) < 1e-6:
                return axes.get(axis)
        return None


def load(name: str) -> Published:
    """A shipped table by name, such as ``kiper2019``, or a file of the same form."""
    try:
        path = datasets.find(name, "published", ".json")
        document = json.loads(path.read_text(encoding="utf-8"))
        table = document[_TABLE]
        axes = [column.removesuffix("_axis") for column in table["columns"][3:]]
        rows = {
            (float(payload), str(motion), float(acceleration)): dict(zip(axes, map(float, percents), strict=True))
            for payload, motion, acceleration, *percents in table["rows"]
        }
        for condition, percents in rows.items():
            if not all(map(math.isfinite, (*percents.values(), condition[0], condition[2]))):
                raise AnalysisError(f"{path.name}: {condition} has {percents}: expected numbers")
        slide = ForceSlide.of(document.get("tests", {}), _axis(rows, PAYLOAD_KG, MOTION, PEAK_G))
        return Published(path.stem, str(document["source"]), str(table["definition"]), rows, slide)
    except DataError as error:
        raise AnalysisError(str(error)) from error
    except (UnicodeDecodeError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise AnalysisError(
            f"{name}: not a table of published reductions: expected JSON with {_TABLE}: columns, rows, definition"
        ) from error


def _axis(
    rows: dict[tuple[float, str, float], dict[str, float]], payload: float, motion: str, acceleration: float
) -> float | None:
    """The printed reduction along the motion [%]."""
    return rows.get((payload, motion, acceleration), {}).get(motion)
