"""Figure of reductions: analysed from logs, simulated, published."""

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from balance.estimation.estimate import LEVEL_TEXT

from ..published_tables import ORIGINAL_LOGS
from ..vibration.comparison import Comparison, Row
from ..vibration.reduction import Analysis
from ..vibration.run_pairs import masses_text
from . import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LOOKS: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("published", "published, as printed", {"marker": "D", "color": style.PUBLISHED, "ms": 5.5, "mfc": "none"}),
    ("simulated", "simulated, without noise",
     {"marker": "o", "color": style.SIMULATED, "ms": 8.5, "mfc": "none", "mew": 1.8}),
    ("analyzed", "analysed from {} logs", {"marker": "x", "color": style.ANALYSED, "ms": 5.5, "mew": 1.8}),
    ("at_least", "at least", {"marker": "^", "color": style.ANALYSED, "ms": 4.0}),
    ("at_most", "at most", {"marker": "v", "color": style.ANALYSED, "ms": 4.0}),
    ("withheld", "withheld", {"marker": "x", "color": "#bbbbbb", "ms": 5.5}),
)  # fmt: skip
"""Names, labels and looks of the sources, and of what was analysed and is no number, by its kind."""
_MARGIN = 0.8
"""Space before the first and after the last condition [conditions]."""
_FEW, _PLACES, _COLUMNS = 2, 12, 3
"""Points of a sensor and axis that need no panel of their own; sensors and axes of a panel; panels in a row."""


