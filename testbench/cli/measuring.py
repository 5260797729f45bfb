"""Options that say how an amplitude is taken, and how reductions are printed."""

import re
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

import click

if TYPE_CHECKING:
    from ..comparison import Comparison
    from ..findings import Finding
    from ..reductions import Analysis, Reduction
    from ..signals import Band
    from ..vibration import Measure

F = TypeVar("F", bound=Callable[..., Any])
_NUMBER = r"(\d+\.?\d*)"


class BandText(click.ParamType["Band | None"]):
    """``LO..HI`` in Hz as a band, ``none`` as None."""

    name = "lo..hi"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> "Band | None":  # noqa: ANN401
        """Read the text; a wrong one fails as a wrong command line."""
        from ..errors import AnalysisError
        from ..signals import Band

        if not isinstance(value, str) or value == "none":
            return None if value == "none" else value
        match = re.fullmatch(rf"{_NUMBER}?\s*\.\.\s*{_NUMBER}\s*(?:Hz)?", value.strip())
        if match is None:
            self.fail(f"{value!r}: expected two frequencies in Hz such as 1..200, or none", param, ctx)
        try:
            return Band(float(match[1] or 0.0), float(match[2]))
        except AnalysisError as error:
            self.fail(str(error), param, ctx)


def measure_options(command: F) -> F:
    """Add ``--metric`` and ``--band``."""
    metric = click.option(
        "--metric",
        type=click.Choice(["peak", "peak_to_peak", "rms"]),
        default="peak_to_peak",
        show_default=True,
        help="What an amplitude is.",
    )
    band = click.option(
        "--band",
        type=BandText(),
        default="0..200",
        show_default=True,
        help="Frequencies that count [Hz], zero-phase Butterworth; none: all.",
    )
    return metric(band(command))


def measure(metric: Any, band: "Band | None") -> "Measure":  # noqa: ANN401
    """The measure that the options ask for."""
    from ..vibration import Measure

    return Measure(metric, band)


def per_cent(value: float | None) -> str:
    """One decimal, or a dash where there is none."""
    return "-" if value is None else f"{value:.1f}"


def fell(reduction: "Reduction") -> str:
    """``94.2 [93.1, 95.0]``; a lower bound as ``>= 97.2``, with what bounds it."""
    if reduction.limit == "at_least" and reduction.at_least is not None:
        return f">= {per_cent(reduction.at_least)} {'< noise' if reduction.below_noise else 'clipped'}"
    value = per_cent(reduction.percent)
    if reduction.limit == "at_most":
        return f"<= {value} clipped"
    if reduction.interval is None:
        return value
    return f"{value} [{', '.join(map(per_cent, reduction.interval))}]"


def draw(found: "Analysis | Comparison", file: str) -> None:
    """Draw the reductions of an analysis, or of a comparison."""
    from balance.figures.drawing import save

    from ..figures.reductions import reductions

    save(reductions(found), file)


def mounted(reductions: Sequence["Reduction"]) -> list[str]:
    """Counter-masses of each reduction as ``12.5 + 12.9`` [kg], where a condition has several sets; else blanks."""
    sets: dict[object, set[str]] = {}
    texts = [" + ".join(f"{mass:g}" for mass in r.counter_masses.values()) for r in reductions]
    for r, text in zip(reductions, texts, strict=True):
        sets.setdefault(r.key, set()).add(text)
    return texts if any(len(several) > 1 for several in sets.values()) else [""] * len(texts)


def with_sets(
    header: list[str], rows: list[list[str]], reductions: Sequence["Reduction"]
) -> tuple[list[str], list[list[str]]]:
    """The table with a column of the counter-masses after the acceleration, where they tell rows apart."""
    sets = mounted(reductions)
    if not any(sets):
        return header, rows
    at = header.index("peak g0") + 1
    wider = [[*row[:at], text, *row[at:]] for row, text in zip(rows, sets, strict=True)]
    return [*header[:at], "counter-masses kg", *header[at:]], wider


def print_findings(findings: Iterable["Finding"]) -> None:
    """What could not be analysed or is doubtful, a line each."""
    for finding in findings:
        click.echo(f"  {finding.code}: {finding.message}")


def origins(counts: dict[str, int]) -> str:
    """``52 of 52 runs are simulated``."""
    total = sum(counts.values())
    parts: Sequence[str] = [f"{count} of {total} runs are {origin}" for origin, count in counts.items()]
    return "; ".join(parts) + "."
