"""Potential energy over the workspace, with and without static balance, drawn from its document."""

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw_energy(document: dict[str, Any]) -> "Figure":
    """Energy of weight, of springs, and their sum, at configurations of the workspace ordered by weight."""
    from matplotlib.figure import Figure

    workspace = {name: np.array(values) for name, values in document["workspace"].items() if values is not None}
    order = np.argsort(workspace["weight_J"])
    curves = {
        "weight": (workspace["weight_J"], "#555555", "-"),
        "springs": (workspace["springs_J"], "#e07a3f", "-"),
        "weight and springs": (workspace["weight_J"] + workspace["springs_J"], "#3b6ea5", "-"),
    }
    if "with_counter_masses_J" in workspace:
        curves["with counter-masses"] = (workspace["with_counter_masses_J"], "#2a9d8f", "--")
    figure = Figure(figsize=(7.5, 4.2), layout="constrained")
    axes = figure.subplots()
    for label, (values, colour, style) in curves.items():
        axes.plot(np.arange(len(order)), (values - values.mean())[order], style, color=colour, label=label, lw=1.6)
    axes.set(xlabel="configurations of the workspace, by height of weight", ylabel="potential energy less its mean [J]")
    axes.set_title(f"{document['mechanism']}: static balance, computed")
    axes.legend()
    axes.grid(alpha=0.25)
    return figure
