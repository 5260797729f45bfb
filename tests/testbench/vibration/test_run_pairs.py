"""Which runs are compared with which, and what those lack that are in no pair."""

from dataclasses import dataclass, field, replace
from itertools import permutations
from pathlib import Path

import pytest

from balance.results import document
from testbench.errors import AnalysisError
from testbench.recording import Channel, Finding, Group
from testbench.runs.si_run import SIRun
from testbench.store.ledger import enter_not_stored
from testbench.vibration.run_pairs import pairs

BUILT = {"counter_A0A": 24.2626, "counter_B0B": 24.2626}
RIG = """
mechanism = "parallelogram-6bar"
[loggers.daq]
[sensors.acc]
kind = "accelerometer"
logger = "daq"
channels = { x = "AccX" }
position = ["0 m", "0 m", "0 m"]
"""


@dataclass
class FakeRun:
    """What pairing looks at."""

    name: str
    conditions: dict
    origin: str = "simulated"
    rig: str | None = RIG
    findings: tuple[Finding, ...] = ()
    groups: tuple[Group, ...] = field(default=(Group("daq", (Channel("AccX (g)", "g", "AccX"),)),))
    provenance: dict = field(default_factory=lambda: {"sources": []})
    path: Path = Path("nowhere", "run.h5")
    inputs: dict = field(default_factory=lambda: {"mechanism": ("m.xml", '<text name="payload" data="platform"/>')})


@dataclass
class Samples:
    """A group, of which pairing counts the samples."""

    samples: int


def run(name: str, masses: dict | None, acceleration: float = 3.0, **more) -> FakeRun:
    """A run at 5 kg along x."""
    conditions = {"payload_kg": 5.0, "motion": "x", "peak_acceleration_g": acceleration}
    return FakeRun(name, conditions | ({} if masses is None else {"counter_masses": masses}), **more)


def test_a_run_that_could_not_be_stored_is_named(tmp_path):
    """Of the folder of any run that is compared; with the reason."""
    enter_not_stored(tmp_path, "c.h5", "its log was not given")
    _, findings = pairs([run("a", BUILT, path=tmp_path / "a.h5"), run("b", {}, path=tmp_path / "b.h5")])
    assert [(one.code, one.where) for one in findings] == [("not_stored", "c")]
    assert findings[0].message == "c: is in the run table and not stored: its log was not given"


def test_pairs():
    """Runs of one condition pair, repeats together; another acceleration is another pair."""
    runs = [run("a", BUILT), run("b", {}), run("c", BUILT), run("d", BUILT, 1.0), run("e", {}, 1.0)]
    found, findings = pairs(runs)
    assert [[r.name for r in pair.runs] for pair in found] == [["a", "c", "b"], ["d", "e"]]
    assert found[0].counter_masses == BUILT
    assert not findings


def test_payloads_by_name_are_conditions():
    """Runs with other payloads on bodies or at sites are not compared; the order of their names does not matter."""
    runs = [run(name, masses) for name, masses in (("a", BUILT), ("b", {}), ("c", {}))]
    for each, payloads in zip(runs, ({"tip": 0.1, "tool": 1.0}, {"tool": 1.0, "tip": 0.1}, {"tool": 1.0}), strict=True):
        each.conditions["payloads"] = payloads
    (pair,), findings = pairs(runs)
    assert [one.name for one in pair.runs] == ["a", "b"]
    assert document(pair.key)["payloads_kg"] == {"tip": 0.1, "tool": 1.0}
    assert "tool 1 kg, motion x, 3 g0" in findings[0].message


@pytest.mark.parametrize("stated", [{"payload_kg": 5.0}, {"payloads": {"platform": 5.0}}])
def test_a_payload_of_the_one_payload_body(stated):
    """It is one condition by either column; of another body it is not."""
    moved = {"motion": "x", "peak_acceleration_g": 3.0}
    runs = [run("a", BUILT), FakeRun("b", moved | stated), FakeRun("c", moved | {"payloads": {"platform": 5.0}})]
    (pair,), findings = pairs(runs)
    assert ([one.name for one in pair.runs], pair.key.payload_kg, findings) == (["a", "b", "c"], 5.0, [])
    assert not pairs([runs[0], FakeRun("d", moved | {"payload_kg": 5.0, "payloads": {"tip": 5.0}})])[0]


@pytest.mark.parametrize("none", [{}, {"payloads": {}}, {"payloads": {"tip": 0.0}}])
def test_no_payload_by_name_is_as_the_file_has_it(none):
    """A blank cell beside others that are filled, and zero: one condition, and nothing is missing."""
    runs = [run(name, masses) for name, masses in (("a", BUILT), ("b", {}), ("c", BUILT), ("d", {}))]
    for each, stated in zip(runs, ({}, none, {"payloads": {"tip": 0.1}}, {"payloads": {"tip": 0.1}}), strict=True):
        each.conditions.update(stated)
    found, findings = pairs(runs)
    assert [([one.name for one in pair.runs], pair.key.payloads_kg) for pair in found] == [
        (["a", "b"], {}),
        (["c", "d"], {"tip": 0.1}),
    ]
    assert not findings


