"""Figures of balancing: a linkage before and after, methods as bars, potential energy with springs, sweeps."""

from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from ..dynamics.inverse_dynamics import NOTHING, Response
from ..linkages.verification import COLUMNS, Verification
from ..results import name_and_unit
from . import panels

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..balancing.methods import Methods
    from ..balancing.sweep import Designs
    from ..balancing.tolerance import ToleranceAnalysis
    from ..balancing.tradeoff import Front

_DRIVES = {
    "torque_rms_Nm": "largest motor torque, RMS [N m]", "drive_force_rms_N": "largest force of slides, RMS [N]",
}  # fmt: skip
_STAGE = {
    "before": ("before", "#555555", "-"),
    "force": ("counter-masses", "#3b6ea5", "-"),
    "complete": ("and gears", "#e07a3f", "--"),
    "built": ("as built", "#2a9d8f", ":"),
}
"""Label, colour and line: dashed, as it lies on the one of counter-masses where both are zero."""


def draw_stages(check: Verification, title: str = "") -> "Figure":
    """Time series of all stages, at constant speed on the left and at varying speed on the right."""
    figure, drawn = panels(9.0, 8.4, len(COLUMNS), 2, sharey="row", sharex="col")
    for column, (label, run) in enumerate(zip(check.labels, (check.constant, check.varying), strict=True)):
        for row, quantity in enumerate(COLUMNS):
            for stage in run.responses:
                name, colour, line = _STAGE[stage]
                series = run.trajectory.time, run.series(stage)[quantity]
                drawn[row, column].plot(*series, line, color=colour, label=name, lw=1.4)
        drawn[0, column].set_title(label)
        drawn[-1, column].set_xlabel("time [s]")
    for row, quantity in enumerate(COLUMNS):
        drawn[row, 0].set_ylabel("{} [{}]".format(*titled(quantity)))
    drawn[0, 0].legend(fontsize=8)
    figure.suptitle(f"{title} (simulated)".strip())
    return figure


def draw_methods(found: "Methods") -> "Figure":
    """Residual force and moment, largest drive torque, and added mass of each method."""
    rows = found.rows[::-1]
    values_of = {
        "shaking force, RMS [N]": [row["force_rms_N"] for row in rows],
        "shaking moment, RMS [N m]": [row["moment_rms_Nm"] for row in rows],
        **{label: [max(row[key].values()) for row in rows] for key, label in _DRIVES.items() if rows[0][key]},
        "added mass [kg]": [row["added_mass_kg"] for row in rows],
    }
    figure, drawn = panels(12, 0.42 * len(rows) + 1.4, 1, len(values_of), grid=False, sharey=True)
    for axes, (label, values) in zip(drawn[0], values_of.items(), strict=True):
        bars = axes.barh([row["method"] for row in rows], values, color="#3b6ea5")
        axes.bar_label(bars, [f"{value:.3g}" if value > 1e-9 else "0" for value in values], padding=3, fontsize=8)
        axes.set_title(label, fontsize=10)
        axes.margins(x=0.22)
    figure.suptitle(f"{found.mechanism.name}, motion {found.motion}: simulated")
    return figure


def draw_energy(document: dict[str, Any]) -> "Figure":
    """Energy of weight, of springs, and their sum, at configurations of the workspace ordered by weight."""
    workspace = {name: np.array(values) for name, values in document["workspace"].items() if values is not None}
    order = np.argsort(workspace["weight_J"])
    curves = {
        "weight": (workspace["weight_J"], "#555555", "-"),
        "springs": (workspace["springs_J"], "#e07a3f", "-"),
        "weight and springs": (workspace["weight_J"] + workspace["springs_J"], "#3b6ea5", "-"),
    }
    if "with_counter_masses_J" in workspace:
        curves["with counter-masses"] = (workspace["with_counter_masses_J"], "#2a9d8f", "--")
    figure, ((axes,),) = panels(7.5, 4.2)
    for label, (values, colour, style) in curves.items():
        axes.plot(np.arange(len(order)), (values - values.mean())[order], style, color=colour, label=label, lw=1.6)
    axes.set(xlabel="configurations of the workspace, by height of weight", ylabel="potential energy less its mean [J]")
    axes.set_title(f"{document['mechanism']}: static balance, computed")
    axes.legend()
    return figure


