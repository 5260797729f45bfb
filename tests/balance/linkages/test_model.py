"""Linkages as MJCF."""

import pytest

from balance.closure import Closure
from balance.errors import ClosureError, ModelError
from balance.linkages.description import Linkage
from balance.linkages.method import balance
from balance.linkages.model import mjcf
from balance.linkages.reading import from_table
from balance.mechanism import Mechanism


def test_gears_in_mujoco_follow_their_ratios():
    """A position of the closed linkage with counter-gears as coupled satisfies MuJoCo's own joint equalities."""
    import mujoco
    import numpy as np

    from balance.linkages.coupling import Couplings
    from balance.linkages.verification import samples

    result = balance(Linkage.load("two-levels"))
    linkage = result.linkage
    plain, geared = (Mechanism.from_text(mjcf(result, stage), "x") for stage in ("before", "complete"))
    closure = Closure(plain)
    start = float(closure.home[plain.coordinate_index("A0")])
    path = Couplings.of(result).extend(closure.follow(samples(linkage, 10.0, 0.2, start, 12)), plain, geared)
    model = mujoco.MjModel.from_xml_string(mjcf(result, "complete", couplings=True))
    data = mujoco.MjData(model)
    first = path.q[0]
    for q, v in zip(path.q, path.v, strict=True):
        data.qpos[:], data.qvel[:] = q - first + model.key_qpos[0], v
        mujoco.mj_forward(model, data)
        assert data.nefc == 2 * 3 + 4
        assert np.abs(data.efc_pos).max() < 1e-9
        assert np.abs(data.efc_vel).max() < 1e-9


def test_the_core_refuses_the_couplings_by_name():
    """A file with gears as joint equalities is for MuJoCo: the core does not drop them silently."""
    text = mjcf(balance(Linkage.load("two-levels")), "complete", couplings=True)
    with pytest.raises(ModelError, match="coupling between joints"):
        Mechanism.from_text(text, "x")


def test_a_linkage_that_does_not_close_is_refused(slider_crank_keys):
    """A connecting rod that is too short is found before anything is simulated."""
    keys = slider_crank_keys
    keys["joints"]["C"]["3"] = ["20 mm", "0 m"]
    with pytest.raises(ClosureError, match=r"cannot be closed near the angles under \[start\]"):
        mjcf(balance(from_table(keys, "x")), "before")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda keys: keys["start"].pop("3"), "does not say how body 3 stands"),
        (lambda keys: keys.pop("drive"), "has no driven joint"),
        (lambda keys: keys.update(drive="A"), "driven joint A must be a revolute joint on the ground"),
    ],
)
def test_what_a_simulation_needs_is_named(change, message, slider_crank_keys):
    """Each in one message."""
    change(slider_crank_keys)
    with pytest.raises(ModelError, match=message):
        mjcf(balance(from_table(slider_crank_keys, "x")), "before")
