"""``balance static``."""

from typing import TYPE_CHECKING, Any

import click

from . import options
from .console import EXIT_WITH_FINDINGS, emit_json, emit_table, json_option
from .rotor.given import Quantity

if TYPE_CHECKING:
    from ..mechanism import Mechanism
    from ..static.design import Springs

_LENGTH = Quantity("length", positive=True)
_LEFT = 1e-9
"""Share of the unbalanced swing above which the potential energy is not called constant."""


@click.command(
    epilog="""\b
A spring file (TOML; unknown keys are refused, quantities carry units); without stiffness it is found:
  [[spring]]
  name = "base to arm A0A"
  first = { body = "base", at = ["-0.12 m", "0.15 m", "0 m"] }
  second = { body = "A0A", at = ["0.075 m", "0 m", "0 m"] }
  stiffness = "900 N/m"

\b
Examples:
  balance static serial-3r
  balance static parallelogram-6bar --payload platform=5kg --springs parallelogram-6bar
  balance static four-bar --reach 80mm --height 200mm --figure energy.png --json

\b
Exit code 3: the springs or counter-masses leave the potential energy swinging; how much is said."""
)
@options.mechanism_argument
@options.payload_option
@options.site_option
@click.option("--springs", metavar="TOML", help="Where springs go, or which they are [default: laid out].")
@click.option(
    "--reach", type=_LENGTH, metavar="LENGTH", help="Spring ends from joints [default: half the mechanism's length]."
)
@click.option(
    "--height",
    type=_LENGTH,
    metavar="LENGTH",
    help="Spring ends from ground pivots [default: the mechanism's length].",
)
@options.figure_option
@json_option
def static(
    mechanism: str,
    payload: tuple[tuple[str, float], ...],
    site: tuple[str, ...],
    springs: str | None,
    reach: float | None,
    height: float | None,
    figure: str | None,
    as_json: bool,
) -> None:
    """Balance MECH statically: weight does no work, whatever it does, by counter-masses or by springs.

    Springs have no free length (force in proportion to length, as over a pulley). The softest set that makes the
    potential energy constant is found; it is judged at other configurations of the workspace. The base still shakes.
    """
    from .. import sizing
    from ..static import conditions
    from ..static import document as documents

    model = options.load(mechanism, payload)
    found = conditions.find(model)
    counter = sizing.exact(found, model, site) if site or model.counter_sites else None
    result = documents.document(found, counter, _springs(model, springs, reach, height))
    if figure:
        from ..figures.drawing import save
        from ..figures.static import draw_energy

        save(draw_energy(result), figure)
    emit_json(result) if as_json else _print(result)
    if any(_share(result, way) > _LEFT for way in ("counter_masses", "springs")):
        raise click.exceptions.Exit(EXIT_WITH_FINDINGS)


def _share(result: dict[str, Any], way: str) -> float:
    """Share of the unbalanced swing that counter-masses or springs leave; 0 where there are none, or no swing."""
    return (result[way] or {}).get("share_of_unbalanced") or 0.0


def _springs(model: "Mechanism", name: str | None, reach: float | None, height: float | None) -> "Springs":
    from ..static import design

    if name and (reach or height):
        raise click.UsageError("--reach and --height lay springs out; --springs says where they are")
    if name:
        from ..static.spring_files import load_springs

        places, given = load_springs(name, model)
        return design.judged(model, places) if given else design.design(model, places)
    return design.design(model, (), reach or 0.0, height or 0.0)


def _print(result: dict[str, Any]) -> None:
    if not result["conditions"]:
        click.echo(f"Nothing to balance: the weight of {result['mechanism']} does no work in any motion.")
        return
    emit_table(
        f"Static balance of {result['mechanism']}: what must vanish",
        ["condition", "now [kg m]"],
        [[row["text"], f"{row['value_kgm']:.5g}"] for row in result["conditions"]],
    )
    _energies(result)
    emit_table(
        "Springs of zero free length; places in the bodies' frames [m]",
        ["from", "to", "stiffness [N/m]", "length [m]", "largest force [N]"],
        [
            [s["first"], s["second"], f"{s['stiffness_N_per_m']:.2f}", f"{s['shortest_m']:.3f} to {s['longest_m']:.3f}",
             f"{s['force_peak_N']:.1f}"]
            for s in result["springs"]["springs"]
        ],
    )  # fmt: skip


def _energies(result: dict[str, Any]) -> None:
    """Swings as it is, with counter-masses and with springs, and what either leaves."""
    counter = result["counter_masses"]
    rows = [_row("as it is", result["as_it_is"], 0.0), _row("springs", result["springs"], 0.0)]
    if counter:
        rows.insert(1, _row("counter-masses", counter, counter["added_mass_kg"]))
    header = ["", "swing [J]", "of unbalanced", "largest holding torque [N m]", "added mass [kg]"]
    note = f"{result['configurations']} configurations of the workspace."
    emit_table("Potential energy over the workspace", header, rows, note)
    masses = ", ".join(f"{site} = {mass:.4f} kg" for site, mass in counter["masses_kg"].items()) if counter else ""
    click.echo(f"Counter-masses: {masses or 'no site named counter..., name one with --site'}")
    for way in ("counter_masses", "springs"):
        if (share := _share(result, way)) > _LEFT:
            what = way.replace("_", "-").capitalize()
            click.echo(f"{what} leave {100 * share:.3g} % of the swing: the potential energy is not constant.")


def _row(name: str, values: dict[str, Any], mass: float) -> list[str]:
    share = values["share_of_unbalanced"]
    torque = ", ".join(f"{joint} {value:.3g}" for joint, value in values["holding_torque_peak_Nm"].items())
    return [name, f"{values['potential_swing_J']:.3g}", "-" if share is None else f"{share:.1e}", torque, f"{mass:.3f}"]
