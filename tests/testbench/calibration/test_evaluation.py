"""From raw values to SI: against calibration sheets worked by hand, and units that do not lead there."""

import numpy as np
import pytest

from balance.errors import UnitError
from testbench.calibration.definition import Calibration, unit_of_log
from testbench.calibration.evaluation import Column, bind_law, check_law, relative_uncertainty


def channel_of(component, *dimensions):
    """A channel of a sensor, of which the rig states no unit."""
    return Column("channel", "sensor", component, "daq", "", dimensions)


ACC = channel_of("x", "acceleration")
FORCE = channel_of("Fz", "force")


def value(calibration, channel, unit, written):
    """One reading [SI]."""
    law = bind_law(Calibration.model_validate(calibration), [channel], [unit])
    return float(law.component(0, lambda i: np.array([written]))[0])


@pytest.mark.parametrize(
    ("calibration", "channel", "unit", "written", "expected"),
    [
        ({"sensitivity": "10.2 mV/g"}, ACC, "V", 0.0102, 9.81),
        ({"sensitivity": "10.2 mV/g"}, ACC, "mV", 10.2, 9.81),
        ({"sensitivity": "1.04 mV/(m/s^2)"}, ACC, "V", 0.00104, 1.0),
        ({"sensitivity": "-10.2 mV/g"}, ACC, "V", 0.0102, -9.81),
        ({"sensitivity": "100 mV/g", "offset": "2.5 V"}, ACC, "V", 2.6, 9.81),
        ({"sensitivity": "100 mV/g", "offset": "0.5 g"}, ACC, "V", 0.1, 4.905),
        ({"sensitivity": "4.0 pC/N", "amplifier": "10 mV/pC"}, FORCE, "V", 0.04, 1.0),
        ({"sensitivity": "4.0 pC/N", "amplifier": "100 pC/V"}, FORCE, "V", 0.04, 1.0),
        ({"sensitivity": "2 mV/N", "amplifier": "100 V/V"}, FORCE, "V", 0.2, 1.0),
        ({"sensitivity": "4.0 pC/N"}, FORCE, "pC", 40.0, 10.0),
        ({"sensitivity": "0.5 mV/V/kN"}, FORCE, "mV/V", 0.25, 500.0),
        ({"sensitivity": "3 counts/N"}, FORCE, "LSB", 12.0, 4.0),
        ({"sensitivity": "4096 counts/rev"}, channel_of("A0", "angle", "length"), "counts", 1024.0, np.pi / 2),
        ({"offset": "-0.6 N"}, FORCE, "N", -3.1, -2.5),
        ({"offset": "-600 mN"}, FORCE, "kN", 0.001, 1.6),
        ({"polynomial": {"raw": "V", "physical": "kN", "coefficients": [0.1, 2.0, 0.5]}}, FORCE, "V", 2.0, 6100.0),
        ({"polynomial": {"raw": "V", "physical": "kN", "coefficients": [0.1, 2.0, 0.5]}}, FORCE, "mV", 2e3, 6100.0),
    ],
)
def test_one_channel(calibration, channel, unit, written, expected):
    """Sensitivity, amplifier either way round, offsets on either side, polynomials, in any unit of the same kind."""
    assert value(calibration, channel, unit, written) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("uncertainty", "relative"),
    [
        ({"standard": "0.5 %"}, 0.005),
        ({"expanded": "1 %", "coverage_factor": 2}, 0.005),
        ({"expanded": "0.204 mV/g", "coverage_factor": 2}, 0.01),
        ({"standard": {"x": "0.0102 mV/g"}}, 0.001),
        ({"standard": "1 V/N"}, "expected a share such as '0.5 %', or the unit of the sensitivity '10.2 mV/g'"),
        ({"standard": "120 %"}, "expected less than the sensitivity"),
        ({"standard": {"y": "1 %"}}, "no component 'y'"),
        ({"expanded": "1 %"}, "expanded and coverage_factor go together"),
        ({"standard": "1 %", "expanded": "1 %", "coverage_factor": 2}, "expected one of standard, expanded"),
    ],
)
def test_uncertainty_of_a_sensitivity(uncertainty, relative):
    """Standard or expanded, a share or in the unit of the sensitivity; else what was expected is said."""
    if isinstance(relative, float):
        calibration = Calibration.model_validate({"sensitivity": "10.2 mV/g", "uncertainty": uncertainty})
        assert relative_uncertainty(calibration, ACC) == pytest.approx(relative)
        assert bind_law(calibration, [ACC], ["V"]).component(0, lambda i: np.array([0.0102])) == pytest.approx(9.81)
        return
    with pytest.raises((UnitError, ValueError), match=relative):
        check_law(Calibration.model_validate({"sensitivity": "10.2 mV/g", "uncertainty": uncertainty}), [ACC])


