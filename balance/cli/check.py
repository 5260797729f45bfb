"""``balance check``."""

from typing import TYPE_CHECKING

import click

from . import options
from .conditions import document
from .console import emit_json, emit_table, json_option
from .tables import first_moment, mass, per_cent

if TYPE_CHECKING:
    from ..sizing import Sizing


@click.command(
    epilog="""\b
Examples:
  balance check parallelogram-6bar -p platform=3.4116kg -c counter_A0A=17.1105kg -c counter_B0B=17.1105kg"""
)
@options.mechanism_argument
@options.payload_option
@options.counter_option
@json_option
def check(
    mechanism: str, payload: tuple[tuple[str, float], ...], counter: tuple[tuple[str, float], ...], as_json: bool
) -> None:
    """Say what given counter-masses leave unbalanced in MECH, and which payload they would balance."""
    if not counter:
        raise click.UsageError("check needs the counter-masses to check: --counter SITE=M")
    from ..conditions import find
    from ..dynamics.inverse_dynamics import shaking_force_per_acceleration
    from ..quantities import G0
    from ..sizing import balanced_payload, given

    model = options.load(mechanism, payload)
    found = find(model)
    result = given(found, model, options.once(counter, "--counter"))
    bodies = options.payload_bodies(model, payload)
    balanced = {body: balanced_payload(found, result.after, body) for body in bodies}
    force = [shaking_force_per_acceleration(state, bodies[0]) if bodies else None for state in (model, result.after)]
    before, after = (None if value is None else value * G0 for value in force)
    if as_json:
        emit_json(
            {
                "mechanism": model.name,
                "residual_first_moment_kgm": result.residual(),
                "residual_percent": result.residual_percent(),
                "conditions": document(found, result.after),
                "balanced_payload_kg": balanced,
                "shaking_force_N_per_g": after,
                "shaking_force_without_counter_masses_N_per_g": before,
                "g0_m_per_s2": G0,
            }
        )
        return
    _print(result, balanced)
    if before is not None and after is not None:
        click.echo(
            f"Shaking force          {after:.4g} N per g0 of {bodies[0]} acceleration, "
            f"{before:.4g} N without counter-masses (g0 = {G0} m/s2)"
        )


def _print(result: "Sizing", balanced: dict[str, float | None]) -> None:
    """Counter-masses, what they leave, and the payload that they would balance."""
    model, found = result.before, result.conditions
    rows = [[c.site, mass(c.mass), f"{c.position[0] * 1e3:.2f}"] for c in result.counter_masses]
    emit_table(f"Counter-masses of {model.name}", ["site", "mass [kg]", "x in its body [mm]"], rows)
    rows = [[found.text(i), f"{value:+.6g}"] for i, value in enumerate(found.values(result.after))]
    emit_table("Conditions", ["condition", "left-hand side [kg m]"], rows)
    click.echo(
        f"First-moment residual  {first_moment(result.residual())}  ({per_cent(result.residual_percent())} of that "
        f"without counter-masses, {first_moment(found.residual(model))})"
    )
    for body, value in balanced.items():
        click.echo(
            f"Balanced payload       {body} = {'none' if value is None else mass(value) + ' kg'} "
            f"(asked: {mass(model.mass(body))} kg)"
        )
