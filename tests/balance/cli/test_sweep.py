"""``balance sweep``."""

import json

import pytest


def test_command(balance, tmp_path):
    """The least force first: 1.475 kg at the crank is least of all masses, its neighbours on this grid are."""
    line = ["sweep", "four-bar", "--motion", "four-bar", "--rate", "1kHz", "--vary", "counter_A0A.mass=0kg:3kg:61"]
    figure = str(tmp_path / "sweep.png")
    found = json.loads(balance(*line, "--json", "--top", "2", "--figure", figure).out)
    assert sorted((row["counter_A0A_mass_kg"] for row in found["best"]), reverse=True) == pytest.approx(
        [1.5, 1.45], abs=1e-9
    )
    assert balance(*line).out.startswith("Least rms_F_N of 61 designs: ")
    assert (tmp_path / "sweep.png").stat().st_size > 0
    for wrong, refusal in (("counter_A0A.mass=1", "has no unit"), ("counter_A0A=1kg", "expected such as")):
        code, _, err = balance("sweep", "four-bar", "--motion", "four-bar", "--vary", wrong)
        assert code == 2
        assert refusal in err
