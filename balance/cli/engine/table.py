"""``balance engine table``."""

from typing import TYPE_CHECKING, Any

import click

from ..console import emit_json, emit_table, json_option

if TYPE_CHECKING:
    from ...engines.engine import Engine


@click.command(
    epilog="""\b
Examples:
  balance engine table
  balance engine table --ratio 0.3 --json
  balance engine table own.toml in-line-4"""
)
@click.argument("engines", nargs=-1, metavar="[ENGINE]...")
@click.option("--ratio", type=float, default=0.25, show_default=True, help="r / l of all engines.")
@json_option
def table(engines: tuple[str, ...], ratio: float, as_json: bool) -> None:
    """The common engines side by side: first and second order forces and moments, and what counterweights leave.

    Forces in m r omega^2, moments in m r omega^2 a, with m the reciprocating mass of one cylinder, a the spacing;
    rotating masses balanced, second order with its exact coefficient.
    """
    from ... import datasets
    from ...engines.engine_files import has_sizes, load_layout

    names = list(engines) or [name for name in datasets.names("engines", ".toml") if not has_sizes(name)]
    rows = [_row(load_layout(name, ratio)) for name in names]
    if as_json:
        emit_json({"ratio_r_over_l": ratio, "engines": rows})
        return
    columns = [
        "F1_mrw2",
        "F1_with_counterweights_mrw2",
        "M1_mrw2a",
        "M1_with_counterweights_mrw2a",
        "F2_mrw2",
        "M2_mrw2a",
    ]
    cells = [
        [row["engine"], *(f"{row[column]:.4g}" for column in columns), "-".join(map(str, row["firing_order"])),
         "even" if row["firing_even"] else " ".join(f"{i:g}" for i in row["firing_intervals_deg"])]
        for row in rows
    ]  # fmt: skip
    header = ["engine", "F1", "F1 left*", "M1", "M1 left*", "F2", "M2", "fires", "intervals"]
    note = (
        f"Forces in m r omega^2, moments about the middle in m r omega^2 a; r / l = {ratio:g}. *: with the best "
        "counterweights on the crankshaft, which remove what turns with it; the rest needs balance shafts."
    )
    emit_table("Engines", header, cells, note)


def _row(engine: "Engine") -> dict[str, Any]:
    from ...engines.firing import firing
    from ...engines.orders import free

    first, second = free(engine, 2)
    fired = firing(engine)
    return {
        "engine": engine.name,
        "F1_mrw2": first.force.largest,
        "F1_with_counterweights_mrw2": abs(first.force.backward),
        "M1_mrw2a": first.moment.largest,
        "M1_with_counterweights_mrw2a": abs(first.moment.backward),
        "F2_mrw2": second.force.largest,
        "M2_mrw2a": second.moment.largest,
        "place_of_F2_a": second.place,
        "firing_order": list(fired.order),
        "firing_intervals_deg": list(fired.intervals_deg),
        "firing_even": fired.even,
    }
