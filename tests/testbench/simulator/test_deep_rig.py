"""The shipped rig that states everything: it loads, differs from the plain one in nothing else, and its faults show."""

import re
import tomllib

import numpy as np
import pytest

from testbench import campaign_plan
from testbench.errors import RigError
from testbench.rig import load_rig, rig_from_text
from testbench.simulator import simulated_logs

PLAIN, DEEP = load_rig("parallelogram-6bar"), load_rig("parallelogram-6bar-deep")
NEW = {"coupling", "weight", "tilt", "floor", "planes", "rotors", "roughness", "modes", "errors"}


def test_the_same_bench_with_more():
    """Sensors, mounts and base are those of the plain rig; every effect that a bench can have is stated."""
    plain, deep = tomllib.loads(PLAIN.text), tomllib.loads(DEEP.text)
    assert deep["sensors"]["base_acc"].pop("high_pass") == "0.3 Hz"
    assert deep["sensors"] == plain["sensors"]
    assert {key: value for key, value in deep["bench"].items() if key not in NEW} == plain["bench"]
    assert deep["bench"].keys() >= NEW
    for name, logger in plain["loggers"].items():
        assert {key: deep["loggers"][name][key] for key in logger} == logger


def test_every_effect_shows():
    """Taking out any effect of the deep rig changes what the sensors would show: none is stated and then forgotten."""
    planned = campaign_plan.plan_from_text("""
    mechanism = "parallelogram-6bar"
    [[conditions]]
    payload = "5 kg"
    motion = "x"
    peak_acceleration = "2 g0"
    """)

    def logs(stand) -> list[np.ndarray]:
        (run,) = simulated_logs.simulate_logs(planned, stand)
        return [values for log in run.logs.values() for values in log.columns.values()]

    whole = logs(DEEP)
    for key in sorted(NEW):
        without = DEEP.bench.model_copy(update={key: getattr(PLAIN.bench, key)})
        less = logs(DEEP.model_copy(update={"bench": without}))
        assert any(len(a) != len(b) or not np.array_equal(a, b) for a, b in zip(whole, less, strict=True)), key


def test_plan_of_repeats():
    """The deep plan has the published conditions, each three times."""
    published = {
        (r.payload, r.motion, r.peak_acceleration, bool(r.counter_masses))
        for r in campaign_plan.load_plan("kiper2019").runs()
    }
    runs = campaign_plan.load_plan("kiper2019-deep").runs()
    assert {(r.payload, r.motion, r.peak_acceleration, bool(r.counter_masses)) for r in runs} == published
    assert [run.repeat for run in runs[:4]] == [1, 2, 3, 1]
    assert len(runs) == 3 * len(published)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('floor = "VC-A"', 'floors = "VC-A"', r"bench\.floors: unknown key; did you mean 'floor'"),
        ("[bench.rotors.A0]", "[bench.rotors.A0]\nmass = 1", r"bench\.rotors\.A0\.mass: unknown key"),
        ("sensitivity = 0.015", "sensitivities = 0.015", r"bench\.errors\.base_acc\.sensitivities.*'sensitivity'"),
        ("sensitivity = 0.015", "sensitivity = 1.5", r"bench\.errors\.base_acc\.sensitivity: 1\.5"),
        ("damping = 0.015", "damping = 0", r"bench\.modes\[0\]\.damping: 0"),
        ('AC = "22 mm"', 'AC = "22"', r"bench\.planes\.AC: '22' has no unit"),
        ('jitter = "40 us"', 'jitter = "-40 us"', r"loggers\.controller\.jitter: .*zero or more"),
        ('low_pass = "2 kHz"', 'low_pass = "0 Hz"', r"loggers\.daq\.low_pass.*more than zero"),
        ("lost = 0.0005", "lost = 1.0", r"loggers\.controller\.lost"),
        ('coupling = "moving"', 'coupling = "loose"', r"bench\.coupling: 'loose': expected"),
    ],
)
def test_wrong_value(old, new, said):
    """A wrong key or value is blamed on its place."""
    assert old in DEEP.text
    with pytest.raises(RigError, match=re.compile(said)):
        rig_from_text(DEEP.text.replace(old, new, 1))
