"""The force sensors' extremes beside the acceleration."""

import pytest

from studies.kiper2019.force_slide import reading
from testbench.published_tables import ForceExtremes, load_published


@pytest.fixture(scope="module")
def slide():
    """As printed."""
    return load_published("kiper2019").force_extremes


def test_the_contradiction(slide):
    """14.6 % peak to peak, nothing of the positive peak, where the acceleration falls by 62.8 %."""
    assert slide.spans == pytest.approx((344.2, 294.05))
    assert {name: round(fall, 1) for name, fall in slide.reductions.items()} == {
        "peak_to_peak": 14.6,
        "positive_peak": -0.3,
        "negative_peak": 34.7,
    }
    assert slide.acceleration_percent == 62.76
    assert "14.6 %" in slide.contradiction()
    assert "62.8 %" in slide.contradiction()


def test_beside_the_rigid_mechanism(slide, printed):
    """The printed span is the rigid one within 5 % without counter-masses, a thousandfold with them."""
    found = reading(slide, printed)
    assert 2.0 * found.force_without == pytest.approx(slide.spans[0], rel=0.05)
    assert 2.0 * found.force_left < slide.spans[1] / 1000.0
    assert found.unbalanced_mass * 3.0 * 9.81 * 2.0 == pytest.approx(slide.spans[1])
    assert found.moment_with > 1.2 * found.moment_without


def test_an_offset_changes_no_span(slide):
    """An offset of the sensors moves peaks, not peak to peak."""
    low, high = slide.balanced
    moved = ForceExtremes(slide.without, (low - 25.0, high - 25.0), slide.acceleration_percent)
    assert moved.reductions["peak_to_peak"] == pytest.approx(slide.reductions["peak_to_peak"])
    assert moved.reductions["positive_peak"] > 10.0


def test_no_slide(slide, printed):
    """A table without the slide, or cases without its condition, have none."""
    assert ForceExtremes.of({}, 62.76) is None
    assert reading(slide, printed.of_payload(1.451)) is None
