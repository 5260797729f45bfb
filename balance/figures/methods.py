"""The named methods side by side, as bars drawn from their document."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_NOTHING = 1e-9


def draw_methods(document: dict[str, Any]) -> "Figure":
    """Residual force and moment, largest drive torque, and added mass of each method."""
    from matplotlib.figure import Figure

    rows = document["methods"][::-1]
    panels = {
        "shaking force, RMS [N]": [row["force_rms_N"] for row in rows],
        "shaking moment, RMS [N m]": [row["moment_rms_Nm"] for row in rows],
        "largest motor torque, RMS [N m]": [max(row["torque_rms_Nm"].values(), default=0.0) for row in rows],
        "added mass [kg]": [row["added_mass_kg"] for row in rows],
    }
    figure = Figure(figsize=(12, 0.42 * len(rows) + 1.4), layout="constrained")
    for axes, (label, values) in zip(figure.subplots(1, 4, sharey=True), panels.items(), strict=True):
        bars = axes.barh([row["method"] for row in rows], values, color="#3b6ea5")
        axes.bar_label(bars, [f"{value:.3g}" if value > _NOTHING else "0" for value in values], padding=3, fontsize=8)
        axes.set_title(label, fontsize=10)
        axes.margins(x=0.22)
    figure.suptitle(f"{document['mechanism']}, motion {document['motion']}: simulated")
    return figure
