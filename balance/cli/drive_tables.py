"""Tables of ``balance drive``."""

from typing import Any

import click

from .console import emit_table


def show(result: dict[str, Any]) -> None:
    """Print a study: reduced inertia, steady rotation, flywheels, start-up, solvers, findings."""
    _print_reduced(result)
    _print_steady(result)
    _print_flywheels(result)
    _print_start_up(result)
    _print_convergence(result)
    for finding in result["findings"]:
        click.echo(f"Finding: {finding}")


def _print_reduced(result: dict[str, Any]) -> None:
    rows = []
    for key, label in (("reduced", "mechanism"), ("reduced_with_counter_masses", "with counter-masses")):
        for extreme in result.get(key, {}).get("mechanism_inertia_extremes", []):
            total = extreme["inertia_kgm2"] + result[key]["constant_inertia_kgm2"]
            values = [extreme["inertia_kgm2"], total]
            rows.append([label, extreme["kind"], f"{extreme['angle_deg']:.2f}", *(f"{v:.5f}" for v in values)])
    emit_table(
        f"Reduced inertia of {result['mechanism']} at the crank {result['reduced']['crank']}",
        ["", "extreme", "angle [deg]", "mechanism [kg m2]", "with shafts [kg m2]"],
        rows,
        f"{result['reduced']['closed_positions']} closed positions, harmonics down to "
        f"{result['reduced']['highest_harmonics']:.0e}; potential energy swings by "
        f"{result['reduced']['potential_swing_J']:.3f} J",
    )


def _print_steady(result: dict[str, Any]) -> None:
    rows = []
    for row in result["steady"]:
        printed = row["printed"] or {}
        rows.append([
            *_setting(row), f"{row['fastest_rpm']:.3f} at {row['fastest_at_deg']:.1f}",
            f"{row['slowest_rpm']:.3f} at {row['slowest_at_deg']:.1f}", f"{row['mean_rpm']:.3f}",
            f"{row['fluctuation']['nominal']:.4f}", _printed(printed.get("fluctuation")),
            f"{row['floquet_factor']:.3g}", f"{row['periodicity']:.0e}",
        ])  # fmt: skip
    emit_table(
        "Steady rotation of the crank",
        [*_SETTING, "n_max [rpm] at [deg]", "n_min [rpm] at [deg]", "mean [rpm]", "fluctuation", "printed", "Floquet",
         "periodicity"],
        rows,
        "Fluctuation = (n_max - n_min) / n_nominal; periodicity: change of speed over one turn integrated apart.",
    )  # fmt: skip
    for name, meaning in result["readings"].items():
        click.echo(f"{name}: {meaning}.")


_SETTING = ["nominal [rpm]", "torque", "counter-masses"]


def _setting(row: dict[str, Any]) -> list[str]:
    return [f"{row['nominal_rpm']:.4g}", row["reading"], "with" if row["counter_masses"] else "without"]


def _printed(value: float | None) -> str:
    return "-" if value is None else f"{value:g}"


def _print_flywheels(result: dict[str, Any]) -> None:
    rows = [
        [*_setting(row), f"{row['wanted_fluctuation']:g}", row["side"], f"{row['inertia_kgm2']:.5f}",
         f"{row['estimate_of_whole_inertia_kgm2']:.4f}"]
        for row in result["flywheel"]
    ]  # fmt: skip
    if rows:
        header = [*_SETTING, "wanted", "shaft", "flywheel [kg m2]", "estimate, whole [kg m2]"]
        note = "The estimate dE / (omega^2 delta) is of the whole inertia, from weight alone, without the motor."
        emit_table("Flywheel for a wanted fluctuation", header, rows, note)


def _print_start_up(result: dict[str, Any]) -> None:
    for run in result["start_up"]:
        rows = [
            [str(t["turn"]), f"{t['end_s']:.4f}", f"{t['fastest_rpm']:.3f}", f"{t['slowest_rpm']:.3f}"]
            for t in run["turns"]
        ]
        settled = run["settled_in_turn"]
        note = f"Steady within 0.1 rpm from turn {settled}." if settled else "Not yet steady within 0.1 rpm."
        title = f"Start-up, {', '.join(_setting(run)[:2])}, {_setting(run)[2]} counter-masses"
        emit_table(title, ["turn", "ends at [s]", "n_max [rpm]", "n_min [rpm]"], rows, note)


def _print_convergence(result: dict[str, Any]) -> None:
    for study in result["convergence"]:
        rows = [
            [t["solver"], t["setting"], f"{t['fluctuation']:.6f}", f"{t['off_percent']:+.2g}",
             "-" if t["evaluations"] is None else str(t["evaluations"])]
            for t in study["trials"]
        ]  # fmt: skip
        title = f"Solvers, {', '.join(_setting(study)[:2])}: {study['converged_fluctuation']:.6f} converged"
        header = ["solver", "setting", "fluctuation", "off [%]", "evaluations"]
        emit_table(title, header, rows, f"Integrated from standstill over {study['turns_integrated']} turns.")
