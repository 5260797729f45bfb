"""Whole numbers of decimals: whatever the values are, they come back to the bit or are left as they are."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from testbench.store import encodings
from testbench.store.encodings import COMPRESSED, Decimals, Search, from_dict, minus_bits

NAN_WITH_A_MESSAGE = np.array([0x7FF8000000000123], np.uint64).view(np.float64)


def found(*blocks):
    """The form of a channel given in blocks."""
    search = Search()
    for block in blocks:
        search.update(np.asarray(block, dtype=np.float64))
    return search.result()


def back(form, values):
    """What comes back of values, through the type in which they are stored."""
    if not isinstance(form, Decimals):
        return form.stored(values)
    stored = form.stored(values)
    assert stored.dtype == np.dtype(form.kind)
    return form.restored(stored, minus_bits(values) if form.negative_zeros else None)


@settings(max_examples=200, deadline=None)
@given(
    st.integers(0, 15).flatmap(
        lambda d: st.lists(st.integers(-(10**d) * 1000, 10**d * 1000).map(lambda k: f"{k / 10**d:.{d}f}"), min_size=1)
    ),
    st.lists(st.sampled_from(["nan", "-0.0", "0"])),
)
def test_what_a_logger_writes_comes_back_to_the_bit(texts, odd):
    """Any text of up to 15 decimals, with missing values and negative zeros among them."""
    values = np.array([float(text) for text in texts + odd])
    form = found(values[: len(values) // 2], values[len(values) // 2 :])
    assert back(form, values).tobytes() == values.tobytes()
    if np.abs(values[np.isfinite(values)] * 1e15).max(initial=0) < encodings.LARGEST:
        assert isinstance(form, Decimals) or np.isnan(values).all()


@settings(max_examples=200, deadline=None)
@given(st.lists(st.floats(width=64), min_size=1))
def test_any_float64_comes_back_to_the_bit(numbers):
    """Subnormal, huge, infinite: as whole numbers or as they are."""
    values = np.array(numbers)
    assert back(found(values), values).tobytes() == values.tobytes()


def test_fixed_decimals_are_found():
    """The fewest decimals that all have, counted from the smallest number; more in a later block are noticed."""
    assert found([1.25, -0.5], [3.125]) == Decimals(3, -500)
    assert found([100.0, 102.0]) == Decimals(0, 100)
    assert found([0.1, -0.0], [np.nan]) == Decimals(1, 0, "<u4", has_nan=True, negative_zeros=True)
    assert found([0.000001, 5000.0]).kind == "<i8"
    assert found(np.arange(10) / 5120.0).decimals == 10


@pytest.mark.parametrize("odd", [np.pi, np.inf, -np.inf, 5e-324, 1e300, 0.1 + 0.2, 2.0**60, NAN_WITH_A_MESSAGE[0]])
def test_other_numbers_stay_float64(odd):
    """One number among many that is none of fixed decimals: nothing is rounded, nothing is set to NaN."""
    values = np.concatenate([np.arange(10_000) / 10, [odd]])
    assert found(values) is found(values[:5000], values[5000:]) is COMPRESSED
    assert found([np.nan, np.nan]) is COMPRESSED


@pytest.mark.parametrize(
    "known",
    [
        {"decimals": 99, "first": 0},
        {"decimals": -1, "first": 0},
        {"decimals": 2, "first": 2.5},
        {"decimals": 2, "first": 0, "kind": "f8"},
        {"decimals": 2, "first": 10**30},
    ],
)
def test_a_description_of_something_else_is_refused(known):
    """What we never write is not followed."""
    with pytest.raises(ValueError, match=r"no form|expected 0 to 15"):
        from_dict(known)
