"""Plans: every combination, with and without counter-masses, and the key that each wrong value is blamed on."""

import json
import re

import pytest

from balance import datasets
from testbench import campaign_plan
from testbench.errors import RigError

TEXT = """
mechanism = "parallelogram-6bar"
repeats = 2
[[conditions]]
payload = "5 kg"
counter_masses = { counter_A0A = "24.2626 kg", counter_B0B = "24.2626 kg" }
motion = ["x", "y"]
peak_acceleration = ["0.5 g0", "3 g"]
"""


def test_combinations():
    """Two motions, two accelerations, with and without counter-masses, two repeats: sixteen runs of distinct names."""
    runs = campaign_plan.plan_from_text(TEXT).runs()
    assert len({run.name for run in runs}) == len(runs) == 16
    assert sum(bool(run.counter_masses) for run in runs) == 8
    assert sorted({run.conditions["peak_acceleration_g"] for run in runs}) == [0.5, 3.0]


def test_without_alone():
    """A condition without counter-masses gives runs without, and only them."""
    runs = campaign_plan.plan_from_text(TEXT.replace("counter_masses", "#")).runs()
    assert len(runs) == 8
    assert not any(run.counter_masses for run in runs)


def test_shared_without():
    """Two sets of counter-masses for one payload share the run without."""
    second = TEXT[TEXT.index("[[") :].replace("24.2626", "17.1105")
    assert len(campaign_plan.plan_from_text(TEXT + second).runs()) == 24


def test_published_plan():
    """The shipped plan holds exactly the printed conditions, each with the built counter-masses and without."""
    source = json.loads(datasets.find_dataset("kiper2019", "published", ".json").read_text("utf-8"))
    printed = {tuple(row[:3]) for row in source["acceleration_amplitude_reduction_percent"]["rows"]}
    built = source["sizing_sheet_A_as_built"]["built_counter_mass_kg_per_arm"]
    runs = campaign_plan.load_plan("kiper2019").runs()
    assert {(round(r.payload, 2), r.motion, r.conditions["peak_acceleration_g"]) for r in runs} == printed
    assert len(runs) == 2 * len(printed) == 52
    for run in runs:
        masses = {built[{1.451: "1.451", 3.4116: "3.4116", 5.0: "5.0"}[run.payload]]}
        assert set(run.counter_masses.values()) in (masses, set())


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ('"5 kg"', '"5 m"', "conditions[0].payload"),
        ('"5 kg"', "5", "conditions[0].payload"),
        ('"3 g"', '"-3 g"', "conditions[0].peak_acceleration[1]"),
        ("repeats = 2", "repeats = 0", "repeats"),
        ("repeats = 2", "repeat = 2", "repeat"),
        ("motion =", "motions =", "conditions[0].motions"),
        ("[[conditions]]", "[[condition]]", "conditions"),
    ],
)
def test_wrong_value(old, new, key):
    """A wrong value is blamed on its key."""
    with pytest.raises(RigError, match=rf"plan: {re.escape(key)}: "):
        campaign_plan.plan_from_text(TEXT.replace(old, new, 1))
