"""Payloads and counter-masses set in a mechanism, without touching the one that was read."""

from dataclasses import replace

import numpy as np
import pytest

from balance.errors import ModelError
from balance.mechanism.mechanism import PARAMETERS, Mechanism

from .. import models


@pytest.fixture
def manipulator() -> Mechanism:
    """The reduced manipulator as it is shipped."""
    return models.load("parallelogram-6bar")


def test_a_payload_sets_the_mass_at_its_own_centre(manipulator: Mechanism) -> None:
    """Mass, first moments and inertias of that body grow in proportion: same centre, same radii of gyration."""
    heavier = manipulator.with_payload({"AC": 2 * 0.58909})
    row = manipulator.body_index("AC")
    np.testing.assert_allclose(heavier.parameters[row], 2 * manipulator.parameters[row], rtol=1e-15)
    np.testing.assert_array_equal(heavier.centre("AC"), manipulator.centre("AC"))
    assert manipulator.mass("AC") == 0.58909


def test_a_payload_is_set_not_added(manipulator: Mechanism) -> None:
    """The last payload holds, and the first mass comes back."""
    np.testing.assert_allclose(
        manipulator.with_payload({"platform": 5.0}).with_payload({"platform": 1.451}).parameters,
        manipulator.parameters, atol=1e-15,
    )  # fmt: skip


def test_counter_masses_add_up(manipulator: Mechanism) -> None:
    """Mounted twice, both stay; mass, first moment and inertia by Steiner with the site's radius of gyration."""
    once = manipulator.with_counter_mass({"counter_A0A": 2.0}).with_counter_mass(
        {"counter_A0A": 1.0, "counter_B0B": 0.0}
    )
    added = dict(zip(PARAMETERS, once.parameters[0] - manipulator.parameters[0], strict=True))
    assert added["m"] == pytest.approx(3.0)
    assert added["mcx"] == pytest.approx(-3.0 * 0.03755)
    assert added["Izz"] == pytest.approx(3.0 * (0.03755**2 + 0.06**2))
    np.testing.assert_array_equal(once.parameters[1:], manipulator.parameters[1:])
    assert once.mass("A0A") == 1.04642


def test_payload_and_counter_mass_on_one_body_do_not_disturb_each_other(manipulator: Mechanism) -> None:
    """The order in which they are set does not matter: a payload scales the body's own share alone."""
    one = manipulator.with_counter_mass({"counter_A0A": 2.0}).with_payload({"A0A": 3.0})
    other = manipulator.with_payload({"A0A": 3.0}).with_counter_mass({"counter_A0A": 2.0})
    np.testing.assert_allclose(one.parameters, other.parameters, atol=1e-15)


def test_what_was_read_is_frozen(manipulator: Mechanism) -> None:
    """Arrays handed out cannot be written to, with loads or without."""
    for mechanism in (manipulator, manipulator.with_payload({"platform": 5.0})):
        for array in (mechanism.parameters, mechanism.home, mechanism.gravity, mechanism.sites["counter_A0A"].position):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 1.0


def test_parameters_are_named_in_order(manipulator: Mechanism) -> None:
    """``pi`` is body by body, ten a body."""
    names = manipulator.parameter_names
    assert names[:2] == ["m[A0A]", "mcx[A0A]"]
    assert names[-1] == "Izz[platform]"
    assert manipulator.pi[names.index("m[platform]")] == 1.451
    assert manipulator.total_mass == pytest.approx(2 * (1.04642 + 0.58909) + 1.451)


@pytest.mark.parametrize("mass", [0.0, -1.0, float("nan"), float("inf")])
def test_impossible_payloads(manipulator: Mechanism, mass: float) -> None:
    """A payload must be a positive mass: the body and the value are named."""
    with pytest.raises(ModelError, match=rf"payload of body 'platform' is {mass:g} kg: expected a positive mass"):
        manipulator.with_payload({"platform": mass})


@pytest.mark.parametrize("mass", [-1.0, float("nan"), float("inf")])
def test_impossible_counter_masses(manipulator: Mechanism, mass: float) -> None:
    """A counter-mass is zero or positive."""
    with pytest.raises(ModelError, match=rf"'counter_A0A' is {mass:g} kg: expected zero or a positive mass"):
        manipulator.with_counter_mass({"counter_A0A": mass})


def test_payloads_by_name(manipulator: Mechanism) -> None:
    """By a body as by the file's own payload; at a site as a mass there, which is added; each body once."""
    named = manipulator.with_payload({"platform": 3.0})
    assert np.array_equal(named.pi, manipulator.with_payload({}, 3.0).pi)
    tip = manipulator.with_payload({"C_platform": 0.5}, 3.0)
    assert np.array_equal(tip.pi, named.with_counter_mass({"C_platform": 0.5}).pi)
    with pytest.raises(ModelError, match="'platform' is stated twice"):
        manipulator.with_payload({"platform": 2.0}, 3.0)
    none = replace(manipulator, payload_bodies=())
    with pytest.raises(ModelError, match=r"0 payload bodies.*data=\"BODY\".*payload_A0A_kg.*sites: counter_A0A"):
        none.with_payload({}, 3.0)


def test_unknown_names_list_what_there_is(manipulator: Mechanism) -> None:
    """A body, a site, a joint that is not there."""
    with pytest.raises(ModelError, match="no body or site 'crate': bodies are A0A, AC, B0B, BD, platform, sites "):
        manipulator.with_payload({"crate": 1.0})
    with pytest.raises(ModelError, match="no site 'nowhere': there are counter_A0A, C_AC"):
        manipulator.with_counter_mass({"nowhere": 1.0})
    with pytest.raises(ModelError, match="no joint 'A9': there are A0, A, B0"):
        manipulator.coordinate_index("A9")
    with pytest.raises(ModelError, match="no moving body 'crate'"):
        manipulator.mass("crate")


def test_a_site_of_the_base_carries_no_counter_mass() -> None:
    """A counter-mass on the base would move nothing."""
    mechanism = models.model(models.mjcf('<site name="floor"/>' + models.link("", "a")))
    with pytest.raises(ModelError, match="'floor' of test is on the base"):
        mechanism.with_counter_mass({"floor": 1.0})


def test_a_massless_body_takes_no_payload() -> None:
    """A body without mass has no centre to set a mass at."""
    mechanism = models.model(models.mjcf(models.link('<body name="frame"/>', "a")))
    with pytest.raises(ModelError, match="'frame' of test has no mass of its own"):
        mechanism.with_payload({"frame": 1.0})
    with pytest.raises(ModelError, match="'frame'"):
        mechanism.centre("frame")


def test_counter_sites_are_those_named_so(manipulator: Mechanism) -> None:
    """Sites named counter... are where counter-masses go when none are named."""
    assert manipulator.counter_sites == ["counter_A0A", "counter_B0B"]
