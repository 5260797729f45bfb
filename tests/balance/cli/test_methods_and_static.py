"""``balance methods`` and ``balance static``."""

import json

import pytest
from click.testing import CliRunner

from balance import datasets
from balance.cli.methods import methods
from balance.cli.static import static
from balance.mechanism import Mechanism
from balance.motion import Motion


def run(command, *arguments: str) -> tuple[int, str]:
    """Exit code and output of a command."""
    result = CliRunner().invoke(command, arguments, catch_exceptions=False)
    return result.exit_code, result.output


def test_methods_side_by_side(tmp_path):
    """Nine rows, printed conditions beside them; the same numbers in JSON; a figure."""
    figure = tmp_path / "methods.svg"
    code, output = run(methods, "four-bar", "--figure", str(figure))
    assert code == 0
    for text in ("counter-inertia", "three images", "active", "springs", "sufficient, not necessary", "loop closure"):
        assert text in output
    code, output = run(methods, "four-bar", "--json")
    document = json.loads(output)
    rows = {row["method"]: row for row in document["methods"]}
    assert len(rows) == 9
    assert rows["counter-mass"]["force_rms_N"] < 1e-10
    assert rows["counter-inertia"]["moment_rms_Nm"] < 1e-10
    assert rows["counter-mass"]["moment_rms_Nm"] > rows["as it is"]["moment_rms_Nm"]
    assert rows["active"]["needs"]["stroke_x_m"] == pytest.approx(0.1)
    assert [c["verdict"].split(":")[0] for c in document["printed_conditions"]] == [
        "sufficient, not necessary",
        "equal to the derived conditions",
    ]
    assert figure.read_text(encoding="utf-8").startswith("<?xml")


def test_settings_of_methods():
    """Half the stroke, twice the mass; nonsense is a wrong command line."""
    document = [json.loads(run(methods, "serial-1r", "--json", "--stroke", s)[1]) for s in ("100mm", "50mm")]
    masses = [d["methods"][-1]["needs"]["mass_x_kg"] for d in document]
    assert masses[1] == pytest.approx(2 * masses[0])
    assert run(methods, "serial-1r", "--stroke", "-1mm")[0] == 2


def test_static_balance(tmp_path):
    """Swing of the potential energy: all of it, and none to 1e-12 either way."""
    figure = tmp_path / "energy.svg"
    code, output = run(static, "serial-2r", "--json", "--figure", str(figure))
    document = json.loads(output)
    assert code == 0
    assert document["as_it_is"]["potential_swing_J"] > 1.0
    for way in ("counter_masses", "springs"):
        assert document[way]["share_of_unbalanced"] < 1e-12
        assert max(document[way]["holding_torque_peak_Nm"].values()) < 1e-10
    assert len(document["workspace"]["weight_J"]) == document["configurations"]
    assert "potential energy" in figure.read_text(encoding="utf-8").lower() or figure.stat().st_size > 1000
    code, output = run(static, "serial-2r")
    assert "Springs of zero free length" in output


def test_static_places(tmp_path):
    """Places of a file, or a layout, not both."""
    code, output = run(static, "parallelogram-6bar", "-p", "platform=5kg", "--springs", "parallelogram-6bar")
    assert code == 0
    assert "794.89" in output
    assert run(static, "parallelogram-6bar", "--springs", "parallelogram-6bar", "--reach", "1mm")[0] == 2


@pytest.mark.parametrize(
    "name", [n for n in datasets.names("mechanisms", ".xml") if n.startswith(("serial", "four-bar"))]
)
def test_shipped_motions_move_their_mechanism(name):
    """Each chain and the four-bar has a motion of its name that drives all its motors."""
    assert set(Motion.load(name).joints) == set(Mechanism.load(name).driven)
