"""``balance methods`` and ``balance static``: the named methods side by side; static balance by springs."""

from math import isnan
from typing import TYPE_CHECKING, Any

import click

from . import options
from .framework import Answer, Quantity, command, option
from .options import LENGTH
from .printing import cells, emit_table, say

if TYPE_CHECKING:
    from ..balancing.static_balancing import Springs
    from ..mechanism.mechanism import Mechanism

_METHODS = {
    "method": "method", "added [kg]": "added_mass_kg:.3f", "F RMS [N]": "force", "M RMS [N m]": "moment",
    "torque RMS [N m]": "drives",
}  # fmt: skip
_SPRINGS = {
    "from": "first", "to": "second", "stiffness [N/m]": "stiffness_N_per_m:.2f", "length [m]": "length",
    "largest force [N]": "force_peak_N:.1f",
}  # fmt: skip


@command(
    epilog="""\b
Examples:
  balance methods parallelogram-6bar --payload platform=5kg --motion x
  balance methods serial-3r --stroke 50mm --wheel-ratio 3
  balance methods four-bar --figure methods.png --json"""
)
def methods(
    mechanism: str = options.MECHANISM,
    motion: str | None = option("A motion [default: the shipped one of the mechanism's name].", metavar="TOML"),
    payload: options.Masses = options.PAYLOADS,
    site: tuple[str, ...] = options.SITES,
    wheel_ratio: float = option(
        "Counter-inertias turn so many times as fast.", click.FloatRange(1e-6, 1e6), default=1.0
    ),
    wheel_radius: float = option("Radius of counter-inertias, as discs.", LENGTH, default="100mm", metavar="LENGTH"),
    stroke: float = option("Stroke of active masses, from end to end.", LENGTH, default="100mm", metavar="LENGTH"),
    turn: float = option(
        "Turn of the active disc, from end to end.", Quantity("angle", positive=True), default="360deg", metavar="ANGLE"
    ),
    figure: str | None = options.FIGURE,
) -> Answer:
    """Compare the named methods of balancing MECH: residual, cost and needs of each.

    Springs; counter-masses; with counter-inertias on the base; mirror images of the mechanism; active masses. Published
    conditions of serial chains and four-bars are compared with those derived from the model.
    """
    from ..balancing.methods import MethodSettings
    from ..datasets import dataset_names
    from ..front_door import methods as compared

    if isnan(wheel_ratio):
        raise click.UsageError("--wheel-ratio: expected a number")
    model = options.load_mechanism_option(mechanism, payload)
    name = motion or model.name
    if not motion and name not in (known := dataset_names("motions", ".toml")):
        one = f"a TOML file or one of {', '.join(known)}"
        raise click.UsageError(f"no shipped motion has the name of {name}: give one with --motion, {one}")
    found = compared(model, name, MethodSettings(site, wheel_ratio, wheel_radius, stroke, turn))
    options.draw(figure, found.plot)
    result = found.document()
    return Answer(result, lambda: _print_methods(result), further=("methods", "printed_conditions"))


def _print_methods(result: dict[str, Any]) -> None:
    """The least force, then of each method what stays and what it costs."""
    plain, *others = result["methods"]
    best = min(others, key=lambda row: (round(row["force_rms_N"], 9), row["added_mass_kg"]), default=plain)
    say(
        f"Least shaking force: {best['method']}, {_value(best['force_rms_N'])} N RMS of "
        f"{_value(plain['force_rms_N'])} N, with {best['added_mass_kg']:.3f} kg added."
    )
    rows = []
    for row in result["methods"]:
        torques = [f"{joint} {value:.3g}" for joint, value in row["torque_rms_Nm"].items()]
        forces = [f"{joint} {value:.3g} N" for joint, value in row["drive_force_rms_N"].items()]
        sizes = {"force": _value(row["force_rms_N"]), "moment": _value(row["moment_rms_Nm"])}
        rows.append({**row, **sizes, "drives": ", ".join(torques + forces)})
    emit_table(
        f"{result['mechanism']}, motion {result['motion']}, simulated",
        *cells(rows, _METHODS),
        "F and M: residual on the base, weight excluded; torque: of each motor, with all that it drives, a force in N "
        "where it slides.",
    )


