"""What is missing on each arm, by each source, and what the plates leave."""

from typing import TYPE_CHECKING

from balance.estimation.estimate import LEVEL_TEXT
from balance.estimation.first_moment_imbalance import MissingMass
from balance.results import counted, first_of

from ..figures import style
from .result import Trim

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_COLOURS = {
    "wrench": style.WITH, "torque": style.ENCODERS, "vibration": style.ACCELEROMETER, "trials": style.ACCELEROMETER,
}  # fmt: skip


def draw(result: Trim) -> "Figure":
    """A panel a site: first moments [kg m] with their intervals, the plates as an arrow from before to after."""
    with style.styled():
        figure, panels = style.light_grid(1, len(result.missing), 3.0, sharey=True)
        for k, axes in enumerate(panels[0]):
            before, after = result.missing[k], result.remaining()[k]
            shown: list[tuple[str, MissingMass, str]] = [
                (s.source, s.missing[k], _COLOURS[s.source]) for s in result.shares
            ]
            if len(result.shares) > 1:
                shown.append(("all", before, style.TARGET))
            shown.append(("with what is added", after, style.WITHOUT))
            for place, (_, one, colour) in enumerate(shown):
                low, high = one.interval
                axes.errorbar(
                    place,
                    one.first_moment.value,
                    [[one.first_moment.value - low], [high - one.first_moment.value]],
                    fmt="o",
                    capsize=5,
                    color=colour,
                )
            axes.set_xticks(range(len(shown)), [name for name, *_ in shown])
            axes.set_xlim(-0.6, len(shown) - 0.4)
            axes.axhline(0.0, color="k", lw=0.8)
            added = next((c for c in result.addition.counter_masses if c.site == before.site), None)
            plates = f"add {added.mass:.3f} kg" if added is not None and added.mass > 0.0 else "add nothing"
            if added is not None and added.plates:
                plates += f" ({counted(added.plates)})"
            axes.set_title(f"{before.site}: {plates}")
        panels[0, 0].set_ylabel("missing first moment [kg m]")
        style.headline(
            figure,
            f"{style.origin_prefix([result.origin])}{result.mechanism.name}, {first_of(result.runs, 4)}\n"
            f"{_level(result)}; residual predicted {result.predicted_residual:.4f} kg m",
        )
    return figure


def _level(result: Trim) -> str:
    return f"intervals{'' if result.interval_level else ', not'} of {LEVEL_TEXT}"
