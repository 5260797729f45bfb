"""Bodies that cannot be are refused by name."""

import numpy as np
import pytest

from balance.errors import ModelError
from balance.mechanism.mechanism import Mechanism
from balance.mechanism.mjcf_parser import mechanism_from_text
from balance.mechanism.mjcf_validation import principal_inertias

_ARM = """<mujoco><compiler angle="radian"/><worldbody><body name="base"><body name="arm">
<joint name="J" type="hinge" axis="0 0 1"/><inertial pos="0.1 0 0" mass="{mass}" diaginertia="{inertia}"/>
</body></body></worldbody></mujoco>"""


def arm(mass: str, inertia: str) -> Mechanism:
    """One body that turns about z."""
    return mechanism_from_text(_ARM.format(mass=mass, inertia=inertia), "arm")


def test_a_rod_a_disc_and_a_point_are_bodies() -> None:
    """Limits of what is possible: equality in A + B >= C for a flat body, zero for a point."""
    for inertia in ("0 0.01 0.01", "0.01 0.01 0.02", "0 0 0"):
        assert arm("1", inertia).mass("arm") == 1.0


def test_an_inertia_larger_than_the_sum_of_the_others_is_refused() -> None:
    """MuJoCo refuses it too."""
    import mujoco

    with pytest.raises(ModelError, match=r"'arm'.*sum of the other two"):
        arm("1", "0.001 0.001 0.05")
    with pytest.raises(ValueError, match="inertia must satisfy"):
        mujoco.MjModel.from_xml_string(_ARM.format(mass="1", inertia="0.001 0.001 0.05"))


def test_a_mechanism_without_mass_is_refused() -> None:
    """Nothing to balance is not balanced."""
    with pytest.raises(ModelError, match="no moving body has mass"):
        arm("0", "0 0 0")


def test_principal_inertias_are_about_the_centre_of_mass() -> None:
    """Steiner: the parameters are about the joint, 0.1 m from the centre."""
    assert principal_inertias(arm("2", "0.01 0.02 0.025").parameters[0]) == pytest.approx(
        np.array([0.01, 0.02, 0.025]), rel=1e-12
    )
