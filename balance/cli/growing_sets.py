"""``balance size`` with several payloads of one body: sets of counter-masses that only grow."""

import sys
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import click

from ..results import per_cent_text
from . import options
from .framework import EXIT_WITH_FINDINGS, emit_json, emit_table, first_moment, mass

if TYPE_CHECKING:
    from ..balancing import Sizing
    from ..mechanism.mechanism import Mechanism

Payload = tuple[tuple[str, float], ...]


def size_growing(
    mechanism: str,
    payloads: Sequence[Payload],
    sites: tuple[str, ...],
    stock: str | None,
    objective: tuple[str | None, dict[str, float]],
    as_json: bool,
) -> None:
    """Size and print a set for each of ``payloads``, which rise."""
    from ..balancing.objective import MADE_SMALL
    from ..balancing.remaining_force import STEPS
    from ..balancing.sizing import sizing_document

    models = [options.load_mechanism_option(mechanism, payload) for payload in payloads]
    sets = [
        {"payload_kg": dict(payload), **sizing_document(sized), "increments_kg": increments}
        | {"balanced": sized.is_complete(), "remaining_percent": sized.remaining_percent()}
        | {"attainable_with_any_mass": _is_attainable(sized, sites), "proven": sized.bound is not None}
        for payload, (sized, increments) in zip(
            payloads, _size_nested(models, payloads, sites, stock, objective), strict=True
        )
    ]
    published = _published(models, payloads) if stock == "kiper2019" and not sites else {}
    complete = all(one["balanced"] for one in sets)
    if as_json:
        emit_json({"mechanism": models[0].name, "stock": stock, "sets": sets, **published})
    else:
        left = ", ".join(per_cent_text(one["remaining_percent"]) for one in sets)
        what = "momentum" if objective[0] is None else " and ".join(MADE_SMALL[name] for name in objective[1])
        click.echo(
            "Balanced completely with each payload."
            if complete
            else f"Not balanced completely: {left} of the RMS {what} remains with the payloads below."
        )
        _print_nested(models[0].name, sets, stock)
    if published and not as_json:
        _print_published(published["published"])
    largest = max(one["remaining_percent"] or 0.0 for one in sets)
    sys.exit(0 if complete or (stock and largest <= 100.0 * STEPS) else EXIT_WITH_FINDINGS)


def _is_attainable(sized: "Sizing", sites: tuple[str, ...]) -> bool:
    """Whether masses of any size at the sites would balance completely, this payload alone."""
    from ..balancing import exact_sizing

    return exact_sizing(sized.conditions, sized.before, sites, objective=sized.objective).is_complete()


def _size_nested(
    models: "Sequence[Mechanism]",
    payloads: Sequence[Payload],
    sites: tuple[str, ...],
    stock: str | None,
    objective: tuple[str | None, dict[str, float]],
) -> "list[tuple[Sizing, dict[str, float]]]":
    """Each set with what it adds to the one before at each site [kg]."""
    from ..balancing import nested_exact_sizing, nested_size_from_stock
    from ..balancing.conditions import balance_conditions
    from ..balancing.objective import objective_of
    from ..balancing.stock_plates import load_stock
    from ..front_door import follow

    found = balance_conditions(models[0])
    motion, weights = objective
    along = follow(models[0], motion) if motion else None
    objectives = [objective_of(model, along, weights) for model in models]
    if stock:
        sets = nested_size_from_stock(found, models, load_stock(stock), sites, objectives)
    else:
        sets = nested_exact_sizing(found, models, sites, objectives)
    masses = [{c.site: c.mass for c in sized.counter_masses} for sized in sets]
    before = [dict.fromkeys(masses[0], 0.0), *masses]
    added = [{site: more[site] - less[site] for site in more} for less, more in pairwise(before)]
    bodies = [options.payload_bodies(model, payload) for model, payload in zip(models, payloads, strict=True)]
    return [(replace(s, payload_bodies=b), add) for s, b, add in zip(sets, bodies, added, strict=True)]


def _published(models: "Sequence[Mechanism]", payloads: Sequence[Payload]) -> dict[str, Any]:
    """Sets that the source built, for the source's manipulator with its payloads; else empty."""
    if not models[0].name.startswith("parallelogram-6bar") or any([n for n, _ in p] != ["platform"] for p in payloads):
        return {}
    from ..balancing import closed_forms
    from ..balancing.conditions import balance_conditions

    found = closed_forms.built_sets(balance_conditions(models[0]), models, [payload[0][1] for payload in payloads])
    sets = [
        {"payload_kg": s.payload, "plates": list(s.plates), "mass_kg": s.mass, "residual_first_moment_kgm": s.residual}
        for s in found
    ]
    return {"published": {"sets": sets, "increments_kg": list(closed_forms.published_increments())}} if sets else {}


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
        if found["attainable_with_any_mass"]:
            residual = first_moment(found["residual_first_moment_kgm"])
            click.echo(f"Residual at {payload}  {residual}  ({per_cent_text(found['residual_percent'])})")
        else:
            click.echo(f"At {payload}  no masses at these sites balance completely")
    if stock:
        proof = "proven" if all(one["proven"] for one in sets) else "the best found in the time, not proven"
        click.echo(f"Least in the sum over the payloads of all sets that only grow: {proof}.")
