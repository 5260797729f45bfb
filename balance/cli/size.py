"""``balance size``: counter-masses for one payload, or sets that only grow for several payloads of one body."""

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import click

from . import options
from .framework import emit_json, emit_table, first_moment, json_option, mass, per_cent
from .options import print_responses, response_summary

if TYPE_CHECKING:
    from ..balancing import Sizing
    from ..dynamics.inverse_dynamics import Response
    from ..mechanism.mechanism import Mechanism

Payload = tuple[tuple[str, float], ...]


def _size_growing(
    mechanism: str, payloads: Sequence[Payload], sites: tuple[str, ...], stock: str | None, as_json: bool
) -> None:
    """Size and print a set for each of ``payloads``, which rise."""
    from ..balancing.sizing import sizing_document

    models = [options.load_mechanism_option(mechanism, payload) for payload in payloads]
    sets = [
        {"payload_kg": dict(payload), **sizing_document(sized), "increments_kg": increments}
        for payload, (sized, increments) in zip(payloads, _size_nested(models, payloads, sites, stock), strict=True)
    ]
    published = _published(models, payloads) if stock == "kiper2019" and not sites else {}
    if as_json:
        emit_json({"mechanism": models[0].name, "stock": stock, "sets": sets, **published})
        return
    _print_nested(models[0].name, sets, stock)
    if published:
        _print_published(published["published"])


def _size_nested(
    models: "Sequence[Mechanism]", payloads: Sequence[Payload], sites: tuple[str, ...], stock: str | None
) -> "list[tuple[Sizing, dict[str, float]]]":
    """Each set with what it adds to the one before at each site [kg]."""
    from dataclasses import replace

    from ..balancing import nested_exact_sizing, nested_size_from_stock
    from ..balancing.conditions import balance_conditions
    from ..balancing.stock_plates import load_stock

    found = balance_conditions(models[0])
    if stock:
        sets = nested_size_from_stock(found, models, load_stock(stock), sites)
    else:
        sets = nested_exact_sizing(found, models, sites)
    masses = [{c.site: c.mass for c in sized.counter_masses} for sized in sets]
    before = [dict.fromkeys(masses[0], 0.0), *masses]
    added = [{site: more[site] - less[site] for site in more} for less, more in pairwise(before)]
    bodies = [options.payload_bodies(model, payload) for model, payload in zip(models, payloads, strict=True)]
    return [(replace(s, payload_bodies=b), add) for s, b, add in zip(sets, bodies, added, strict=True)]


def _published(models: "Sequence[Mechanism]", payloads: Sequence[Payload]) -> dict[str, Any]:
    """Sets that the source built, for the source's manipulator with its payloads; else empty."""
    if not models[0].name.startswith("parallelogram-6bar") or any([n for n, _ in p] != ["platform"] for p in payloads):
        return {}
    from ..balancing import stock_sizing
    from ..balancing.conditions import balance_conditions

    found = stock_sizing.built_sets(balance_conditions(models[0]), models, [payload[0][1] for payload in payloads])
    sets = [
        {"payload_kg": s.payload, "plates": list(s.plates), "mass_kg": s.mass, "residual_first_moment_kgm": s.residual}
        for s in found
    ]
    return {"published": {"sets": sets, "increments_kg": list(stock_sizing.published_increments())}} if sets else {}


def _print_published(published: dict[str, Any]) -> None:
    click.echo("Built by the source, and its residual:")
    for found in published["sets"]:
        residual = first_moment(found["residual_first_moment_kgm"])
        click.echo(
            f"  {mass(found['payload_kg'])} kg  {' + '.join(found['plates'])} = {mass(found['mass_kg'])} kg  {residual}"
        )
    increments = " and ".join(f"{value:g}" for value in published["increments_kg"])
    click.echo(
        f"Its published increments, {increments} kg, are differences of its published counter-masses, not of plates."
    )