def draw_sweep(designs: "Designs") -> "Figure":
    """What the designs of a sweep are ranked by [N, N m], over one variable or as cells over two; the best marked.

    Of further variables each place shows its best values, which the title says. Nothing is drawn between designs.
    """
    ranked, shown = designs.table(), designs.ranked_by
    varying = [name for name in designs.varied if ranked[name].nunique() > 1] or list(designs.varied[:1])
    drawn, hidden = varying[:2], varying[2:]
    split = {name: name_and_unit(name) for name in designs.varied}
    called = {shown: titled(shown)} | {name: (", ".join(n.rsplit("_", 1)), unit) for name, (n, unit) in split.items()}
    labels = {name: "{} [{}]".format(*one) for name, one in called.items()}
    cells, best = ranked.drop_duplicates(drawn).sort_values(drawn[0]), ranked.iloc[0]
    upwards = shown if len(drawn) == 1 else drawn[1]
    at = best[drawn[0]], best[upwards]
    figure, ((axes,),) = panels(7.0, 4.5, grid=len(drawn) == 1)
    axes.set(xlabel=labels[drawn[0]], ylabel=labels[upwards])
    if len(drawn) == 1:
        axes.plot(cells[drawn[0]], cells[shown], ".-", lw=0.8, color="#3b6ea5")
        axes.set_ylim(bottom=-0.05 * cells[shown].max())  # so that a star at zero is seen whole
    else:
        places = cells.pivot(index=drawn[1], columns=drawn[0], values=shown)
        x, y = np.array(places.columns), np.array(places.index)
        mesh = axes.pcolormesh(x, y, places, shading="nearest")
        figure.colorbar(mesh, label=labels[shown])
        if all(np.diff(values).min() >= _WRITTEN * np.ptp(values) for values in (x, y)):
            axes.set_xticks(x, [f"{value:.3g}" for value in x])
            axes.set_yticks(y, [f"{value:.3g}" for value in y])
            for (i, k), value in np.ndenumerate(places):
                text = f"{value:.3g}" if (x[k], y[i]) != at else ""
                colour = "black" if mesh.norm(value) > 0.5 else "white"
                axes.text(x[k], y[i], text, color=colour, fontsize=7, ha="center", va="center")
    label = "; ".join(f"{words} = {best[name]:.4g} {unit}" for name, (words, unit) in called.items())
    axes.plot(*at, "*", ms=13, mfc="white", mec="black", ls="none", label=fill(f"best: {label}", 90))
    figure.legend(loc="outside lower center", fontsize=8)
    over = "; at each place the least over " + "; ".join(called[name][0] for name in hidden) if hidden else ""
    axes.set_title(fill(f"simulated{over}", 80), fontsize=10)
    return figure


_WRITTEN = 0.09
"""Least step of a variable, of its range, with which the value of each cell is written into it."""


def draw_front(found: "Front") -> "Figure":
    """Moment and torque of the points of a front over their force, coloured by added mass."""
    front = found.points
    force, mass = [one.force for one in front], [one.added_mass for one in front]
    costs = {"moment RMS [N m]": [one.moment for one in front]}
    if front[0].torque is not None:
        costs["torque RMS [N m]"] = [one.torque or 0.0 for one in front]
    figure, drawn = panels(4.5 * len(costs) + 1.0, 4.2, 1, len(costs))
    for axes, (label, values) in zip(drawn[0], costs.items(), strict=True):
        dots = axes.scatter(force, values, c=mass, s=22)
        axes.set(xlabel="force RMS [N]", ylabel=label)
    figure.colorbar(dots, label="added mass [kg]")
    figure.suptitle(f"{found.mechanism}, motion {found.motion}: simulated")
    return figure


def draw_tolerances(found: "ToleranceAnalysis") -> "Figure":
    """Share of each tolerance in the mean square force that errors add."""
    effects = found.effects[::-1]
    figure, ((axes,),) = panels(7.0, 0.4 * len(effects) + 1.6, grid=False)
    axes.barh([one.tolerance.text for one in effects], [100.0 * one.variance_share for one in effects], color="#3b6ea5")
    axes.set(xlabel="share of the mean square force that errors add [%]")
    axes.set_title(f"95 % keep at most {found.percentiles['95']:.4g} N RMS; simulated", fontsize=10)
    return figure


def draw_response(found: Response) -> "Figure":
    """Shaking force, shaking moment and drives over time, a panel a component that is not always zero."""
    shown = [name for name, values in found.columns().items() if np.abs(values).max() > NOTHING]
    return draw_responses({"alone": found}, shown)


_SIDES = {
    "before": ("without counter-masses", "#d55e00"),
    "after": ("with counter-masses", "#0072b2"),
    "alone": ("simulated", "#0072b2"),
}


def draw_responses(responses: Mapping[str, Response], shown: Sequence[str]) -> "Figure":
    """A panel for each component ``shown``, without counter-masses (``before``) and with them (``after``)."""
    figure, drawn = panels(9.0, 1.6 * max(len(shown), 1) + 0.8, max(len(shown), 1), sharex=True, grid=bool(shown))
    for panel, name in zip(drawn[:, 0], shown, strict=False):
        for side, one in responses.items():
            label, colour = _SIDES[side]
            panel.plot(one.time, one.columns()[name], color=colour, label=label, lw=1.2)
        panel.set_ylabel("{} [{}]".format(*titled(name)))
    drawn[-1, 0].set_xlabel("time [s]")
    handles, labels = drawn[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2)
    figure.suptitle("Simulated: what the mechanism exerts on its base, and the drives on it", x=0.01, ha="left")
    return figure


def titled(name: str) -> tuple[str, str]:
    """``Fx`` and ``N`` of ``Fx_N``; ``shaking force RMS`` of ``rms_F_N``."""
    stem, unit = name_and_unit(name)
    kind, _, of = stem.partition("_")
    whole = {"F": "shaking force", "M": "shaking moment"}.get(of, of)
    return {"rms": f"{whole} RMS", "peak": f"{whole} peak"}.get(kind, stem).replace("_", " "), unit
