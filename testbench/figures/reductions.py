"""Figure of reductions: analysed from logs, simulated, published."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..published_tables import ORIGINAL_LOGS
from ..vibration.comparison import Comparison, Row
from ..vibration.reduction import Analysis
from . import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LOOKS: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("published", "published, as printed", {"marker": "D", "color": style.PUBLISHED, "ms": 5.5, "mfc": "none"}),
    ("simulated", "simulated, without noise",
     {"marker": "o", "color": style.SIMULATED, "ms": 8.5, "mfc": "none", "mew": 1.8}),
    ("analyzed", "analysed from {} logs", {"marker": "x", "color": style.ANALYSED, "ms": 5.5, "mew": 1.8}),
)  # fmt: skip
_MARGIN = 0.8
"""Space before the first and after the last condition [conditions]."""
_LOWER_BOUND: dict[str, Any] = {"marker": "^", "color": style.ANALYSED, "ms": 4.0}


def reductions(compared: Comparison | Analysis) -> "Figure":
    """A panel for each motion, sensor and axis, by payload and acceleration; triangles are lower bounds.

    A comparison also shows what was simulated and published.
    """
    if isinstance(compared, Analysis):
        rows = tuple(Row(r, None, None, None) for r in compared.reductions)
    else:
        rows = compared.rows
    motions = list(dict.fromkeys(row.analyzed.key.motion for row in rows))
    places = list(dict.fromkeys(_place(row) for row in rows))
    with style.styled():
        figure, panels = style.light_grid(len(motions), len(places), 2.7, sharey=True)
        for line, motion in zip(panels, motions, strict=True):
            for panel, place in zip(line, places, strict=True):
                _panel(panel, [r for r in rows if r.analyzed.key.motion == motion and _place(r) == place])
                name = "base" if len({sensor for sensor, _ in places}) == 1 else place[0]
                panel.set_title(f"motion {motion}, {name} along {place[1]}")
            line[0].set_ylabel("reduction of the amplitude [%]")
        panels[0, 0].set_ylim(min(0.0, *(_lowest(row) - 10.0 for row in rows)), 105.0)
        turning = any(row.analyzed.key.peak_acceleration_rad_s2 is not None for row in rows)
        for panel in panels[-1]:
            panel.set_xlabel(f"peak acceleration [{'rad/s2' if turning else 'g0'}], by payload")
        _legend(figure, panels[0, 0], rows, " and ".join(compared.origins))
        measure = rows[0].analyzed.measure
        origin = "Simulated campaign: reduction" if set(compared.origins) == {"simulated"} else "Reduction"
        band = f"band {measure.band}" if measure.band else "all frequencies"
        notes = compared.published.notes if isinstance(compared, Comparison) and compared.published else ()
        about = [f"{measure.metric.replace('_', '-')}, {band}", *(note for note in notes if note == ORIGINAL_LOGS)]
        style.headline(figure, "\n".join([f"{origin} of base acceleration", *about]))
    return figure


def _place(row: Row) -> tuple[str, str]:
    return row.analyzed.sensor, row.analyzed.axis


def _panel(panel: "Axes", rows: Sequence[Row]) -> None:
    """Conditions of one motion and axis, payload after payload, a gap between two."""
    rows = sorted(rows, key=lambda r: (r.analyzed.key.payload_kg or 0.0, _peak(r)[0]))
    payloads = list(dict.fromkeys(row.analyzed.key.payload_kg for row in rows))
    at = np.array([i + payloads.index(row.analyzed.key.payload_kg) for i, row in enumerate(rows)], dtype=float)
    estimates = [row.analyzed.percent if row.analyzed.at_least is None else None for row in rows]
    for name, _, look in _LOOKS:
        values = estimates if name == "analyzed" else [getattr(row, name) for row in rows]
        panel.plot(at, np.array(values, dtype=float), ls="none", **look)
    for x, row in zip(at, rows, strict=True):
        if row.analyzed.interval:
            panel.vlines(x, *row.analyzed.interval, color=style.ANALYSED, lw=1.2)
        if row.analyzed.at_least is not None:
            panel.plot(x, row.analyzed.at_least, **_LOWER_BOUND)
    panel.set_xticks(at, [_peak(row)[1] for row in rows], fontsize=8)
    for payload in payloads:
        here = [x for x, row in zip(at, rows, strict=True) if row.analyzed.key.payload_kg == payload]
        label, place = "" if payload is None else f"{payload:g} kg", panel.get_xaxis_transform()
        panel.text(float(np.mean(here)), 0.02, label, transform=place, ha="center", color="#555555")
    panel.set_xlim(at[0] - _MARGIN, at[-1] + _MARGIN)
    panel.grid(axis="x", visible=False)


def _peak(row: Row) -> tuple[float, str]:
    """Peak acceleration of a condition [g0 or rad/s2], and its text."""
    key = row.analyzed.key
    value = key.peak_acceleration_rad_s2 if key.peak_acceleration_g is None else key.peak_acceleration_g
    return (0.0, "") if value is None else (value, f"{value:g}")


def _lowest(row: Row) -> float:
    """The lowest value of a row [%], the interval's lower end included down to -100 %."""
    end = max(row.analyzed.interval[0], -100.0) if row.analyzed.interval else None
    return min((v for v in (row.analyzed.percent, end, row.simulated, row.published) if v is not None), default=0.0)


def _legend(figure: "Figure", panel: "Axes", rows: Sequence[Row], kinds: str) -> None:
    """A legend of the sources that the rows have."""
    handles = [
        panel.plot([], [], ls="none", label=label.format(kinds), **look)[0]
        for name, label, look in _LOOKS
        if any(getattr(row, name) is not None for row in rows)
    ]
    if any(row.analyzed.at_least is not None for row in rows):
        handles += panel.plot([], [], ls="none", label="at least", **_LOWER_BOUND)
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
