"""``balance size``."""

from typing import TYPE_CHECKING

import click

from . import options
from .console import emit_json, emit_table, json_option
from .responses import print_responses, summary
from .tables import first_moment, mass, per_cent

if TYPE_CHECKING:
    from ..dynamics.inverse_dynamics import Response
    from ..mechanism import Mechanism
    from ..sizing import Sizing


@click.command(
    epilog="""\b
Examples:
  balance size parallelogram-6bar --payload platform=5kg
  balance size parallelogram-6bar --payload platform=3.4116kg --stock kiper2019
  balance size parallelogram-6bar --payload platform=5kg --motion x --json
  balance size parallelogram-6bar -p platform=1.451kg -p platform=3.4116kg -p platform=5kg --stock kiper2019

\b
Several payloads of one body: sets that only grow with the payload. From stock, least one after the other and
proven: the largest residual of all payloads, their sum, the mass of all sets.

\b
Stock weighed:  name,mass_kg,quantity
Stock as drawn: name,quantity,shape,material,thickness_mm,length_mm,width_mm,diameter_mm,bore_mm,holes_mm
  shape: rectangle (length, width), disc (diameter) or ring (diameter, bore); the rest is empty
  material: 7075 aluminium, steel or 5000 aluminium; holes_mm: x y diameter; x y diameter, from its middle
  Mass and inertia follow; inertia is about the plate's centre of mass, which is taken to be at the site."""
)
@options.mechanism_argument
@options.payload_option
@options.site_option
@click.option("--stock", metavar="CSV", help="Make them from these plates: a CSV file as below, or kiper2019.")
@click.option(
    "--limit", type=options.NamedMass("SITE"), multiple=True, metavar="SITE=M", help="Largest counter-mass at a site."
)
@click.option("--motion", metavar="TOML", help="Also compare force, moment and torque of this motion before and after.")
@click.option("--closed-form", is_flag=True, help="parallelogram-6bar by its printed formula, without Pinocchio.")
@options.figure_option
@json_option
def size(
    mechanism: str,
    payload: tuple[tuple[str, float], ...],
    site: tuple[str, ...],
    stock: str | None,
    limit: tuple[tuple[str, float], ...],
    motion: str | None,
    closed_form: bool,
    figure: str | None,
    as_json: bool,
) -> None:
    """Size the counter-masses that balance MECH: of any mass, or from stock plates to a proven optimum.

    Force balance alone raises the shaking moment and the drive torque: --motion shows by how much.
    """
    if stock and limit:
        raise click.UsageError("--limit is for counter-masses of any mass, --stock has its quantities")
    if closed_form:
        if site or stock or limit or motion or figure:
            raise click.UsageError("--closed-form goes with --payload and --json alone: no model is read")
        _closed_form(mechanism, payload, as_json)
        return
    in_turn = options.in_turn(payload)
    if len(in_turn) > 1:
        if limit or motion or figure:
            raise click.UsageError("--limit, --motion and --figure are for one payload of a body")
        from .growing import grow

        grow(mechanism, in_turn, site, stock, as_json)
        return
    result = _sized(options.load(mechanism, payload), site, stock, options.once(limit, "--limit"), payload)
    responses = _responses(result, motion) if motion else {}
    if figure:
        from ..figures.drawing import draw_mechanism, save

        save(draw_mechanism(result.after, result.counter_masses), figure)
    if as_json:
        from ..sizing.document import document

        emit_json(document(result) | {name: summary(response) for name, response in responses.items()})
        return
    _print(result, stock)
    if responses:
        print_responses(responses)


def _sized(
    model: "Mechanism",
    sites: tuple[str, ...],
    stock: str | None,
    limits: dict[str, float],
    payload: tuple[tuple[str, float], ...],
) -> "Sizing":
    from dataclasses import replace

    from .. import sizing
    from ..conditions import find
    from ..stock import load

    found = find(model)
    plates = load(stock) if stock else []
    result = sizing.from_stock(found, model, plates, sites) if plates else sizing.exact(found, model, sites, limits)
    return replace(result, payload_bodies=options.payload_bodies(model, payload))


def _responses(result: "Sizing", motion: str) -> "dict[str, Response]":
    from ..closure import Closure
    from ..dynamics.inverse_dynamics import simulate
    from ..motion import DEFAULT_RATE_HZ
    from ..motion.motion_files import load_motion

    trajectory = Closure(result.before).follow(load_motion(motion).sample(DEFAULT_RATE_HZ))
    return {"before": simulate(result.before, trajectory), "after": simulate(result.after, trajectory)}


def _print(result: "Sizing", stock: str | None) -> None:
    rows = [
        [c.site, mass(c.mass), f"{c.position[0] * 1e3:.2f}", f"{c.first_moment[0]:.5f}", " + ".join(c.plates) or "-"]
        for c in result.counter_masses
    ]
    emit_table(
        f"Counter-masses for {result.before.name}" + (f" from {stock}" if stock else ""),
        ["site", "mass [kg]", "x in its body [mm]", "first moment [kg m]", "plates"],
        rows,
    )
    click.echo(
        f"First-moment residual  {first_moment(result.residual())}  ({per_cent(result.residual_percent())} of that "
        "without counter-masses)"
    )
    for body, value in result.balanced_payloads().items():
        click.echo(f"Balanced payload       {body} = {'none' if value is None else mass(value) + ' kg'}")
    click.echo(f"Added                  {result.added_mass:.4f} kg, {result.added_inertia:.5f} kg m2 about the joints")


def _closed_form(mechanism: str, payload: tuple[tuple[str, float], ...], as_json: bool) -> None:
    """Size the manipulator by the printed formula from the printed inputs."""
    import json

    from .. import closed_forms, datasets

    if mechanism != "parallelogram-6bar" or [name for name, _ in payload] != ["platform"]:
        raise click.UsageError("--closed-form is for parallelogram-6bar with --payload platform=M")
    text = datasets.find("kiper2019", "published", ".json").read_text(encoding="utf-8")
    sheet = json.loads(text)["sizing_sheet_A_as_built"]
    inputs = [sheet[key] for key in ("m1_kg", "p1_m", "m2_kg", "p2_m", "r_m")]
    m1, p1, m2, p2, r = inputs
    first = closed_forms.manipulator_first_moment(m1, p1, m2, p2, r, payload[0][1])
    counter = closed_forms.manipulator_counter_mass(first, sheet["p_cm_m"])
    if as_json:
        sites = [
            {
                "site": site,
                "mass_kg": counter,
                "position_m": [sheet["p_cm_m"], 0.0, 0.0],
                "first_moment_kgm": [counter * sheet["p_cm_m"], 0.0, 0.0],
                "plates": [],
            }
            for site in ("counter_A0A", "counter_B0B")
        ]
        emit_json(
            {
                "mechanism": mechanism,
                "method": "closed form, printed",
                "counter_masses": sites,
                "residual_first_moment_kgm": None,
                "residual_percent": None,
                "balanced_payload_kg": dict(payload),
                "added_mass_kg": 2 * counter,
                "added_inertia_kgm2": None,
            }
        )
        return
    click.echo(
        f"{mass(counter)} kg on each arm at {sheet['p_cm_m'] * 1e3:.2f} mm, by the printed closed form "
        "m_cm p_cm = -(m1 p1 + (m2 + m5) r + m2 p2); no model was evaluated."
    )
