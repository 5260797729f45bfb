"""Step 1: the counter-masses for the three payloads: exact, the best from stock, as built, as printed."""

import json
import sys
from pathlib import Path

from balance import datasets
from balance.balancing import stock_plates
from balance.balancing.conditions import Conditions, balance_conditions
from balance.balancing.sizing import Sizing, best_sets_from_stock, exact_sizing, sizing_of_given
from balance.cli.printing import emit_table
from balance.figures.mechanism import draw_mechanism, save
from balance.mechanism.mechanism import Mechanism
from balance.mechanism.mjcf_parser import load_mechanism

from .console import heading, saved


def run(out: Path) -> None:
    """Print the table of counter-masses and draw the balanced mechanism."""
    heading("1. Counter-masses of the parallelogram 6-bar manipulator")
    mechanism = load_mechanism("parallelogram-6bar")
    conditions = balance_conditions(mechanism)
    for row in range(conditions.rank):
        print(f"   {conditions.text(row)}")
    sheet = json.loads(datasets.find_dataset("kiper2019", "published", ".json").read_text(encoding="utf-8"))
    sheet = sheet["sizing_sheet_A_as_built"]
    rows = [
        row for payload in sheet["built_counter_mass_kg_per_arm"] for row in _payload_rows(conditions, sheet, payload)
    ]
    emit_table(
        "On each arm, 37.55 mm behind its pivot; stock: the best from the stock of plates",
        ["payload", "counter-mass", "kg", "balances [kg]", "leaves [kg m]", "of unbalanced"],
        rows,
        note="Printed masses are the source's (Kiper 2019); all else is computed. The printed 17.1064 kg does not "
        "follow from the printed inputs: those ask for 17.931 kg.",
    )
    balanced = exact_sizing(conditions, mechanism.with_payload({"platform": 5.0}))
    figure = draw_mechanism(balanced.after, balanced.counter_masses, title="Balanced for a payload of 5 kg")
    save(figure, out / "mechanism.png")
    saved(out / "mechanism.png", "the manipulator with its counter-masses")


def _payload_rows(conditions: Conditions, sheet: dict, payload: str) -> list[list[str]]:
    mechanism = conditions.mechanism.with_payload({"platform": float(payload)})
    plates = stock_plates.load_stock("kiper2019")
    built = next(s for label, s in sheet["built_sets"].items() if abs(float(label.split()[0]) - float(payload)) < 0.01)
    variants = {
        "exact": exact_sizing(conditions, mechanism),
        "stock": best_sets_from_stock(conditions, mechanism, plates)[0],
        f"built ({'+'.join(built)})": _given(conditions, mechanism, stock_plates.plates_mass(built, plates)),
        "printed": _given(conditions, mechanism, sheet["printed_counter_mass_kg_per_arm"][payload]),
    }
    return [_row(f"{payload} kg" if name == "exact" else "", name, result) for name, result in variants.items()]


def _given(conditions: Conditions, mechanism: Mechanism, mass: float) -> Sizing:
    return sizing_of_given(conditions, mechanism, dict.fromkeys(mechanism.counter_sites, mass))


def _row(payload: str, name: str, result: Sizing) -> list[str]:
    counter = result.counter_masses[0]
    plates = f" ({'+'.join(counter.plates)})" if counter.plates else ""
    balanced = result.balanced_payloads()["platform"]
    return [
        payload,
        name + plates,
        f"{counter.mass:.4f}",
        "-" if balanced is None else f"{balanced:.4f}",
        f"{result.residual():.2e}",
        f"{result.residual_percent():.3f} %",
    ]


if __name__ == "__main__":
    run(Path(sys.argv[1]))
