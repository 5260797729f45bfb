"""The six linkages of the source against its tables; nothing published is returned as a result."""

import pytest

from balance import datasets
from balance.errors import DataError
from balance.linkages.equivalence_method import balance_linkage
from balance.linkages.linkage_files import linkage_from_table, load_linkage
from balance.linkages.results import compare_published

SIX = ["dwell", "knife", "pantograph", "sewing-machine", "dwell-short", "dwell-short-two-point"]
CUT = {("dwell", "m_z4"), ("sewing-machine", "I12*")}
CONTRADICTED = {
    ("knife", "I_m_z2"), ("knife", "I9*"), ("pantograph", "I_z1"), ("pantograph", "I_z3"),
    ("sewing-machine", "I_z5"), ("sewing-machine", "I_z6"), ("sewing-machine", "I_z7"),
}  # fmt: skip


@pytest.fixture(scope="module")
def comparisons():
    """Every linkage of the source, balanced, and compared with its source."""
    return {name: compare_published(balance_linkage(load_linkage(name))) for name in SIX}


@pytest.mark.parametrize("name", SIX)
def test_what_the_published_inputs_determine_agrees_within_their_rounding(name, comparisons):
    """Every published value, but those that the source itself contradicts, is one that the rounded inputs can give."""
    for row in comparisons[name].rows:
        if (name, row.name) in CONTRADICTED:
            assert row.verdict == "differs"
            assert row.why
        elif (name, row.name) in CUT:
            assert row.verdict == "agrees, cut off"
        else:
            assert row.verdict == "agrees", row
        # nominal values are within 2 % of published ones that have three digits or more: wide intervals hide nothing
        if row.verdict == "agrees" and row.explained is None and row.published.half_unit < 0.003 * row.published.value:
            assert row.computed == pytest.approx(row.published.value, rel=0.02), row


def test_terms_that_the_source_omits_account_for_its_numbers(comparisons):
    """Without the same terms the method gives the contradicted gear values as published."""
    explained = [row for comparison in comparisons.values() for row in comparison.rows if row.explained is not None]
    assert {row.name for row in explained} == {"I_z1", "I_z3", "I_z4", "I_z5", "I_z6", "I_z7"}
    for row in explained:
        assert row.is_explained
        assert row.explained == pytest.approx(row.published.value, rel=0.006)
        assert row.computed > 1.03 * row.published.value
    carrier = next(row for row in comparisons["pantograph"].rows if row.name == "I_z1")
    assert carrier.computed == pytest.approx(1.98, abs=0.005)  # by its own 1 + Z/Z* = 2, where 1.378 is published


def test_two_point_coupler_needs_five_times_its_inertia():
    """Link 3 of 4.6 must have about 0.191 kg m2, not 0.0399."""
    reshaped = balance_linkage(load_linkage("dwell-short-two-point")).moment.reshaped["3"]
    assert reshaped == pytest.approx(0.191, rel=0.01)


@pytest.mark.parametrize("name", SIX)
def test_results_do_not_come_from_the_published_values(name):
    """Without its published part, a linkage is balanced just the same."""
    import tomllib

    keys = tomllib.loads(datasets.find_dataset(name, "linkages", ".toml").read_text(encoding="utf-8"))
    results = balance_linkage(linkage_from_table(keys, name)).results()
    del keys["printed"]
    assert balance_linkage(linkage_from_table(keys, name)).results() == results


@pytest.mark.parametrize(
    ("printed", "message"),
    [
        ({"values": {"m9*": "1 kg"}}, "'m9\\*' is not a result"),
        ({"valuse": {}}, "printed.valuse: unknown key; did you mean 'values'"),
        (
            {"rms": {"after": ["1 N", "1 N", "1 N m", "1 N m"]}},
            "printed.rms.after: .after.: expected .before., .force. or",
        ),
        (
            {"values": {"I_z2": "1 kg m^2"}, "contradiction": [{"about": "I_z2", "why": "", "omit": {"2": ["I9"]}}]},
            "'I9' is no term of 2",
        ),
    ],
)
def test_published_values_that_mean_nothing_are_refused(printed, message, slider_crank_keys):
    """Each names what is wrong."""
    with pytest.raises(DataError, match=message):
        compare_published(balance_linkage(linkage_from_table({**slider_crank_keys, "printed": printed}, "x")))
