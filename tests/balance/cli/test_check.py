"""``balance check``."""

import json

import pytest

BUILT = ("-p", "platform=3.4116kg", "-c", "counter_A0A=17.1105kg", "-c", "counter_B0B=17.1105kg")


def test_json_has_the_keys_that_are_promised(balance):
    """Residual, per cent, conditions, balanced payload, and the force per g0."""
    code, out, err = balance("check", "parallelogram-6bar", *BUILT, "--json")
    document = json.loads(out)
    assert (code, err) == (0, "")
    assert {
        "residual_first_moment_kgm", "residual_percent", "conditions", "balanced_payload_kg", "shaking_force_N_per_g",
    } <= document.keys()  # fmt: skip
    assert document["residual_first_moment_kgm"] == pytest.approx(3.081e-2, abs=5e-6)
    assert document["residual_percent"] == pytest.approx(4.576, abs=5e-4)
    assert document["balanced_payload_kg"]["platform"] == pytest.approx(3.2062, abs=5e-5)
    assert [set(c) for c in document["conditions"]] == [{"coefficients", "value_kgm"}] * 4


def test_force_per_g_of_the_unbalanced_machine(balance):
    """59.617 N per g0 at 5 kg without counter-masses, stated beside what is left with them."""
    counters = ("-c", "counter_A0A=24.2626kg", "-c", "counter_B0B=24.2626kg")
    document = json.loads(balance("check", "parallelogram-6bar", "-p", "platform=5kg", *counters, "--json").out)
    assert document["shaking_force_without_counter_masses_N_per_g"] == pytest.approx(59.617, abs=5e-4)
    assert document["shaking_force_N_per_g"] == pytest.approx((24.276118 - 24.2626) * 0.03755 / 0.15 * 9.81, rel=1e-4)


def test_people_read_the_verdict(balance):
    """Residual with per cent, balanced payload beside the asked one, force per g0; finding a residual is exit 0."""
    code, out, _ = balance("check", "parallelogram-6bar", *BUILT)
    assert code == 0
    for text in ("0.03081 kg m", "4.58 %", "3.2062 kg", "asked: 3.4116 kg", "N per g0"):
        assert text in out


def test_where_there_is_no_force_per_g(balance):
    """A four-bar has no platform: the number is null, and not made up."""
    document = json.loads(balance("check", "four-bar", "-p", "AB=1kg", "-c", "counter_A0A=1kg", "--json").out)
    assert document["shaking_force_N_per_g"] is None
    assert balance("check", "serial-2r", "-p", "link_1=2kg", "-c", "counter_link_1=1kg").code == 0


def test_something_to_check_is_needed(balance):
    """Without --counter the command line is wrong."""
    code, _, err = balance("check", "parallelogram-6bar")
    assert code == 2
    assert "--counter SITE=M" in err
