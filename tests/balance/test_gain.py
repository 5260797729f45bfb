"""Shaking force per acceleration of the payload."""

import pytest

from balance.gain import shaking_force_per_acceleration
from balance.quantities import G0

from . import models


@pytest.mark.parametrize("name", models.MANIPULATORS)
def test_unbalanced_at_5_kg(name: str) -> None:
    """59.617 N per g0 at 5 kg: the first moment 0.9116 kg m over r, times g0."""
    mechanism = models.load(name).with_payload({"platform": 5.0})
    force = shaking_force_per_acceleration(mechanism, "platform")
    assert force is not None
    assert force * G0 == pytest.approx(59.617, abs=5e-4)
    assert force * G0 == pytest.approx(24.276118 * 0.03755 / 0.15 * G0, rel=1e-6)


def test_balanced_is_nothing() -> None:
    """With the exact counter-masses no force, whatever the direction."""
    mechanism = models.load("parallelogram-6bar").with_payload({"platform": 5.0})
    balanced = mechanism.with_counter_mass({"counter_A0A": 24.276118069, "counter_B0B": 24.276118069})
    assert shaking_force_per_acceleration(balanced, "platform") == pytest.approx(0.0, abs=1e-6)


def test_a_point_mass_on_an_arm_shakes_with_its_mass() -> None:
    """A 2R arm whose only mass is at its tip: one newton per m/s2 and kilogram, in every direction."""
    text = models.load("serial-2r").text
    text = text.replace('mass="1.2"', 'mass="1e-9"').replace('pos="0.11 0 0" mass="0.9"', 'pos="0.25 0 0" mass="3"')
    assert shaking_force_per_acceleration(models.model(text), "link_2") == pytest.approx(3.0, rel=1e-6)


def test_where_there_is_no_such_number() -> None:
    """One degree of freedom, or three: the centre's position does not determine the mechanism."""
    assert shaking_force_per_acceleration(models.load("four-bar"), "AB") is None
    assert shaking_force_per_acceleration(models.load("serial-3r"), "link_3") is None


def test_a_body_that_does_not_move_the_mechanism() -> None:
    """The first link of a 2R arm moves on a circle: its centre in the plane says nothing of the second link."""
    assert shaking_force_per_acceleration(models.load("serial-2r"), "link_1") is None
