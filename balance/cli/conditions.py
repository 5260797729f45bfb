"""``balance conditions``."""

from typing import Any

import click

from . import options
from .console import emit_json, json_option

BALANCED_KGM = 1e-6
"""First-moment residual up to which a mechanism is called balanced [kg m]."""


@click.command(
    epilog="""\b
Examples:
  balance conditions parallelogram-6bar
  balance conditions four-bar.xml --counter counter_A0A=1.074kg --json
  balance conditions parallelogram-6bar-full --momentum planar"""
)
@options.mechanism_argument
@options.payload_option
@options.counter_option
@click.option(
    "--momentum",
    type=click.Choice(["linear", "planar", "all"]),
    default="linear",
    show_default=True,
    help="Which momentum stays zero: linear; with the angular one about z; with all three angular ones.",
)
@json_option
def conditions(
    mechanism: str,
    payload: tuple[tuple[str, float], ...],
    counter: tuple[tuple[str, float], ...],
    momentum: str,
    as_json: bool,
) -> None:
    """Find the conditions that balance MECH, and what they amount to now.

    MECH is the name of a shipped mechanism or a MJCF, URDF or SDF file. Balanced is where every left-hand side is
    zero; mcx[A] is the first moment of mass of body A along x of its own frame, m[A] its mass.
    """
    from ..conditions import find

    model = options.load(mechanism, payload).with_counter_mass(options.once(counter, "--counter"))
    found = find(model, momentum)
    values = found.values()
    if as_json:
        emit_json(
            {
                "mechanism": model.name,
                "momentum": momentum,
                "dof": found.dof,
                "rank": found.rank,
                "singular_value_gap": list(found.singular_values),
                "conditions": document(found, model),
                "balanced": found.is_balanced(BALANCED_KGM),
                "balanced_tolerance_kgm": BALANCED_KGM,
            }
        )
        return
    kept, dropped = found.singular_values
    click.echo(
        f"{model.name}: {found.dof} degree{'s' * (found.dof != 1)} of freedom, {found.rank} conditions "
        f"on {momentum} momentum (singular values kept down to {kept:.3g}, dropped from {dropped:.3g})\n"
    )
    for i, value in enumerate(values):
        click.echo(f"  {found.text(i):<70}  now {value:+.6g} kg m")
    click.echo(
        f"\n{'Balanced' if found.is_balanced(BALANCED_KGM) else 'Not balanced'}: largest first-moment residual "
        f"{found.residual():.4g} kg m (balanced means at most {BALANCED_KGM:g} kg m)."
    )


def document(found: Any, model: Any) -> list[dict[str, Any]]:  # noqa: ANN401
    """Conditions for JSON, each with its value for a mechanism."""
    return [
        {"coefficients": found.coefficients(i), "value_kgm": float(value)}
        for i, value in enumerate(found.values(model))
    ]