def _print_nested(name: str, sets: list[dict[str, Any]], stock: str | None) -> None:
    rows, mounted = [], dict[str, list[str]]()
    for found in sets:
        payload = ", ".join(f"{body} {mass(value)}" for body, value in found["payload_kg"].items())
        for counter in found["counter_masses"]:
            site = counter["site"]
            row = [payload, site, mass(counter["mass_kg"]), mass(found["increments_kg"][site])]
            new = list(counter["plates"])
            for plate in mounted.get(site, []):
                new.remove(plate)
            mounted[site] = list(counter["plates"])
            rows.append([*row, " + ".join(new) or "-"] if stock else row)
            payload = ""
    title = f"Counter-masses for {name}" + (f" from {stock}" if stock else "") + ", sets that only grow"
    header = ["payload [kg]", "site", "mass [kg]", "added [kg]"]
    emit_table(title, [*header, "plates added"] if stock else header, rows)
    for found in sets:
        payload = ", ".join(f"{body} = {mass(value)} kg" for body, value in found["payload_kg"].items())
        residual = first_moment(found["residual_first_moment_kgm"])
        click.echo(f"Residual at {payload}  {residual}  ({per_cent(found['residual_percent'])})")
    if stock:
        click.echo("Least of all sets that only grow, proven: largest residual, then their sum, then mass.")


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
    "--limit",
    type=options.NamedQuantity("SITE", "mass", "5kg"),
    multiple=True,
    metavar="SITE=M",
    help="Largest counter-mass at a site.",
)
@click.option("--motion", metavar="TOML", help="Also compare force, moment and torque of this motion before and after.")
@click.option("--closed-form", is_flag=True, help="parallelogram-6bar by its published formula, without Pinocchio.")
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
        raise click.UsageError(
            "--limit is for counter-masses of any mass: remove it, the quantities of --stock are its limits"
        )
    if closed_form:
        if site or stock or limit or motion or figure:
            raise click.UsageError("--closed-form reads no model: give only --payload and --json with it")
        _closed_form(mechanism, payload, as_json)
        return
    payloads = options.growing_payloads(payload)
    if len(payloads) > 1:
        if limit or motion or figure:
            raise click.UsageError("--limit, --motion and --figure are for one payload of a body")
        _size_growing(mechanism, payloads, site, stock, as_json)
        return
    result = _size_one(
        options.load_mechanism_option(mechanism, payload), site, stock, options.distinct(limit, "--limit"), payload
    )
    responses = _responses(result, motion) if motion else {}
    if figure:
        from ..figures.mechanism import draw_mechanism, save

        save(draw_mechanism(result.after, result.counter_masses), figure)
    if as_json:
        from ..balancing.sizing import sizing_document

        emit_json(sizing_document(result) | {name: response_summary(response) for name, response in responses.items()})
        return
    _print_sizing(result, stock)
    if responses:
        print_responses(responses)


def _size_one(
    model: "Mechanism",
    sites: tuple[str, ...],
    stock: str | None,
    limits: dict[str, float],
    payload: tuple[tuple[str, float], ...],
) -> "Sizing":
    from dataclasses import replace

    from ..balancing import exact_sizing, size_from_stock
    from ..balancing.conditions import balance_conditions
    from ..balancing.stock_plates import load_stock

    found = balance_conditions(model)
    if stock:
        result = size_from_stock(found, model, load_stock(stock), sites)
    else:
        result = exact_sizing(found, model, sites, limits)
    return replace(result, payload_bodies=options.payload_bodies(model, payload))


def _responses(result: "Sizing", motion: str) -> "dict[str, Response]":
    from ..dynamics.inverse_dynamics import simulate

    trajectory = options.follow_motion(result.before, motion)
    return {"before": simulate(result.before, trajectory), "after": simulate(result.after, trajectory)}


def _print_sizing(result: "Sizing", stock: str | None) -> None:
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
    """Size the manipulator by the published formula from the published inputs."""
    from ..balancing import closed_forms

    if mechanism != "parallelogram-6bar" or [name for name, _ in payload] != ["platform"]:
        raise click.UsageError("--closed-form is for parallelogram-6bar with --payload platform=M")
    published = closed_forms.published_sizing()
    m1, p1, m2, p2, r, p_cm = (published[key] for key in ("m1_kg", "p1_m", "m2_kg", "p2_m", "r_m", "p_cm_m"))
    first = closed_forms.manipulator_first_moment(m1, p1, m2, p2, r, payload[0][1])
    counter = closed_forms.manipulator_counter_mass(first, p_cm)
    if as_json:
        sites = [
            {"site": site, "mass_kg": counter, "position_m": [p_cm, 0.0, 0.0],
             "first_moment_kgm": [counter * p_cm, 0.0, 0.0], "plates": []}
            for site in ("counter_A0A", "counter_B0B")
        ]  # fmt: skip
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
        f"{mass(counter)} kg on each arm at {p_cm * 1e3:.2f} mm, by the published closed form "
        "m_cm p_cm = -(m1 p1 + (m2 + m5) r + m2 p2); no model was evaluated."
    )
