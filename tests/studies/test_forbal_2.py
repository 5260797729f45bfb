"""The forecast for Forbal-2: its page is whole, its motions are the controller's, its numbers those of a simulation."""

import hashlib
import re
from pathlib import Path

import numpy as np
import pytest

from balance.closure import Closure
from balance.dynamics.inverse_dynamics import simulate
from balance.motion import Samples
from studies import forbal_2
from testbench.kinematics.smoothing_and_derivatives import smoothed_derivatives

DIAMOND = np.array([[0.22, 0.22], [0.32, 0.32], [0.42, 0.22], [0.32, 0.12], [0.22, 0.22]])
PATHS = {law: forbal_2.Path(law, np.arange(5.0), DIAMOND, law, 0.5)
         for law in ("constant_waypoints", "trapezoidal_waypoints", "joint_trajectory")}  # fmt: skip


def test_the_page_has_the_digest_of_its_rows():
    """Nobody changes a forecast: the digest is that of the rows, and stands here as it was on the day."""
    page = (Path(__file__).parents[2] / "docs" / "validation" / "forbal-2-forecast.md").read_text("utf-8")
    rows = [line for line in page.splitlines() if re.match(r"\| (constant|trapezoid) \d", line)]
    assert len(rows) == 8 * 2 * len(forbal_2.QUANTITIES)
    assert hashlib.sha256("\n".join(rows).encode()).hexdigest() == (
        "fcce55a54ba1f463e7a3fd2ecd38f09f4f0b430cc322c0c6605abaecbab648c7"
    )
    assert "`fcce55a54ba1f463e7a3fd2ecd38f09f4f0b430cc322c0c6605abaecbab648c7`" in page


@pytest.mark.parametrize("law", PATHS)
def test_joint_positions_lead_the_tool_through_the_way_points(law):
    """By the controller's forward kinematics, from rest to rest."""
    q = forbal_2.joint_positions(PATHS[law])
    tool = np.column_stack([
        forbal_2.LINK_M * np.cos(q[:, 1]) + forbal_2.LAST_LINK_M * np.cos(q[:, 0]),
        forbal_2.LINK_M * np.sin(q[:, 1]) - forbal_2.LAST_LINK_M * np.sin(q[:, 0]),
    ]) + forbal_2.ORIGIN_M  # fmt: skip
    for place in DIAMOND:
        assert np.linalg.norm(tool - place, axis=1).min() < (1e-12 if law != "trapezoidal_waypoints" else 2e-3)
    assert np.abs(q[1] - q[0]).max() < 1e-3
    assert np.abs(q[-1] - q[-2]).max() < 1e-3


def test_the_file_s_values_are_those_of_a_simulation():
    """Regressors times parameters against the recursive inverse dynamics, up to rounding; gravity in both."""
    path, mechanism = PATHS["constant_waypoints"], forbal_2.machine(rings=True)
    still = round(forbal_2.REST_S / forbal_2.STEP_S)
    sent = np.pad(forbal_2.joint_positions(path), ((still, still), (0, 0)), mode="edge")
    moved = smoothed_derivatives(sent, forbal_2.CUTOFF_HZ, 1.0 / forbal_2.STEP_S)
    time = np.arange(len(sent)) * forbal_2.STEP_S
    response = simulate(
        mechanism, Closure(mechanism).follow(Samples(time, moved.q, moved.v, moved.a, mechanism.driven))
    )
    weight = response.weight_moment[:, 1]
    expected = [response.force[:, 0], response.force[:, 2], response.moment[:, 1]]
    expected += [response.moment[:, 1] + weight - weight[0], *(response.torque[joint] for joint in mechanism.driven)]
    found = forbal_2.forecast(path, mechanism)[:, :, 0]
    assert found[0] == pytest.approx([np.abs(one).max() for one in expected], rel=1e-9, abs=1e-12)
    assert found[1] == pytest.approx([np.sqrt(np.mean(one**2)) for one in expected], rel=1e-9, abs=1e-12)


def test_without_rings_only_they_are_missing():
    """Their mass, and nothing else."""
    heavy, light = forbal_2.machine(rings=True), forbal_2.machine(rings=False)
    assert heavy.total_mass - light.total_mass == pytest.approx(0.02982881 + 0.3256004 + 0.08713178, rel=1e-12)
    assert set(heavy.own_mass) - set(light.own_mass) == {"ring_link11", "ring_link21", "ring_link22"}
