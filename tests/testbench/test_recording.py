"""What a recording is made of."""

import pytest

from testbench.recording import LONGEST_NAME, Channel, Group


@pytest.mark.parametrize(
    ("written", "held"),
    [("a\0b", "a␀b"), ("half \ud83d", "half ?"), ("Açısal hız (°/s)", "Açısal hız (°/s)"), ("x" * 5000, None)],
)
def test_names_can_be_stored(written, held):
    """NUL and halves of letters, which HDF5 does not hold, are shown as what they are; names end somewhere."""
    channel = Channel(written, written)
    if held is None:
        assert len(channel.name) == LONGEST_NAME
        assert channel.name.endswith("...")
    else:
        assert (channel.name, channel.unit, channel.label, Group(written, ()).name) == (held,) * 4
