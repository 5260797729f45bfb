"""``balance size`` for several payloads of one body: sets that only grow."""

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import click

from . import options
from .console import emit_json, emit_table
from .tables import first_moment, mass, per_cent

if TYPE_CHECKING:
    from ..mechanism import Mechanism
    from ..sizing import Sizing

Payload = tuple[tuple[str, float], ...]


def grow(mechanism: str, payloads: Sequence[Payload], sites: tuple[str, ...], stock: str | None, as_json: bool) -> None:
    """Size a set for each of ``payloads``, which rise, and print them."""
    from ..sizing.document import document

    models = [options.load(mechanism, payload) for payload in payloads]
    sets = [
        {"payload_kg": dict(payload), **document(sized), "increments_kg": increments}
        for payload, (sized, increments) in zip(payloads, _sized(models, payloads, sites, stock), strict=True)
    ]
    published = _published(models, payloads) if stock == "kiper2019" and not sites else {}
    if as_json:
        emit_json({"mechanism": models[0].name, "stock": stock, "sets": sets, **published})
        return
    _print(models[0].name, sets, stock)
    if published:
        _print_published(published["published"])


def _sized(
    models: "Sequence[Mechanism]", payloads: Sequence[Payload], sites: tuple[str, ...], stock: str | None
) -> "list[tuple[Sizing, dict[str, float]]]":
    """Each set with what it adds to the one before at each site [kg]."""
    from dataclasses import replace

    from .. import sizing
    from ..conditions import find
    from ..stock import load

    found = find(models[0])
    plates = load(stock) if stock else []
    sets = (
        sizing.nested_from_stock(found, models, plates, sites) if plates else sizing.nested_exact(found, models, sites)
    )
    masses = [{c.site: c.mass for c in sized.counter_masses} for sized in sets]
    before = [dict.fromkeys(masses[0], 0.0), *masses]
    added = [{site: more[site] - less[site] for site in more} for less, more in pairwise(before)]
    bodies = [options.payload_bodies(model, payload) for model, payload in zip(models, payloads, strict=True)]
    return [(replace(s, payload_bodies=b), add) for s, b, add in zip(sets, bodies, added, strict=True)]


def _published(models: "Sequence[Mechanism]", payloads: Sequence[Payload]) -> dict[str, Any]:
    """What the source built, where it is the source's manipulator with the source's payloads."""
    if not models[0].name.startswith("parallelogram-6bar") or any([n for n, _ in p] != ["platform"] for p in payloads):
        return {}
    from ..conditions import find
    from ..sizing import builtsets

    found = builtsets.built(find(models[0]), models, [payload[0][1] for payload in payloads])
    sets = [
        {"payload_kg": s.payload, "plates": list(s.plates), "mass_kg": s.mass, "residual_first_moment_kgm": s.residual}
        for s in found
    ]
    return {"published": {"sets": sets, "increments_kg": list(builtsets.printed_increments())}} if sets else {}


def _print_published(published: dict[str, Any]) -> None:
    click.echo("Built by the source, and what it leaves:")
    for found in published["sets"]:
        left = first_moment(found["residual_first_moment_kgm"])
        click.echo(
            f"  {mass(found['payload_kg'])} kg  {' + '.join(found['plates'])} = {mass(found['mass_kg'])} kg  {left}"
        )
    printed = " and ".join(f"{value:g}" for value in published["increments_kg"])
    click.echo(
        f"Its printed increments, {printed} kg, are differences of its printed counter-masses, not masses of plates."
    )


def _print(name: str, sets: list[dict[str, Any]], stock: str | None) -> None:
    rows, worn = [], dict[str, list[str]]()
    for found in sets:
        payload = ", ".join(f"{body} {mass(value)}" for body, value in found["payload_kg"].items())
        for counter in found["counter_masses"]:
            site = counter["site"]
            row = [payload, site, mass(counter["mass_kg"]), mass(found["increments_kg"][site])]
            new = list(counter["plates"])
            for plate in worn.get(site, []):
                new.remove(plate)
            worn[site] = list(counter["plates"])
            rows.append([*row, " + ".join(new) or "-"] if stock else row)
            payload = ""
    title = f"Counter-masses for {name}" + (f" from {stock}" if stock else "") + ", sets that only grow"
    header = ["payload [kg]", "site", "mass [kg]", "added [kg]"]
    emit_table(title, [*header, "plates added"] if stock else header, rows)
    for found in sets:
        payload = ", ".join(f"{body} = {mass(value)} kg" for body, value in found["payload_kg"].items())
        left = first_moment(found["residual_first_moment_kgm"])
        click.echo(f"Residual at {payload}  {left}  ({per_cent(found['residual_percent'])})")
    if stock:
        click.echo("Least of all sets that only grow, proven: largest residual, then their sum, then mass.")
