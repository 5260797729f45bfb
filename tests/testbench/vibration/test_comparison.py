"""Analysed, simulated and published side by side."""

import dataclasses

import numpy as np
import polars
import pytest

from balance import datasets
from balance.mechanism.mjcf_parser import load_mechanism
from balance.results import document
from testbench.errors import AnalysisError, RigError
from testbench.kinematics.encoder_motion import mechanism_of
from testbench.published_tables import ORIGINAL_LOGS, load_published
from testbench.rig import load_rig
from testbench.runs.si_run import SIRun
from testbench.signal.filters import Band
from testbench.simulator import campaign
from testbench.store import open_campaign
from testbench.vibration.comparison import Prediction, compare_campaign, published_difference_note
from testbench.vibration.metrics import Measure
from testbench.vibration.run_pairs import pairs

RIG = load_rig("parallelogram-6bar")
MECHANISM = load_mechanism(RIG.mechanism)


@pytest.fixture(scope="module")
def comparison(brief):
    """The brief campaign beside the printed table."""
    return compare_campaign(open_campaign(brief.campaign).runs, load_published("kiper2019"), Measure())


def test_printed_values(comparison):
    """Each row has the printed value of its own condition and axis."""
    rows = {(r.analyzed.key.payload_kg, r.analyzed.key.motion, r.analyzed.axis): r for r in comparison.rows}
    assert len(rows) == 12
    assert rows[5.0, "x", "x"].published == 62.76
    assert rows[1.451, "y", "z"].published == 34.99


def test_simulation_agrees_with_strong_signals(comparison):
    """Where the base moves ten times more than the noise even when balanced, logs and simulation agree to a point."""
    strong = [r for r in comparison.rows if r.analyzed.key.motion == "x" and r.analyzed.axis in "xy"]
    assert len(strong) == 4
    for row in strong:
        assert row.analyzed.percent == pytest.approx(row.simulated, abs=1.0)


def test_force_falls_where_the_published_amplitude_does_not(comparison):
    """The shaking force falls by more than 99.9 % along the motion; across it there is none to fall."""
    for row in comparison.rows:
        if row.analyzed.axis == row.analyzed.key.motion:
            assert row.shaking_force > 99.9
        else:
            assert row.shaking_force is None


def test_the_moment_remains(comparison):
    """Along y nothing but force acts and the base falls still; along x the shaking moment goes on rocking it."""
    for row in comparison.rows:
        if row.analyzed.key.motion == "y":
            assert row.simulated > 99.0
        else:
            assert row.simulated < 95.0


def test_notes(comparison):
    """It is said that the original logs are not available, and how many runs are simulated."""
    assert ORIGINAL_LOGS in comparison.notes
    assert comparison.origins == {"simulated": 8}
    assert {document(row)["origin"] for row in comparison.rows} == {"simulated"}


def test_the_reason_is_computed(comparison):
    """Why simulated is not published is said with the numbers of these rows; without both, nothing is said."""
    (reason,) = published_difference_note(comparison.rows)
    y = [row.published for row in comparison.rows if row.analyzed.key.motion == "y"]
    assert f"the published base is reduced by {min(y):.1f} .. {max(y):.1f} %" in reason
    assert reason in comparison.notes
    assert published_difference_note([dataclasses.replace(row, published=None) for row in comparison.rows]) == []


def test_the_force_sensors_contradict(comparison):
    """Both printed numbers stand in the notes: 14.6 % of the force, 62.8 % of the acceleration."""
    assert any("14.6 %" in note and "62.8 %" in note for note in comparison.notes)


def test_rows_have_every_key(comparison):
    """A row has all that readers of the JSON expect."""
    needed = {"payload_kg", "motion", "peak_acceleration_g", "axis", "metric", "analyzed_percent", "simulated_percent",
              "published_percent", "origin"}  # fmt: skip
    assert all(needed <= set(document(row)) for row in comparison.rows)


def test_prediction_is_made_anew(brief, monkeypatch):
    """The prediction rests on rig and conditions alone: neither channels nor truth are read for it."""
    runs = open_campaign(brief.campaign).runs
    pair = pairs(runs)[0][0]
    monkeypatch.setattr(type(runs[0]), "channel", lambda *_: pytest.fail("a channel was read"))
    monkeypatch.setattr(campaign, "write_run_truth", lambda *_: pytest.fail("truth was touched"))
    base, force = Prediction(RIG, MECHANISM, Measure()).reductions(pair)
    assert set(base) == {("base_acc", axis) for axis in "xyz"}
    assert force[pair.key.motion] > 99.0


@pytest.mark.parametrize(("high_hz", "first"), [(12.0, 0), (200.0, 1)])
def test_prediction_is_the_truth_without_noise(brief, high_hz, first):
    """The reductions that are predicted are those of what happened, whatever the band."""
    measure = Measure("peak", Band(0.0, high_hz))
    for pair in pairs(open_campaign(brief.campaign).runs)[0][first::2]:
        predicted = Prediction(RIG, MECHANISM, measure).reductions(pair)[0]
        for axis in "xyz":
            peaks = []
            for run in pair.runs:
                table = polars.read_parquet(brief.logs / "truth" / f"{run.name}.parquet")
                signal = np.concatenate([np.zeros(2370), table[f"Acc{axis.upper()}_m_s2"].to_numpy()])
                peaks.append(measure.amplitude(signal, 10_000.0))
            assert predicted["base_acc", axis] == pytest.approx(100.0 * (1.0 - peaks[0] / peaks[1]), abs=0.1)