def test_no_test_counts_twice():
    """What was saved of a stopped ingest is left out where another run holds more of its logs, and only there."""
    logs = {"sources": [{"name": "a.csv", "size_bytes": 1000}]}
    stopped = (Finding("interrupted", None, None, "the ingest was stopped"),)
    short, longer = (Samples(n) for n in (300, 700))

    def saved(name: str, group: Samples, sources: dict = logs) -> FakeRun:
        return run(name, BUILT, findings=stopped, groups=(group,), provenance=sources)

    whole, without = run("a", BUILT, provenance=logs, groups=(short,)), run("b", {})
    for first, *others in permutations([saved("a.recovered", longer), whole, without]):
        found, findings = pairs([first, *others])
        assert [[r.name for r in pair.runs] for pair in found] == [["a", "b"]]
        assert [(f.code, f.where) for f in findings] == [("held_twice", "a.recovered")]
        assert "a holds more" in findings[0].message
    found, findings = pairs([saved("p", short), saved("q", longer), without])
    assert [r.name for r in found[0].balanced] == ["q"]
    assert [f.where for f in findings] == ["p"]
    other = {"sources": [{"name": "a.csv", "size_bytes": 1001}]}
    for apart in ([saved("p", short)], [saved("p", short), run("a", BUILT, provenance=other)]):
        assert not pairs([*apart, without])[1]
    assert not pairs([saved("p", short, {"sources": []}), saved("q", short, {"sources": []}), without])[1]


def test_none_named_is_none_mounted():
    """A sheet that names no counter-masses, or masses of zero, means none."""
    for masses in (None, {}, {"counter_A0A": 0.0}):
        found, _ = pairs([run("a", BUILT), run("b", masses)])
        assert [r.name for r in found[0].unbalanced] == ["b"]


def test_two_sets():
    """Two sets of counter-masses are two pairs with the same run without."""
    found, _ = pairs([run("a", BUILT), run("b", {"counter_A0A": 20.0}), run("c", {})])
    assert [[r.name for r in pair.runs] for pair in found] == [["a", "c"], ["b", "c"]]


def test_no_partner():
    """A run alone is named with what it lacks; the others are compared all the same."""
    found, findings = pairs([run("a", BUILT), run("b", {}), run("c", BUILT, 1.0), run("d", {}, 2.0)])
    assert len(found) == 1
    assert [(f.code, f.where) for f in findings] == [("no_partner", "c"), ("no_partner", "d")]
    assert "no simulated run without counter-masses at 5 kg, motion x, 1 g0" in findings[0].message
    assert "no simulated run with counter-masses at 5 kg, motion x, 2 g0" in findings[1].message


def test_origins_do_not_mix():
    """A measured run is never compared with a simulated one."""
    found, findings = pairs([run("a", BUILT, origin="measured"), run("b", {})])
    assert not found
    assert [f.where for f in findings] == ["a", "b"]


def test_conditions_missing():
    """A run without the payload that others state is named, with what to do."""
    lacking = run("a", BUILT)
    del lacking.conditions["payload_kg"]
    _, findings = pairs([lacking, run("b", {}), run("c", BUILT)])
    assert [finding.code for finding in findings] == ["conditions_missing"]
    assert "a: its conditions lack payload_kg" in findings[0].message


def test_a_condition_that_no_run_states_is_not_needed():
    """A machine without a payload, moved as its motion's file says: two runs differ in their counter-masses alone."""
    runs = [run("a", BUILT), run("b", {})]
    for one in runs:
        del one.conditions["payload_kg"], one.conditions["peak_acceleration_g"]
    (pair,), findings = pairs(runs)
    assert (pair.key.payload_kg, pair.key.peak_acceleration_g, findings) == (None, None, [])
    assert str(pair.key) == f"motion {pair.key.motion}"
    assert str(replace(pair.key, motion="motion")) == "motion"


def test_no_rig():
    """A run without a rig is refused with what is needed."""
    with pytest.raises(AnalysisError, match=r"a: stored without a rig.*--rig"):
        SIRun.of(run("a", BUILT, rig=None))


def test_doubts():
    """What was found at ingest in a channel of the base is said again; what was found elsewhere is not."""
    clipped = Finding("clipping", "AccX (g)", None, "12 samples")
    other = Finding("clipping", "PlatX (g)", None, "12 samples")
    note = Finding("time_jitter", "AccX (g)", None, "a little")
    found = SIRun.of(run("a", BUILT, findings=(clipped, other, note)))
    assert [d.channel for d in found.doubts(found.rig.base_columns)] == ["AccX (g)"]
