"""``balance conditions``."""

import json

import pytest

from balance import datasets


def test_json_has_the_keys_that_are_promised(balance):
    """dof, rank, singular_value_gap, conditions with coefficients and value_kgm, balanced: one document, no more."""
    code, out, err = balance("conditions", "parallelogram-6bar", "--json")
    document = json.loads(out)
    assert (code, err) == (0, "")
    assert {"dof", "rank", "singular_value_gap", "conditions", "balanced"} <= document.keys()
    assert (document["dof"], document["rank"], document["balanced"]) == (2, 4, False)
    kept, dropped = document["singular_value_gap"]
    assert kept > 1e6 * dropped
    assert [set(c) for c in document["conditions"]] == [{"coefficients", "value_kgm"}] * 4
    assert document["conditions"][0]["coefficients"]["mcx[A0A]"] == 1.0


def test_people_read_equations(balance):
    """Each condition as an equation with its value now, and the verdict."""
    code, out, _ = balance("conditions", "parallelogram-6bar")
    assert code == 0
    assert "mcx[A0A] + 0.15 m[AC] + mcx[BD] + 0.15 m[platform] = 0" in out
    assert "2 degrees of freedom, 4 conditions" in out
    assert "Not balanced" in out


def test_counter_masses_balance(balance):
    """With the exact counter-masses the verdict is balanced."""
    counters = ["-c", "counter_A0A=24.27611815kg", "-c", "counter_B0B=24276.11815 g"]
    code, out, _ = balance("conditions", "parallelogram-6bar", "-p", "platform=5kg", *counters, "--json")
    assert code == 0
    assert json.loads(out)["balanced"] is True


@pytest.mark.parametrize(("kind", "rank"), [("linear", 4), ("planar", 12), ("all", 16)])
def test_other_momenta(balance, kind, rank):
    """With angular momentum there are more conditions.

    In space four more: those on linear momentum again, with z times the mass, mcz, Ixz and Iyz for m, mcx and mcy.
    """
    code, out, _ = balance("conditions", "parallelogram-6bar-full", "--momentum", kind, "--json")
    assert (code, json.loads(out)["rank"]) == (0, rank)


@pytest.mark.parametrize("name", [n for n in datasets.dataset_names("mechanisms", ".xml") if "slider" not in n])
def test_every_shipped_mechanism(balance, name):
    """Each has conditions, and says them in text and JSON."""
    assert balance("conditions", name).code == 0
    assert json.loads(balance("conditions", name, "--json").out)["rank"] > 0