def test_a_peak_of_another_kind_names_the_run(brief):
    """Of the campaign, with the column of the run table that is wrong."""
    pair = pairs(open_campaign(brief.campaign).runs)[0][0]
    key = dataclasses.replace(pair.key, peak_acceleration_g=None, peak_acceleration_rad_s2=60.0)
    with pytest.raises(RigError, match=rf"of run {pair.runs[0].name}: moves a point .*\(peak_acceleration_g in a run"):
        Prediction(RIG, MECHANISM, Measure()).reductions(dataclasses.replace(pair, key=key))


def test_another_bench_another_prediction(brief):
    """The prediction depends on the bench that the rig describes."""
    pair = pairs(open_campaign(brief.campaign).runs)[0][0]
    wide = RIG.bench.model_copy(update={"inertia": (50.0, 50.0, 200.0)})
    other = Prediction(RIG.model_copy(update={"bench": wide}), MECHANISM, Measure()).reductions(pair)[0]
    base = Prediction(RIG, MECHANISM, Measure()).reductions(pair)[0]
    assert abs(other["base_acc", "y"] - base["base_acc", "y"]) > 1.0
    assert abs(other["base_acc", "z"] - base["base_acc", "z"]) > 1.0


def test_a_stored_rig_opens_no_file(brief):
    """A stored rig that names a file as its mechanism does not make the program open it."""
    stored = SIRun.of(open_campaign(brief.campaign).runs[0])
    elsewhere = RIG.model_copy(update={"mechanism": "../secret.xml"})
    without = dataclasses.replace(stored.recorded, inputs={})
    with pytest.raises(AnalysisError, match="--mechanism"):
        mechanism_of(SIRun(without, elsewhere), None)


def test_the_stored_mechanism_and_motion_are_simulated(brief, comparison, monkeypatch):
    """A campaign needs nothing but its folder: files of the same names that changed since have no effect."""
    expected = [row.simulated for row in comparison.rows[:3]]
    monkeypatch.setattr(datasets, "ROOT", brief.campaign / "nowhere")
    found = compare_campaign(open_campaign(brief.campaign).runs[:2], None, Measure())
    assert [row.simulated for row in found.rows] == expected
    assert None not in expected
    assert document(found)["published"] is None
    assert found.table()["bench"].tolist() == ["stated"] * 3


def test_a_bench_that_is_assumed_is_said_beside_its_numbers(brief):
    """Of runs whose rig has none: in the table, the print, and the legend of the figure."""
    runs = open_campaign(brief.campaign).runs[:2]
    found = compare_campaign(
        [dataclasses.replace(run, rig=run.rig.partition("[bench]")[0]) for run in runs], None, Measure()
    )
    assert found.table()[["bench", "simulated_percent"]].notna().all().all()
    assert "bench simulated: assumed" in repr(found)
    assert any("(bench assumed)" in text.get_text() for text in found.plot().legends[0].get_texts())
    assert [finding.code for finding in found.findings] == ["bench_assumed"]


def test_what_cannot_be_simulated(brief):
    """A run whose conditions the mechanism does not know keeps its row, without a simulation; a finding says why."""
    runs = open_campaign(brief.campaign).runs[:2]
    runs[0].conditions["counter_masses"] = {"counter_Z": 1.0}
    found = compare_campaign(runs, load_published("kiper2019"), Measure())
    assert [row.simulated for row in found.rows] == [None] * 3
    assert all(row.analyzed.percent > 0.0 and row.bench is None for row in found.rows)
    assert [finding.code for finding in found.findings] == ["not_simulated"]
    assert "counter_Z" in found.findings[0].message


def test_unpublished_conditions_stay(brief):
    """A condition that is not printed keeps its row, without a published value; the notes name what no run has."""
    table = load_published("kiper2019")
    table.rows.clear()
    table.rows[None, "x", None, 3.0] = {"x": 1.0}
    found = compare_campaign(open_campaign(brief.campaign).runs[:2], table, Measure())
    assert [row.published for row in found.rows] == [None] * 3
    assert any("of no run" in note and note.endswith("motion x, peak_acceleration_rad_s2 3.0.") for note in found.notes)


def test_a_wrong_sheet_shows(brief):
    """Logs of 5 kg whose sheet says 2 kg: the simulation of the sheet contradicts them, and the notes say so."""
    runs = open_campaign(brief.campaign).runs[4:6]
    wrong = [dataclasses.replace(run, conditions={**run.conditions, "payload_kg": 2.0}) for run in runs]
    right, contradicted = (
        compare_campaign(some, load_published("kiper2019"), Measure()).notes[-1] for some in (runs, wrong)
    )
    assert "outside the interval" in right
    assert "another bench" not in right
    assert "3 of 3 rows: the rig or the run table describes another bench" in contradicted
