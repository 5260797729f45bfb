"""The published closed forms give the published numbers, but for one."""

import json

import numpy as np
import pytest

from balance import datasets
from balance.balancing import closed_forms

PUBLISHED = json.loads(datasets.find_dataset("kiper2019", "published", ".json").read_text(encoding="utf-8"))
AS_BUILT, EARLIER = PUBLISHED["sizing_sheet_A_as_built"], PUBLISHED["sizing_sheet_B_earlier_design"]


def inputs(published: dict[str, float]) -> tuple[float, float, float, float, float]:
    """Masses and centres of the arms and their length."""
    return published["m1_kg"], published["p1_m"], published["m2_kg"], published["p2_m"], published["r_m"]


@pytest.mark.parametrize("payload", ["1.451", "5.0"])
def test_printed_counter_masses(payload: str) -> None:
    """1.451 and 5 kg follow from the printed inputs to the digits printed."""
    first = closed_forms.manipulator_first_moment(*inputs(AS_BUILT), float(payload))
    counter = closed_forms.manipulator_counter_mass(first, AS_BUILT["p_cm_m"])
    printed = AS_BUILT["printed_counter_mass_kg_per_arm"][payload]
    assert counter == pytest.approx(printed, abs=5e-4)
    if payload == "5.0":
        assert -first == pytest.approx(AS_BUILT["printed_first_moment_kgm_at_5kg"], abs=5e-5)


def test_the_printed_counter_mass_for_3_4116_kg_does_not_follow() -> None:
    """By the published formula 3.4116 kg need 17.931 kg; the published 17.1064 kg balance 3.2052 kg."""
    first = closed_forms.manipulator_first_moment(*inputs(AS_BUILT), 3.4116)
    assert closed_forms.manipulator_counter_mass(first, AS_BUILT["p_cm_m"]) == pytest.approx(17.93098, abs=1e-5)
    printed = AS_BUILT["printed_counter_mass_kg_per_arm"]["3.4116"]
    balanced = closed_forms.manipulator_balanced_payload(*inputs(AS_BUILT), printed, AS_BUILT["p_cm_m"])
    assert balanced == pytest.approx(3.2052, abs=5e-5)


def test_earlier_design() -> None:
    """Sheet B: 10.6565 kg at -79.7 mm."""
    first = closed_forms.manipulator_first_moment(*inputs(EARLIER), EARLIER["payload_kg"])
    counter = closed_forms.manipulator_counter_mass(first, EARLIER["p_cm_m"])
    assert counter == pytest.approx(EARLIER["recomputed_m_cm_kg"], abs=5e-5)


def test_balanced_payload_is_the_inverse() -> None:
    """The payload that the counter-mass of a payload balances is that payload."""
    first = closed_forms.manipulator_first_moment(*inputs(AS_BUILT), 2.5)
    counter = closed_forms.manipulator_counter_mass(first, -0.05)
    assert closed_forms.manipulator_balanced_payload(*inputs(AS_BUILT), counter, -0.05) == pytest.approx(2.5)


def test_serial_chain_of_three() -> None:
    """Written out for 3R; the print has l1 in the first condition's last term, which is the same l1."""
    rows = closed_forms.serial_chain([0.3, 0.25, 0.2])
    assert len(rows) == 6
    assert rows[0] == {"mcx[link_1]": 1.0, "m[link_2]": 0.3, "m[link_3]": 0.3}
    assert rows[4] == {"mcx[link_3]": 1.0}
    assert closed_forms.serial_chain([0.3]) == [{"mcx[link_1]": 1.0}, {"mcy[link_1]": 1.0}]


def test_four_bar_in_both_readings() -> None:
    """The printed conditions, link 3 measured from B, and these, measured from B0, are met by the same linkage."""
    l1, l2, l3 = 0.1, 0.26, 0.2
    m2, e2, f2 = 0.7, 0.12, 0.01
    printed = {
        "m1e1": -m2 * (1 - e2 / l2) * l1, "m1f1": m2 * (f2 / l2) * l1,
        "m3(l3-e3)": -m2 * (e2 / l2) * l3, "m3f3": m2 * (f2 / l2) * l3,
    }  # fmt: skip
    # e3, f3 point from B to B0: from B0, l3 - e3 along the link, and -f3 across it
    values = {
        "m[AB]": m2, "mcx[AB]": m2 * e2, "mcy[AB]": m2 * f2,
        "mcx[A0A]": printed["m1e1"], "mcy[A0A]": printed["m1f1"],
        "mcx[B0B]": printed["m3(l3-e3)"], "mcy[B0B]": -printed["m3f3"],
    }  # fmt: skip
    for row in closed_forms.four_bar_loop_closure(l1, l2, l3):
        assert sum(c * values[name] for name, c in row.items()) == pytest.approx(0.0, abs=1e-15)
    assert np.shape(closed_forms.four_bar_loop_closure(l1, l2, l3)) == (4,)
