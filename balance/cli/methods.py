"""``balance methods``."""

from math import isnan
from typing import TYPE_CHECKING, Any

import click

from . import options
from .console import emit_json, emit_table, json_option
from .rotor.given import Quantity

if TYPE_CHECKING:
    from ..mechanism import Mechanism
_LENGTH = Quantity("length", positive=True)
UNITS = {
    "rad_per_s": "rad/s", "m_per_s": "m/s", "N_per_m": "N/m", "percent": "%", "kgm2": "kg m2", "Nm": "N m", "kg": "kg",
    "rad": "rad", "m": "m", "N": "N", "W": "W",
}  # fmt: skip
"""Endings of keys, longer ones first, and the units that they stand for."""


@click.command(
    epilog="""\b
Examples:
  balance methods parallelogram-6bar --payload platform=5kg --motion x
  balance methods serial-3r --stroke 50mm --wheel-ratio 3
  balance methods four-bar --figure methods.png --json"""
)
@options.mechanism_argument
@click.option("--motion", metavar="TOML", help="A motion [default: the shipped one of the mechanism's name].")
@options.payload_option
@options.site_option
@click.option(
    "--wheel-ratio",
    type=click.FloatRange(1e-6, 1e6),
    default=1.0,
    show_default=True,
    help="Counter-inertias turn so many times as fast.",
)
@click.option(
    "--wheel-radius",
    type=_LENGTH,
    default="100mm",
    show_default=True,
    metavar="LENGTH",
    help="Of counter-inertias, as discs.",
)
@click.option(
    "--stroke",
    type=_LENGTH,
    default="100mm",
    show_default=True,
    metavar="LENGTH",
    help="Of active masses, from end to end.",
)
@click.option(
    "--turn",
    type=Quantity("angle", positive=True),
    default="360deg",
    show_default=True,
    metavar="ANGLE",
    help="Of the active disc, from end to end.",
)
@options.figure_option
@json_option
def methods(
    mechanism: str,
    motion: str | None,
    payload: tuple[tuple[str, float], ...],
    site: tuple[str, ...],
    wheel_ratio: float,
    wheel_radius: float,
    stroke: float,
    turn: float,
    figure: str | None,
    as_json: bool,
) -> None:
    """The named ways of balancing MECH side by side: what each leaves, costs and needs.

    Springs; counter-masses; with counter-inertias on the base; mirror images of the mechanism; active masses. Printed
    conditions of serial chains and four-bars are held against those derived from the model.
    """
    from ..conditions import find
    from ..methods import document as documents
    from ..methods import printed, side_by_side

    if isnan(wheel_ratio):
        raise click.UsageError("--wheel-ratio: expected a number")
    model = options.load(mechanism, payload)
    name = motion or _own_motion(model.name)
    settings = side_by_side.Settings(site, wheel_ratio, wheel_radius, stroke, turn)
    outcomes = _outcomes(model, name, settings)
    result = documents.document(model.name, name, outcomes, printed.compare(find(model)))
    if figure:
        from ..figures.drawing import save
        from ..figures.methods import draw_methods

        save(draw_methods(result), figure)
    emit_json(result) if as_json else _print(result)


def _own_motion(mechanism: str) -> str:
    from ..datasets import names

    known = names("motions", ".toml")
    if mechanism not in known:
        raise click.UsageError(
            f"no shipped motion has the name of {mechanism}: give one with --motion, a TOML file or one of "
            f"{', '.join(known)}"
        )
    return mechanism


def _outcomes(model: "Mechanism", motion: str, settings: Any) -> Any:  # noqa: ANN401
    from ..closure import Closure
    from ..methods import side_by_side
    from ..motion import DEFAULT_RATE_HZ
    from ..motion.motion_files import load_motion

    trajectory = Closure(model).follow(load_motion(motion).sample(DEFAULT_RATE_HZ))
    return side_by_side.compare(model, trajectory, settings)


def _print(result: dict[str, Any]) -> None:
    rows = [
        [row["method"], f"{row['added_mass_kg']:.3f}", f"{row['added_inertia_kgm2']:.4f}", _value(row["force_rms_N"]),
         _value(row["force_peak_N"]), _value(row["moment_rms_Nm"]), _value(row["moment_peak_Nm"]),
         ", ".join(f"{joint} {value:.3g}" for joint, value in row["torque_rms_Nm"].items())]
        for row in result["methods"]
    ]  # fmt: skip
    emit_table(
        f"{result['mechanism']}, motion {result['motion']}, simulated",
        ["method", "added [kg]", "added [kg m2]", "F RMS [N]", "F peak", "M RMS [N m]", "M peak", "torque RMS [N m]"],
        rows,
        "F and M: what the base still feels, weight excluded; torque: of each motor, all that it drives included.",
    )
    for row in result["methods"]:
        if row["note"]:
            click.echo(f"{row['method']}: {row['note'].removesuffix('.')}.{_needs(row['needs'])}")
    for printed in result["printed_conditions"]:
        click.echo(
            f"Printed conditions, {printed['method']}: {printed['verdict']} ({printed['printed_rank']} printed, "
            f"{printed['derived_rank']} derived)."
        )


def _value(value: float) -> str:
    return f"{value:.4g}" if value > 1e-9 else "0"


def _needs(needs: dict[str, float]) -> str:
    parts = [f"{' '.join(filter(None, _needed(name, value)))}" for name, value in needs.items()]
    return f" Needs {', '.join(parts)}." if parts else ""


def _needed(name: str, value: float) -> tuple[str, str, str]:
    """Name, value and unit of a need whose key ends in its unit."""
    for ending, unit in UNITS.items():
        if name.endswith(f"_{ending}"):
            return name.removesuffix(f"_{ending}").replace("_", " "), f"{value:.4g}", unit
    return name.replace("_", " "), f"{value:.4g}", ""
