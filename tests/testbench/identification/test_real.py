"""The two real recordings of a two-joint arm, from log file to first moments and counter-masses.

The aim is 10 % of the published first moments, a larger difference is shown; intervals contain half and double the
cut-off. The other bounds here were set after the results were known: they guard against change, they prove nothing.
"""

import pytest

from balance.mechanism.mjcf_parser import load_mechanism
from studies import simulated_runs as memory
from testbench import rig as rigs
from testbench.figures.estimates import draw_identification
from testbench.identification import identify
from testbench.identification.diagnostics import evidence
from testbench.identification.estimators import Methods
from testbench.identification.records import assemble
from testbench.identification.regression_equations import regression_equations
from testbench.ingestion import Ingest
from testbench.ingestion.planned_runs import PlannedRun
from testbench.store import open_run

from . import arms

pytestmark = pytest.mark.recordings
RECORDINGS = {
    "two-joint-arm-a0": "09_double_pendulum_A0_061705.csv",
    "two-joint-arm-c1": "10_double_pendulum_C1_154548.csv",
}


@pytest.fixture(scope="module", params=list(RECORDINGS))
def result(request, tmp_path_factory):
    """A recording ingested with its rig, and identified."""
    folder = tmp_path_factory.mktemp("campaign")
    log = arms.real(RECORDINGS[request.param])
    Ingest(folder, rigs.load_rig(request.param)).run(PlannedRun(log.stem, (log,)))
    found = assemble(memory.aligned([open_run(folder / f"{log.stem}.h5")], load_mechanism(request.param)))
    return identify(found.records, found.mechanism)


def test_first_moments(result):
    """Both first moments along the links: positive, known to a quarter, their intervals hold half and double."""
    first, _, second, _ = result.first_moments()
    for value in (first, second):
        low, high = value.interval
        assert 0.0 < low < value.value < high
        assert high - low < 0.25 * value.value
        assert len(value.variants) == 5
        assert all(low <= other <= high for other in value.variants.values())


def test_beside_the_published(result):
    """A.0: link 1 with elbow is within 10 % of the published, which its interval holds. C.1 misses that aim, doubtful.

    Two cut-offs predict C.1 equally well (0.3011 and 0.3013 of its torque); it is 8 % off by one, 11 % by the other.
    """
    first, _, second, _ = result.first_moments()
    assert second.value == pytest.approx(second.in_file, rel=0.15)
    if result.mechanism.name == "two-joint-arm-a0":
        assert first.in_file == pytest.approx(0.3491, abs=5e-5)
        assert second.in_file == pytest.approx(0.1111, abs=5e-5)
        assert first.value == pytest.approx(first.in_file, rel=0.10)
        assert first.interval[0] < first.in_file < first.interval[1]
        assert second.interval[0] < 1.02 * second.in_file < second.interval[1]
    else:
        assert result.verdict == "doubtful"
        assert first.value == pytest.approx(first.in_file, rel=0.15)


def test_unexplained_torque(result):
    """Some torque stays unexplained, and more of it as recorded than below the cut-off; less than half in all."""
    assert (result.rms_ratio_in_band > 0.02).all()
    assert (result.rms_ratio_in_band < result.rms_ratio).all()
    assert (result.rms_ratio < 0.5).all()


def test_a_law_would_explain_them_as_well(result):
    """In five seconds of smooth motion the torque of the first joint is one of all angles and speeds as well."""
    assert result.verdict == "doubtful"
    assert "feedback_law" in {doubt.code for doubt in result.doubts}


def test_counter_masses(result):
    """They follow from the two first moments along the links and the length of link 1.

    What is across the links stays, as no site is beside their lines: of least force is then a choice that differs by
    less than that.
    """
    first, across_first, second, across_second = result.first_moments()
    remains = abs(across_first.value) + abs(across_second.value)
    length = {"two-joint-arm-a0": 0.3, "two-joint-arm-c1": 0.2}[result.mechanism.name]
    inner, outer = result.counter_masses()
    assert 0.1 * outer.mass.value == pytest.approx(second.value, abs=remains)
    assert 0.1 * inner.mass.value == pytest.approx(first.value + length * outer.mass.value, abs=remains)
    assert inner.mass.interval[0] < inner.mass.value < inner.mass.interval[1]


def test_figure(result):
    """A panel a joint, each with the torque as recorded, low-passed and predicted; origin and run in the title."""
    figure = draw_identification(result)
    panels = figure.axes
    assert len(panels) == 2
    labels = [line.get_label() for line in panels[0].get_lines()[:3]]
    assert labels[0] == "as recorded"
    assert labels[2] == "model, each block predicted from the others"
    assert figure.get_suptitle().startswith("Origin unstated: two-joint-arm")
    assert panels[0].get_ylabel() == "torque of J1 [N m]"


def test_methods_on_held_out_stretches(result):
    """Instrumental variables beat smoothed least squares by torque and by angle, output error of A.0 by angle."""
    by = {one.method: one for one in result.comparison}
    assert by["iv"].torque_error < by["ls"].torque_error
    assert by["iv"].angles.all_rms < by["ls"].angles.all_rms
    if result.mechanism.name == "two-joint-arm-a0":  # of C.1, doubtful, output error strays 9 % more
        assert by["oe"].angles.all_rms < 0.95 * by["ls"].angles.all_rms
    assert by["oe"].torque_error > by["ls"].torque_error


def test_intervals_hold_filters_and_methods(result):
    """Least squares from half to double the cut-off, and the other methods, lie inside the intervals."""
    evidence, cutoff = result.choice.equations, result.chosen.cutoff
    seen, records = result.identified.identifiability, [part.record for part in evidence.parts]
    for factor in (0.5, 2**-0.5, 1.0, 2**0.5, 2.0):
        at = Methods(
            regression_equations(records, result.mechanism, factor * cutoff),
            result.mechanism,
            seen,
            result.chosen.delay,
        )
        for method in ("ls", "iv", "oe"):
            found = at.identified(method)
            for text, row in result.moment_rows():
                low, high = result.value(row, text).interval
                assert low <= found.estimate(row).value <= high, (factor, method, text)


def test_bodies_exist(result):
    """The identified links can exist; masses, which the record does not tell, are a member of the set, and not more."""
    assert result.consistent.free_is_feasible
    assert result.consistent.least_eigenvalue() > 0.0
    assert "m[link_1]" in result.identified.identifiability.undetermined


def test_what_a_difference_to_the_published_comes_from(result):
    """C.1: with the published friction the first moment is the published to 2 %. A.0: friction does not explain it;
    without the delay, at the highest cut-off, least squares falls to within 4 % of the published, and explains less."""
    found = evidence(result)
    first, _, second, _ = result.first_moments()

    def moment(fit, value):
        return fit["first_moments_kgm"][value.name]["value"]

    with_friction = moment(found["friction_of_file"], first)
    if result.mechanism.name == "two-joint-arm-c1":
        assert with_friction == pytest.approx(first.in_file, rel=0.02)
        return
    assert with_friction > first.value
    noisy, left = found["without_delay"][-1], "rms_ratio_below_cutoff"
    assert moment(noisy, first) == pytest.approx(first.in_file, rel=0.04)
    assert moment(noisy, second) == pytest.approx(second.in_file, rel=0.05)
    assert noisy[left]["J1"] > 3 * found["friction"][3][left]["J1"]
