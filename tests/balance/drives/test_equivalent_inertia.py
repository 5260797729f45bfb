"""Reduced inertia and potential energy, from the model alone."""

from dataclasses import replace

import numpy as np
import pinocchio
import pytest

from balance.closure import Closure
from balance.drives import DriveError, equivalent_inertia
from balance.drives.equivalent_inertia import reduced_to_crank
from balance.errors import ClosureError, ModelError
from balance.mechanism.mjcf_parser import mechanism_from_text
from balance.motion import Samples

from .. import models, referees
from .source import REFERENCE, mechanism

U = np.linspace(0.0, 2.0 * np.pi, 37)
OTHERS = {
    "crank-rocker": models.four_bar(0.31, 0.07, 0.26, 0.22, 0.6),
    "double crank": models.four_bar(0.1, 0.25, 0.28, 0.3, 0.9),
    "arm": models.mjcf(models.link("", "arm"), models.motors("arm") + models.key([0.4])),
}
"""Machines of one degree of freedom that are in no file of the project; bodies without any symmetry."""


@pytest.mark.parametrize("row", REFERENCE["I_phi_table"], ids=lambda row: str(row["phi_deg"]))
def test_inertia_and_potential_are_the_reference_s(row):
    """I, I', V and V' of the source's mechanism, at every 15 degrees, to 1e-6."""
    reduced, u = reduced_to_crank(mechanism()), np.radians(row["phi_deg"])
    mine = [reduced.inertia(u) + 0.42, reduced.inertia_slope(u), reduced.potential(u), reduced.potential_slope(u)]
    theirs = [row["I"], row["dI_dphi"], row["Epot"], row["dEpot_dphi"]]
    np.testing.assert_allclose(mine, theirs, rtol=1e-6, atol=1e-7)
    assert reduced.gains(u)[1] == pytest.approx(-row["dpsi_dphi"], rel=1e-6, abs=1e-8)


def test_extremes_of_inertia_are_the_printed_ones():
    """Largest at 0, smallest at 72.5 and 287.5 degrees."""
    found = equivalent_inertia.inertia_extremes(reduced_to_crank(mechanism()))
    smallest = [np.degrees(u) for u, _, kind in found if kind == "minimum"]
    np.testing.assert_allclose(smallest, REFERENCE["features"]["phi_min_exact_deg"], atol=1e-5)
    largest = max(found, key=lambda extreme: extreme[1])
    assert np.degrees(largest[0]) % 360.0 == pytest.approx(0.0, abs=1e-6)
    assert largest[1] == pytest.approx(REFERENCE["features"]["I_phi0"], rel=1e-6)


@pytest.mark.parametrize("text", OTHERS.values(), ids=OTHERS)
def test_energies_are_pinocchio_s(text):
    """I u'^2 / 2 and the swing of V equal Pinocchio's kinetic and potential energy at closed states, to 1e-12."""
    model = models.model(text)
    reduced = reduced_to_crank(model)
    crank = replace(model, driven=(reduced.crank,))
    rate = np.full((len(U), 1), 1.7)
    trajectory = Closure(crank).follow(Samples(U, U[:, None], rate, 0.0 * rate, joints=(reduced.crank,)))
    pin = model.pinocchio_model()
    data = pin.createData()
    pairs = list(zip(trajectory.q, trajectory.v, strict=True))
    kinetic = np.array([pinocchio.computeKineticEnergy(pin, data, q, v) for q, v in pairs])
    potential = np.array([pinocchio.computePotentialEnergy(pin, data, q) for q in trajectory.q])
    np.testing.assert_allclose(0.5 * reduced.inertia(U) * 1.7**2, kinetic, rtol=1e-12)
    np.testing.assert_allclose(reduced.potential(U), potential, atol=1e-12 * max(1.0, np.abs(potential).max()))


@pytest.mark.parametrize("text", OTHERS.values(), ids=OTHERS)
def test_torque_of_any_motion_is_mujoco_s(text):
    """I u'' + I' u'^2 / 2 + V' is the crank's torque by MuJoCo's inverse dynamics at varying speed, to 1e-9."""
    model = models.model(text)
    reduced, rng = reduced_to_crank(model), np.random.default_rng(3)
    u, rate, second = rng.uniform(0, 2 * np.pi, 12), rng.normal(0, 9, 12), rng.normal(0, 70, 12)
    order = np.argsort(u)
    samples = Samples(u[order], u[order, None], rate[order, None], second[order, None], joints=(reduced.crank,))
    trajectory, referee = Closure(model).follow(samples), referees.MujocoReferee(text, model)
    theirs = [referee.response(*state)[1][0] for state in zip(trajectory.q, trajectory.v, trajectory.a, strict=True)]
    u, rate, second = u[order], rate[order], second[order]
    mine = reduced.inertia(u) * second + 0.5 * reduced.inertia_slope(u) * rate**2 + reduced.potential_slope(u)
    assert referees.relative(mine, np.array(theirs)) < 1e-9


def test_armature_of_the_file_is_part_of_the_inertia():
    """A motor's armature on the crank adds itself; on another joint it adds itself times the gain squared."""
    plain = mechanism()
    armature = np.array([0.02, 0.03, 0.0])
    gain = reduced_to_crank(plain).gains(U)[1]
    added = reduced_to_crank(replace(plain, armature=armature)).inertia(U) - reduced_to_crank(plain).inertia(U)
    np.testing.assert_allclose(added, 0.02 + 0.03 * gain**2, rtol=1e-9)


def test_turning_the_other_way_mirrors():
    """With direction -1 the travel runs through the same states backwards."""
    forth, back = reduced_to_crank(mechanism()), reduced_to_crank(mechanism(), direction=-1)
    np.testing.assert_allclose(back.inertia(U), forth.inertia(-U), rtol=1e-12)
    np.testing.assert_allclose(back.potential_slope(U), -forth.potential_slope(-U), atol=1e-11)
    np.testing.assert_allclose(back.gains(U), -forth.gains(-U), atol=1e-12)


def test_what_cannot_be_reduced_is_refused():
    """Two degrees of freedom, a slide as crank, a rocker that does not come round."""
    with pytest.raises(ModelError, match="2 degrees of freedom"):
        reduced_to_crank(models.load("serial-2r"), "J1")
    with pytest.raises(ModelError, match="slides"):
        reduced_to_crank(mechanism(), "slide")
    with pytest.raises(ClosureError, match="four-bar"):
        reduced_to_crank(models.load("four-bar"), "B0")
    with pytest.raises(ModelError, match="name the one crank"):
        reduced_to_crank(models.load("parallelogram-6bar"))


SCREW = """<mujoco model="screw"><worldbody>
<body name="wheel"><joint name="turn" axis="0 0 1"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>
<body name="nut"><joint name="slide" type="slide" axis="0 0 1"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
</body></worldbody><equality><joint joint1="slide" joint2="turn" polycoef="0 0.01 0 0 0"/></equality>
<actuator><motor joint="turn"/></actuator></mujoco>"""


def test_a_joint_that_is_not_back_after_a_turn_is_named():
    """A screw whose nut goes on with every turn has no periodic equation of motion."""
    with pytest.raises(DriveError, match="'slide' is not back after a turn of the crank"):
        reduced_to_crank(mechanism_from_text(SCREW, "screw.xml"))