def _value(value: float) -> str:
    return f"{value:.4g}" if value > 1e-9 else "0"


_CONSTANT = 1e-9
"""Residual share of the unbalanced swing up to which the potential energy counts as constant."""


@command(
    epilog="""\b
Examples:
  balance static serial-3r
  balance static parallelogram-6bar --payload platform=5kg --springs parallelogram-6bar
  balance static four-bar --reach 80mm --height 200mm --figure energy.png --json
\b
Exit code 3: with the springs or counter-masses the potential energy still swings; the output states how much.""",
    file=("springs", "springs/parallelogram-6bar"),
)
def static(
    mechanism: str = options.MECHANISM,
    payload: options.Masses = options.PAYLOADS,
    site: tuple[str, ...] = options.SITES,
    springs: str | None = option("Where springs go, or which they are [default: laid out].", metavar="TOML"),
    reach: float | None = option(
        "Spring ends from joints [default: half the mechanism's length].", LENGTH, metavar="LENGTH"
    ),
    height: float | None = option(
        "Spring ends from ground pivots [default: the mechanism's length].", LENGTH, metavar="LENGTH"
    ),
    figure: str | None = options.FIGURE,
) -> Answer:
    """Balance MECH statically: weight does no work, whatever it does, by counter-masses or by springs.

    Springs have no free length (force in proportion to length, as over a pulley). The softest set that makes the
    potential energy constant is found, and evaluated at other configurations of the workspace. The base still shakes.
    """
    from ..balancing.sizing import exact_sizing
    from ..balancing.static_balancing import potential_objective, static_conditions, static_document

    model = options.load_mechanism_option(mechanism, payload)
    found = static_conditions(model)
    counter = None
    if site or model.counter_sites:
        counter = exact_sizing(found, model, site, objective=potential_objective(model))
    result = static_document(found, counter, _springs(model, springs, reach, height))
    options.draw(figure, "balance.figures.balancing:draw_energy", result)
    swings = any(_share(result, method) > _CONSTANT for method in ("counter_masses", "springs"))
    further = ("conditions", "as_it_is", "counter_masses", "springs.springs")
    return Answer(result, lambda: _print_static(result), swings, further=further)


def _share(result: dict[str, Any], method: str) -> float:
    """Residual share of the swing with counter-masses or springs; 0 where there are none, or no swing."""
    return (result[method] or {}).get("share_of_unbalanced") or 0.0


def _springs(model: "Mechanism", name: str | None, reach: float | None, height: float | None) -> "Springs":
    from ..balancing.springs import load_springs
    from ..balancing.static_balancing import design_springs, evaluate_springs

    if name and (reach or height):
        raise click.UsageError("--springs gives the places of springs, which --reach and --height would lay out")
    if not name:
        return design_springs(model, (), reach or 0.0, height or 0.0)
    places, given = load_springs(name, model)
    return evaluate_springs(model, places) if given else design_springs(model, places)


def _print_static(result: dict[str, Any]) -> None:
    """By how much the potential energy swings with each method."""
    if not result["conditions"]:
        say(f"Nothing to balance: the weight of {result['mechanism']} does no work in any motion.")
        return
    texts = []
    for method in ("counter_masses", "springs"):
        if result[method] is not None:
            share, what = _share(result, method), method.replace("_", "-")
            texts.append(f"{what} leave {100 * share if share > _CONSTANT else 0:.3g} % of it")
    say(
        f"Potential energy swings by {result['as_it_is']['potential_swing_J']:.3g} J over the workspace; "
        f"{', '.join(texts)}."
    )
    counter = result["counter_masses"]
    masses = ", ".join(f"{site} = {mass:.4f} kg" for site, mass in counter["masses_kg"].items()) if counter else ""
    say(f"Counter-masses: {masses or 'no site named counter..., name one with --site'}")
    springs = [
        {**one, "length": f"{one['shortest_m']:.3f} to {one['longest_m']:.3f}"} for one in result["springs"]["springs"]
    ]
    emit_table("Springs of zero free length; places in the bodies' frames [m]", *cells(springs, _SPRINGS))
