"""``balance rotor trial``."""

import click

from ..console import emit_json, json_option
from .given import Quantity, speed_option


@click.command(
    epilog="""\b
Examples:
  balance rotor trial --mass 40kg --speed 3000rpm --radius 100mm
  balance rotor trial --mass 250kg --speed 1500rpm --radius 300mm --planes 2 --share 5"""
)
@click.option("--mass", type=Quantity("mass", positive=True), required=True, metavar="M", help="Mass of the rotor.")
@speed_option
@click.option(
    "--radius", type=Quantity("length", positive=True), required=True, metavar="R", help="Radius of the trial mass."
)
@click.option("--planes", type=click.IntRange(1), default=1, show_default=True, help="Planes that share the weight.")
@click.option("--share", type=float, default=10.0, show_default=True, help="Centrifugal force, per cent of the weight.")
@json_option
def trial(mass: float, speed: float | None, radius: float, planes: int, share: float, as_json: bool) -> None:
    """A trial mass whose centrifugal force is a share of the weight on its plane: m_t r omega^2 = p m g0 / planes."""
    from ...quantities import G0
    from ...rotors.grade import trial_mass

    if speed is None:
        raise click.UsageError("the trial mass needs --speed")
    if not 0.0 < share <= 100.0:
        raise click.UsageError(f"--share {share:g}: expected per cent of the weight, more than 0 and at most 100")
    found = trial_mass(mass, speed, radius, planes, share / 100.0)
    if as_json:
        emit_json(
            {
                "trial_mass_g": 1e3 * found,
                "trial_unbalance_gmm": 1e6 * found * radius,
                "force_N": found * radius * speed**2,
                "share_of_weight_percent": share,
                "g0_m_per_s2": G0,
            }
        )
        return
    click.echo(
        f"Trial mass {1e3 * found:.4g} g at {1e3 * radius:g} mm ({1e6 * found * radius:.4g} g mm): {share:g} % of the "
        f"weight on its plane at {speed:.5g} rad/s (g0 = {G0} m/s2)."
    )
