"""Published reductions of heavier payloads, predicted by a law of six parameters from those of the lightest."""

from collections.abc import Iterator

from ..table import Row


def study(count: int, brief: bool) -> Iterator[Row]:
    """Mean absolute errors of the law and of the baselines; the law must be better than each, and not better than the
    scatter of a published number, which would mean tuning.
    """
    from testbench import campaign_plan, published_tables

    from .validation import forecast

    made = forecast(published_tables.load_published("kiper2019"), campaign_plan.load_plan("kiper2019"))
    for score in made.scores:
        low, high = (5.0, 9.0) if score is made.scores[0] else (None, None)
        note = f"calibrated {score.calibrated_on:.2f}, each payload left out {score.left_out:.2f}"
        yield Row(f"{score.name}, mean absolute error", score.held_out, "percentage points", low, high, note)
    failing = ", ".join(f"{g.payload_kg:g} kg along {g.axis}" for g in made.groups if g.fails)
    note = f"by the law's own error, from the calibrated numbers; it fails at {failing}"
    yield Row("numbers within their 95 % intervals", 100 * made.covered, "%", 100 * 49 / 54, 100.0, note)
