"""An arm on a base that turns with it: forces and readings are second differences of where the masses are in space."""

from pathlib import Path

import numpy as np
import pytest

from balance.closure import Closure
from balance.dynamics.regressor import first_moment
from balance.mechanism.mjcf_parser import load_mechanism
from studies import simulated_runs as memory
from testbench import rig as rigs
from testbench.cli.trim import _verdict
from testbench.errors import AnalysisError
from testbench.project import project_problems
from testbench.simulator.simulated_logs import MemoryRun
from testbench.trimming import trim_runs

from . import linkages
from .test_trim import _system

STEP = 1.0 / linkages.RATE
TURN, PUSH = 0.01, 0.002
"""By how much the base turns [rad] and moves [m] at most."""
PLACES = {"a": (0.3, -0.2), "b": (-0.25, -0.15)}
RIDER = """
[bench.rider]
mass = "8 kg"
centre = ["0 m", "-0.1 m", "0 m"]
inertia = ["1 kg m^2", "1 kg m^2", "1 kg m^2"]
[loggers.drive]
"""
ACCELEROMETER = """
[sensors.base_{name}]
kind = "accelerometer"
logger = "drive"
channels = {{ x = "a{name}x", y = "a{name}y" }}
unit = "m/s^2"
noise = "0.005 m/s^2"
position = ["{x} m", "{y} m", "0 m"]
"""


def turning_run(mechanism, places):
    """Encoders, forces, accelerometers of one logger: the mechanism on a base that leans as its first moment moves."""
    rng, time = np.random.default_rng(3), np.arange(0.0, 9.0, STEP)
    path = Closure(mechanism).follow(linkages.motion(mechanism, time, np.random.default_rng(5), 0.25))
    first, mass = first_moment(mechanism, path.q)[:, :2] @ [1.0, 1j], mechanism.total_mass
    leans = (first - first[0]) / np.abs(first - first[0]).max()
    turn, moved = np.exp(1j * TURN * leans.real), PUSH * leans.imag * (1.0 + 0.5j)
    down = mechanism.gravity[:2] @ [1.0, 1j]

    def felt(place):
        """Acceleration less gravity, in the base's axes, of what is at ``place`` of it; of a first moment, per mass."""
        return (np.gradient(np.gradient(moved + turn * place, STEP), STEP) - down) / turn

    force = -mass * felt(first / mass)
    values = {f"q_{j}": path.q[:, mechanism.coordinate_index(j)] for j in mechanism.driven}
    values |= {"Fx": force.real, "Fy": force.imag}
    values = {n: column + rng.normal(0.0, 2e-5 if n[0] == "q" else 0.1, len(time)) for n, column in values.items()}
    for name in places:
        shown = felt(complex(*PLACES[name]))
        values |= {f"a{name}x": shown.real, f"a{name}y": shown.imag}
        values |= {k: values[k] + rng.normal(0.0, 0.005, len(time)) for k in (f"a{name}x", f"a{name}y")}
    text = linkages.HEAD.format(name=mechanism.name).partition("[loggers.plate]")[0]
    text += "".join(linkages.JOINT.format(joint=joint).partition("[sensors.motor")[0] for joint in mechanism.driven)
    text += '[sensors.plate]\nkind = "force"\nlogger = "drive"\nchannels = { x = "Fx", y = "Fy" }\nunit = "N"\n'
    text += 'position = ["0 m", "0 m", "0 m"]\n'
    text += "".join(ACCELEROMETER.format(name=n, x=PLACES[n][0], y=PLACES[n][1]) for n in places)
    data: dict[str, np.ndarray] = {}
    group = linkages.group("drive", values, data, linkages.RATE)
    return MemoryRun(Path("turning.h5"), (group,), "simulated", {"counter_masses": {}}, text, (), {"data": data})


@pytest.mark.parametrize(("places", "half"), [("ab", 0.002), ("a", 0.005)], ids=["two accelerometers", "one"])
def test_the_coriolis_force_is_no_first_moment(places, half):
    """Of a base that turns by 0.01 rad the mechanism on it is held with 2 phi' x p, a fiftieth of what it shakes with:
    what is missing is known as well as noise allows, less well where forces must tell how fast the base turns.
    """
    mechanism = load_mechanism("serial-2r")
    found = trim_runs(memory.aligned([turning_run(mechanism, places)], mechanism), source="wrench")
    masses = np.linalg.lstsq(*_system(mechanism, found), rcond=None)[0]
    for one, mass in zip(found.missing, masses, strict=True):
        moment = mass * one.lever_arm
        assert one.interval[0] < moment < one.interval[1]
        assert one.first_moment.half_width() < half * abs(moment)


def test_an_axis_that_no_accelerometer_shows_is_named():
    """Of a planar arm forces along x tell nothing where no accelerometer shows how the base moves along it."""
    mechanism = load_mechanism("serial-2r")
    run = turning_run(mechanism, "ab")
    rig = rigs.rig_from_text(run.rig.replace('x = "aax", ', "").replace('x = "abx", ', ""))
    found = trim_runs(memory.aligned([run], mechanism, rig), source="wrench")
    assert found.doubts()[0].startswith("the accelerometers on the base leave out x, along which")
    assert _verdict(found, None).startswith("Doubtful (see below): mount nothing yet. Estimate: ")


@pytest.mark.parametrize(
    ("where", "says"),
    [
        (
            ('kind = "force"', 'kind = "force"\nbetween = ["base", "floor"]'),
            "plate: force sensors between base and floor",
        ),
        (("[loggers.drive]", RIDER), "plate: force sensors under a part of the base .bench.rider."),
    ],
)
def test_forces_under_the_base_are_not_those_of_the_mechanism(tmp_path, where, says):
    """They carry what accelerates the base: trim refuses them, and a project with them is told so."""
    mechanism = load_mechanism("serial-2r")
    run = turning_run(mechanism, "a")
    rig = rigs.rig_from_text(run.rig.replace(*where))
    with pytest.raises(AnalysisError, match=rf"{says} carry .* not used .*between mechanism and base"):
        trim_runs(memory.aligned([run], mechanism, rig))
    (tmp_path / "rig.toml").write_text(rig.text, encoding="utf-8")
    assert [p.file for p in project_problems(tmp_path) if p.message == rig.under_base] == ["rig.toml"]
