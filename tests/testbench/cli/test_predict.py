"""``testbench predict``."""

import json
import sys

import numpy as np
import pytest
from click.testing import CliRunner
from matplotlib.figure import Figure

from balance import datasets
from balance.cli.printing import json_text
from balance.errors import DataError
from studies.kiper2019 import bench_calibration, bench_model, validation
from testbench.campaign_plan import load_plan
from testbench.cli.predict import predict
from testbench.errors import AnalysisError
from testbench.published_tables import load_published

from ...commands import assert_fits, held_to_widths


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The document, the figure, and what prints it for people."""
    figure = tmp_path_factory.mktemp("figure") / "predicted.png"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(validation, "FORMS", validation.FORMS[:2])  # all of them are compared where they are tested
        answered = predict.callback.__wrapped__("kiper2019", None, None, True, str(figure))
    return json.loads(json_text(answered.document)), figure, answered.show


def test_error_on_what_was_held_out(made):
    """At most 9.0 points on 54 numbers; not below 5, which is inside the scatter and would mean tuning."""
    document = made[0]
    errors = [abs(row["predicted_percent"] - row["printed_percent"]) for row in document["predictions"]]
    assert len(errors) == document["numbers_predicted"] == 54
    assert sum(errors) / 54 == pytest.approx(document["mean_absolute_error_points"])
    assert 5.0 < document["mean_absolute_error_points"] <= 9.0


def test_intervals_hold(made):
    """At least 49 of 54 printed numbers lie within the intervals called 95 %, and the output counts them."""
    document = made[0]
    held = [row["interval_percent"][0] <= row["printed_percent"] <= row["interval_percent"][1]
            for row in document["predictions"]]  # fmt: skip
    assert sum(held) >= 49
    assert document["within_interval_share"] == pytest.approx(sum(held) / 54)
    assert any(f"{sum(held)} of 54" in note for note in document["notes"])


def test_at_most_eight_parameters_from_one_payload(made):
    """Each has bounds, an interval within them and a meaning; the calibration saw 24 numbers of 1.451 kg."""
    document = made[0]
    assert document["calibrated_on"] == {"payload_kg": 1.451, "numbers": 24}
    assert len(document["parameters"]) <= 8
    for parameter in document["parameters"]:
        low, high = parameter["bounds"]
        assert low <= parameter["interval"][0] <= parameter["median"] <= parameter["interval"][1] <= high
        assert parameter["meaning"]


def test_baselines_stand_beside(made):
    """The model errs least on what was held out and with payloads left out; every way shows its three errors."""
    model, *others = made[0]["errors"]
    rivals = [row for row in others if not row["name"].startswith("model")]
    assert [row["name"] for row in rivals] == ["constant", "per axis", "nearest acceleration"]
    for key in ("held_out_points", "leave_one_payload_out_points"):
        assert all(model[key] < row[key] for row in rivals)


def test_where_it_fails_is_said(made):
    """3.41 kg along x and 5 kg along z, computed, in the document and in words."""
    document = made[0]
    assert {(row["payload_kg"], row["axis"]) for row in document["fails_at"]} == {(3.4116, "x"), (5.0, "z")}
    assert any("It fails" in note and "5 kg along z" in note for note in document["notes"])


def test_the_slide_is_explained(made):
    """Both numbers, what cannot and what could reconcile them, and that the logs are not available."""
    sensors, notes = made[0]["force_sensors"], made[0]["notes"]
    assert sensors["force_reduction_percent"]["peak_to_peak"] == pytest.approx(14.57, abs=0.01)
    assert sensors["acceleration_reduction_percent"] == 62.76
    assert len(sensors["cannot_reconcile"]) == len(sensors["could_reconcile"]) == 4
    assert "not available" in notes[-1]


def test_forms_and_figure(made):
    """The terms are compared on the calibrated table; the figure is drawn."""
    assert len(made[0]["forms"]) == 2
    assert made[1].read_bytes()[:4] == b"\x89PNG"


def test_tables_fit(made, monkeypatch, capsys):
    """The verdict has the mean error and how many intervals hold; tables fit 80 and 200 columns."""
    titles = held_to_widths(monkeypatch)
    made[2]()
    out = capsys.readouterr().out
    assert_fits(out)
    assert len(titles) == 5
    assert "mean absolute error" in out.splitlines()[0]


def test_an_unknown_table():
    """The shipped tables are named."""
    result = CliRunner().invoke(predict, ["kiper2020"], standalone_mode=False)
    assert "kiper2019" in str(result.exception)


def test_a_table_without_a_plan_and_nothing_leaks(tmp_path, made):
    """A table of one's own needs the plan of its tests, and is predicted with it: every number, parameter and error.

    All 54 numbers that are predicted are replaced in it, and no prediction and no interval moves.
    """
    own = tmp_path / "own.json"
    table = json.loads(datasets.find_dataset("kiper2019", "published", ".json").read_text(encoding="utf-8"))
    rows = table["acceleration_amplitude_reduction_percent"]["rows"]
    for row in rows:
        row[3:] = [90.0 - 0.8 * value if row[0] > 2.0 else value for value in row[3:]]
    own.write_text(json.dumps(table), encoding="utf-8")
    refused = CliRunner().invoke(predict, [str(own)], standalone_mode=False)
    assert isinstance(refused.exception, AnalysisError)
    assert "--plan" in str(refused.exception)
    done = CliRunner().invoke(predict, [str(own), "--plan", "kiper2019"], standalone_mode=False)
    for text in ("residual_mass_kg", "nearest acceleration", "fails", "344.2"):
        assert text in done.stdout
    predictions = made[0]["predictions"]
    assert sum(row[0] > 2.0 for row in rows) * 3 == len(predictions)
    for row in predictions:
        low, high = row["interval_percent"]
        replaced = 90.0 - 0.8 * row["printed_percent"]
        assert f"{row['predicted_percent']:.0f} ({low:.0f} .. {high:.0f})  {replaced:.1f}" in done.stdout


def test_an_unknown_kind_of_figure(tmp_path, monkeypatch):
    """An ending that is no picture is refused, with the endings that are."""
    monkeypatch.setattr("studies.kiper2019.validation.forecast", lambda table, tests: None)
    monkeypatch.setattr("studies.kiper2019.results.prediction", lambda made: Figure())
    result = CliRunner().invoke(predict, ["kiper2019", "--figure", str(tmp_path / "a.foo")], standalone_mode=False)
    assert isinstance(result.exception, DataError)
    assert "svg" in str(result.exception)


def test_without_a_checkout(monkeypatch):
    """Where the study is not, one line says where it is and what to do."""
    monkeypatch.setitem(sys.modules, "studies.kiper2019", None)
    result = CliRunner().invoke(predict, ["kiper2019"], standalone_mode=False)
    assert isinstance(result.exception, AnalysisError)
    assert "studies/kiper2019" in str(result.exception)
    assert "pip install --editable" in str(result.exception)
    assert "\n" not in str(result.exception)


def test_the_linear_bench_is_the_simulator_with_stiff_drives():
    """Two conditions, reductions within 3 points: what is linearised away is the change of configuration."""
    plan, published = load_plan("kiper2019"), load_published("kiper2019")
    pairs, printed = bench_calibration.conditions(published, plan, lightest=True)
    others, _ = bench_calibration.conditions(published, plan, lightest=False)
    assert (len(pairs), len(others), printed.shape) == (8, 18, (8, 3))
    priors = bench_model.Priors.load()
    stiff = {"hub_stiffness": 4e5, "control_stiffness": 4e5, "centre_x": 0.04, "sensor_x": 0.1}
    values = priors.values(np.zeros(len(priors.quantities))) | stiff
    some = [pairs[0], pairs[4]]
    linear = bench_model.LinearBench(some).reductions(values)
    simulated = bench_model.simulated_reductions(bench_model.rig_of(values), some, 2500.0)
    np.testing.assert_allclose(linear, simulated, atol=3.0)


def test_every_bench_within_the_priors_is_a_rig():
    """What the study writes is read as a rig with those values, at both ends of every range."""
    priors = bench_model.Priors.load()
    for side in (-1.0, 1.0):
        values = priors.values(np.full(len(priors.quantities), side * priors.reach))
        bench = bench_model.rig_of(values).bench
        assert bench.mass == pytest.approx(values["mass"], rel=1e-4)
        assert bench.drives["A0"].transmission.stiffness == pytest.approx(values["hub_stiffness"], rel=1e-4)
        assert bench.unstated_mass["platform"] == pytest.approx(values["unstated_mass"], rel=1e-3)
        assert sum(mount.stiffness[1] for mount in bench.mounts) == pytest.approx(values["stiffness_y"], rel=1e-4)


def test_rig_of_the_bench_is_a_new_file(tmp_path):
    """A file that exists stays, and what is of the law is refused beside it."""
    taken = tmp_path / "rig.toml"
    taken.write_text("mine", encoding="utf-8")
    for words, message in ((["--rig", str(taken)], "exists"), (["--rig", "new.toml", "--forms"], "of the law")):
        with pytest.raises(AnalysisError, match=message):
            CliRunner().invoke(predict, ["kiper2019", *words], standalone_mode=False, catch_exceptions=False)
    assert taken.read_text(encoding="utf-8") == "mine"