def reductions(compared: Comparison | Analysis) -> "Figure":
    """A panel for each motion, sensor and axis, by payload, counter-masses and acceleration; triangles are bounds.

    Where sensors and axes have a point or two each, they share a panel. A comparison also shows what was simulated and
    published. Several sets of counter-masses are numbered.
    """
    if isinstance(compared, Analysis):
        rows = tuple(Row(r, None, None, None) for r in compared.reductions)
    else:
        rows = compared.rows
    motions = list(dict.fromkeys(row.analyzed.key.motion for row in rows))
    places = list(dict.fromkeys(map(_place, rows)))
    mounted = list(dict.fromkeys(map(_masses, rows)))
    sets = {masses: f"set {i}" if len(mounted) > 1 else "" for i, masses in enumerate(mounted, 1)}
    most = max(Counter((row.analyzed.key.motion, _place(row)) for row in rows).values())
    joint = _PLACES if most <= _FEW else 1
    drawn = defaultdict[tuple[int, int], list[Row]](list)
    for row in rows:
        drawn[motions.index(row.analyzed.key.motion), places.index(_place(row)) // joint].append(row)
    columns = 1 if joint > 1 else min(len(drawn), _COLUMNS)
    with style.styled():
        figure, panels = style.light_grid(-(-len(drawn) // columns), columns, 2.7, sharey=True)
        for panel in panels.flat[len(drawn) :]:
            panel.set_visible(False)
        for panel, ((motion, _), shown) in zip(panels.flat, sorted(drawn.items()), strict=False):
            _panel(panel, shown, sets, f"motion {motions[motion]}" if len(motions) > 1 else "")
        for panel in panels[:, 0]:
            panel.set_ylabel("reduction of the amplitude [%]")
        panels[0, 0].set_ylim(min(0.0, *(_lowest(row) - 10.0 for row in rows)), 105.0)
        _legend(figure, panels[0, 0], rows, " and ".join(compared.origins))
        measure = rows[0].analyzed.measure
        origin = "Simulated campaign: reduction" if set(compared.origins) == {"simulated"} else "Reduction"
        band = f"band {measure.band}" if measure.band else "all frequencies"
        notes = compared.published.notes if isinstance(compared, Comparison) and compared.published else ()
        about = [
            f"{measure.metric.replace('_', '-')}, {band}; lines: intervals of {LEVEL_TEXT}",
            *(f"{name or 'counter-masses'}: {masses}" for masses, name in sets.items()),
            *(note for note in notes if note == ORIGINAL_LOGS),
        ]
        of = f", motion {motions[0]}" if len(motions) == 1 else ""
        style.headline(figure, "\n".join([f"{origin} of base acceleration{of}", *about]))
    return figure


def _place(row: Row) -> tuple[str, str]:
    return row.analyzed.sensor, row.analyzed.axis


def _masses(row: Row) -> str:
    return masses_text(row.analyzed.counter_masses)


def _panel(panel: "Axes", rows: Sequence[Row], sets: Mapping[str, str], title: str) -> None:
    """Conditions of a motion, sensor after sensor, payload after payload and set after set, a gap between two."""

    places = list(dict.fromkeys(map(_place, rows)))
    panel.set_title(", ".join(filter(None, (title, " along ".join(places[0]) if len(places) == 1 else ""))))

    def group(row: Row) -> tuple[int, float, tuple[tuple[str, float], ...], int]:
        key = row.analyzed.key
        return places.index(_place(row)), key.payload_kg or 0.0, key.payloads, list(sets).index(_masses(row))

    def text(row: Row) -> str:
        place = " ".join(_place(row)) if len(places) > 1 else ""
        return "\n".join(filter(None, (place, _payload(row), sets[_masses(row)])))

    rows = sorted(rows, key=lambda row: (group(row), _peak(row)))
    groups = {group(row): text(row) for row in rows}
    at = np.array([i + list(groups).index(group(row)) for i, row in enumerate(rows)], dtype=float)
    for name, _, look in _LOOKS:
        panel.plot(at, np.array([_value(row, name) for row in rows], dtype=float), ls="none", **look)
    for x, row in zip(at, rows, strict=True):
        if row.analyzed.interval:
            panel.vlines(x, *row.analyzed.interval, color=style.ANALYSED, lw=1.2)
    panel.axhline(0.0, color="k", lw=0.8)
    peaks = [_peak(row) for row in rows]
    panel.set_xticks(at, [f"{value:g}" if unit else "" for value, unit in peaks], fontsize=8)
    middles = [float(np.mean([x for x, row in zip(at, rows, strict=True) if group(row) == one])) for one in groups]
    below = panel.secondary_xaxis(0.0)  # a second line of labels
    units = " or ".join(dict.fromkeys(unit for _, unit in peaks if unit))
    below.set_xticks(middles, [f"\n{text}" if units else text for text in groups.values()], fontsize=8)
    below.tick_params(length=0, pad=6)
    told = {f"peak acceleration [{units}]": units, "sensor and axis": len(places) > 1}
    told |= {"payload": any(map(_payload, rows)), "counter-masses": any(sets.values())}
    below.set_xlabel(", ".join(name for name, shown in told.items() if shown))
    panel.set_xlim(at[0] - _MARGIN, at[-1] + _MARGIN)
    panel.grid(axis="x", visible=False)


def _value(row: Row, name: str) -> float | None:
    """What a source says, or what was analysed where it is of this kind [%]; None for nothing."""
    one = row.analyzed
    if name in ("published", "simulated"):
        value: float | None = getattr(row, name)
        return value
    if name != (one.kind if one.kind in {known for known, *_ in _LOOKS} else "analyzed"):
        return None
    return one.percent if one.at_least is None else one.at_least


def _payload(row: Row) -> str:
    """Payload of a condition, one a line where several bodies or sites carry one."""
    key = row.analyzed.key
    whole = "" if key.payload_kg is None else f"{key.payload_kg:g} kg"
    return "\n".join(filter(None, (whole, masses_text(key.payloads_kg).replace(", ", "\n"))))


def _peak(row: Row) -> tuple[float, str]:
    """Peak acceleration of a condition and its unit; empty for none."""
    key = row.analyzed.key
    if key.peak_acceleration_g is not None:
        return key.peak_acceleration_g, "g0"
    return (0.0, "") if key.peak_acceleration_rad_s2 is None else (key.peak_acceleration_rad_s2, "rad/s2")


def _lowest(row: Row) -> float:
    """The lowest value of a row [%], the interval's lower end included down to -100 %."""
    end = max(row.analyzed.interval[0], -100.0) if row.analyzed.interval else None
    return min((v for v in (row.analyzed.percent, end, row.simulated, row.published) if v is not None), default=0.0)


def _legend(figure: "Figure", panel: "Axes", rows: Sequence[Row], kinds: str) -> None:
    """A legend of the sources that the rows have."""
    bench = " (bench assumed)" if any(row.bench == "assumed" for row in rows) else ""
    handles = [
        panel.plot([], [], ls="none", label=label.format(kinds) + bench * (name == "simulated"), **look)[0]
        for name, label, look in _LOOKS
        if any(_value(row, name) is not None for row in rows)
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