@pytest.mark.parametrize(
    ("calibration", "channel", "unit", "said"),
    [
        ({"sensitivity": "10.2 mV/g"}, ACC, "m/s^2", r"takes a log in V, .* already: leave .*1.02 m/s\^2/\(m/s\^2\)"),
        ({"sensitivity": "10.2 mV/g"}, FORCE, "V", "no force"),
        ({"sensitivity": "10.2 pC/g"}, ACC, "V", "takes a log in C, this one is in .V.$"),
        ({"sensitivity": "4 pC/N", "amplifier": "10 mV/g"}, FORCE, "V", "no force"),
        ({"sensitivity": "0 mV/g"}, ACC, "V", "not zero"),
        ({"sensitivity": "10.2"}, ACC, "V", "a number and a unit"),
        ({"sensitivity": "10.2 mV/q"}, ACC, "V", "not a known unit"),
        ({"sensitivity": {"y": "1 mV/g"}}, ACC, "V", "no component 'y'"),
        ({"sensitivity": "1 mV/N", "offset": "1 m"}, FORCE, "V", "offset '1 m'"),
        ({"offset": "1 N"}, FORCE, "V", "no force"),
        ({"polynomial": {"raw": "V", "physical": "N", "coefficients": [0, 1]}}, FORCE, "pC", "takes 'V'"),
        ({"polynomial": {"raw": "V", "physical": "m", "coefficients": [0, 1]}}, FORCE, "V", "gives 'm'"),
        ({"matrix": {"raw": "V", "physical": "N", "rows": [[1, 2], [3, 4]]}}, FORCE, "V", "expected 1 rows of 1"),
    ],
)
def test_units_that_do_not_lead_there(calibration, channel, unit, said):
    """A contradiction is refused with both sides, and no factor is guessed."""
    with pytest.raises(UnitError, match=said):
        value(calibration, channel, unit, 1.0)


@pytest.mark.parametrize(
    ("written", "stated", "found"),
    [("Inkr", "counts", None), ("Inkr", "", "Inkr"), ("V", "mV", "V"), ("mil", "mm", "mil"), (None, "mV", None)],
)
def test_a_unit_that_nobody_knows(written, stated, found):
    """It is none where a person states what it is; a known one, however seldom written, always counts."""
    assert unit_of_log(written, stated) == found


def test_matrix():
    """The cross-talk matrix of a six-axis sensor: the loads that made the readings come back, in N and N m."""
    names = ["Fx", "Fy", "Fz", "Mx", "My", "Mz"]
    channels = [channel_of(n, "force" if n[0] == "F" else "moment") for n in names]
    rng = np.random.default_rng(4)
    per_volt = np.diag([500.0, 500.0, 2e3, 20.0, 20.0, 20.0]) @ (np.eye(6) + 0.03 * rng.normal(size=(6, 6)))
    loads, zero = rng.normal(size=(6, 50)), rng.normal(size=6) * 1e-3
    volts = np.linalg.solve(per_volt, loads) + zero[:, None]
    calibration = Calibration.model_validate({
        "matrix": {"raw": "mV", "physical": {"F": "N", "M": "N mm"},
                   "rows": (per_volt * np.array([1e-3] * 3 + [1.0] * 3)[:, None]).tolist()},
        "offset": {n: f"{1e6 * z!r} uV" for n, z in zip(names, zero.tolist(), strict=True)},
    })  # fmt: skip
    law = bind_law(calibration, channels, ["V"] * 6)
    found = np.stack([law.component(i, lambda j: volts[j]) for i in range(6)])
    np.testing.assert_allclose(found, loads, rtol=1e-9, atol=1e-12)


def test_a_matrix_that_cannot_tell_loads_apart():
    """Two rows that are the same but for a factor."""
    channels = [channel_of("Fx", "force"), channel_of("Fy", "force")]
    calibration = {"matrix": {"raw": "V", "physical": "N", "rows": [[1.0, 2.0], [2.0, 4.0]]}}
    with pytest.raises(UnitError, match="depend on each other"):
        bind_law(Calibration.model_validate(calibration), channels, ["V", "V"])


def test_written_is_the_inverse():
    """What a logger writes of a load reads back as that load; where a line cannot be turned round, it is said."""
    law = bind_law(Calibration(sensitivity="100 mV/g", offset="2.5 V"), [ACC], ["mV"])
    loads = np.linspace(-30.0, 30.0, 7)
    volts = law.written(0, loads)
    assert volts[3] == pytest.approx(2500.0)
    np.testing.assert_allclose(law.component(0, lambda i: volts), loads, atol=1e-12)
    curved = {"polynomial": {"raw": "V", "physical": "N", "coefficients": [0, 1, 2]}}
    with pytest.raises(UnitError, match="only a calibration by sensitivity"):
        bind_law(Calibration.model_validate(curved), [FORCE], ["V"]).written(0, loads)
