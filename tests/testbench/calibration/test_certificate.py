"""Digital calibration certificates: sensitivities with their uncertainties, and files that are not taken for one."""

import json

import numpy as np
import pytest

from testbench.calibration import certificate
from testbench.calibration.certificate import read_certificate, unit_of_dsi
from testbench.calibration.definition import Calibration
from testbench.calibration.evaluation import relative_uncertainty
from testbench.cli.calibrate import calibrate
from testbench.errors import RigError
from testbench.rig import load_rig
from testbench.runs.recalibrate import certified
from testbench.runs.si_run import SIRun
from testbench.store import open_run

from . import volts

FRAME = """<?xml version="1.0" encoding="UTF-8"?>
<dcc:digitalCalibrationCertificate xmlns:dcc="https://ptb.de/dcc" xmlns:si="https://ptb.de/si" schemaVersion="3.3.0">
<dcc:administrativeData><dcc:coreData><dcc:uniqueIdentifier>D-K-4711</dcc:uniqueIdentifier>
<dcc:beginPerformanceDate>2026-03-30</dcc:beginPerformanceDate>
<dcc:endPerformanceDate>2026-03-31</dcc:endPerformanceDate></dcc:coreData>
<dcc:items><dcc:item><dcc:identifications><dcc:identification refType="basic_serialNumber"><dcc:value>2007</dcc:value>
</dcc:identification></dcc:identifications></dcc:item></dcc:items>
<dcc:calibrationLaboratory><dcc:contact><dcc:name><dcc:content lang="en">Lab</dcc:content></dcc:name></dcc:contact>
</dcc:calibrationLaboratory></dcc:administrativeData>
<dcc:measurementResults><dcc:measurementResult><dcc:results><dcc:result><dcc:data><dcc:list>{}</dcc:list></dcc:data>
</dcc:result></dcc:results></dcc:measurementResult></dcc:measurementResults></dcc:digitalCalibrationCertificate>"""
NAMED = "<dcc:quantity><dcc:name><dcc:content>{}</dcc:content></dcc:name>{}</dcc:quantity>"
ONE = r"""<si:real><si:value>{}</si:value><si:unit>{}</si:unit>{}</si:real>"""
SI_1 = (
    """<si:expandedUnc><si:uncertainty>{}</si:uncertainty><si:coverageFactor>{}</si:coverageFactor></si:expandedUnc>"""
)
SI_2 = """<si:measurementUncertaintyUnivariate><si:expandedMU><si:valueExpandedMU>{}</si:valueExpandedMU>
<si:coverageFactor>{}</si:coverageFactor></si:expandedMU></si:measurementUncertaintyUnivariate>"""
STANDARD = """<si:measurementUncertaintyUnivariate><si:standardMU>
<si:valueStandardMU>{}</si:valueStandardMU></si:standardMU></si:measurementUncertaintyUnivariate>"""
LIST = """<si:realListXMLList><si:valueXMLList>{}</si:valueXMLList><si:unitXMLList>{}</si:unitXMLList>
{}</si:realListXMLList>"""
LIST_2 = """<si:measurementUncertaintyUnivariateXMLList><si:expandedMUXMLList>
<si:valueExpandedMUXMLList>{}</si:valueExpandedMUXMLList><si:coverageFactorXMLList>{}</si:coverageFactorXMLList>
</si:expandedMUXMLList></si:measurementUncertaintyUnivariateXMLList>"""
PER = r"\milli\volt\per\metre\second\tothe{2}"
SENSITIVITY = NAMED.format("voltage sensitivity", ONE.format("10.5", PER, SI_2.format("0.105", "2")))
TABLE = NAMED.format("frequency", LIST.format("10 16 80", r"\hertz", "")) + NAMED.format(
    "sensitivity", LIST.format("10.0 10.2 10.4", PER, LIST_2.format("0.1 0.2 0.3", "2"))
)


def written(folder, body, frame=FRAME):
    """A certificate with these quantities."""
    path = folder / "dcc.xml"
    path.write_text(frame.format(body), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("body", "frequency", "value", "relative"),
    [
        (SENSITIVITY, None, 10.5, 0.005),
        (NAMED.format("s", ONE.format("10.5", PER, SI_1.format("0.315", "3"))), None, 10.5, 0.01),
        (NAMED.format("s", ONE.format("10.5", PER, STANDARD.format("0.21"))), None, 10.5, 0.02),
        (NAMED.format("s", ONE.format("10.5", PER, "")), None, 10.5, None),
        (NAMED.format("s", f"<si:hybrid>{ONE.format('10.5', PER, '')}{ONE.format('103', PER, '')}</si:hybrid>"), None,
         10.5, None),
        (TABLE, 10.0, 10.0, 0.005),
        (TABLE, 20.0, 10.2, 0.2 / 2 / 10.2),
        (TABLE.replace("10 16 80", "0 16 80"), 20.0, 10.2, 0.2 / 2 / 10.2),
        (TABLE + NAMED.format("T", ONE.format("23", r"\quux", "")), 80.0, 10.4, 0.3 / 2 / 10.4),
    ],
)  # fmt: skip
def test_a_sensitivity_with_its_uncertainty(tmp_path, body, frequency, value, relative):
    """One value, or that at the nearest frequency; both versions of D-SI; a unit that is not known beside it."""
    found = read_certificate(written(tmp_path, body))
    keys = found.calibration(("acceleration",), frequency)
    column = next(iter(load_rig(volts.HEAD).sensors["acc"].columns("acc")))
    calibration = Calibration.model_validate(keys)
    assert relative_uncertainty(calibration, column) == pytest.approx(relative)
    assert float(calibration.sensitivity.split()[0]) == value
    assert (found.number, found.serials, calibration.date) == ("D-K-4711", ("2007",), "2026-03-31")
    assert "D-K-4711, Lab" in calibration.reference


@pytest.mark.parametrize(
    ("body", "frequency", "message"),
    [
        ("", None, "0 sensitivities to acceleration: expected one.*none"),
        (SENSITIVITY * 2, None, "2 sensitivities.*--quantity"),
        (TABLE, None, "values at 10 to 80 Hz: give --frequency"),
        (TABLE, 200.0, "200 Hz is outside of 10 to 80 Hz"),
        (TABLE.replace("10 16 80", "0 16 80"), 0.0, "0 Hz is outside of 16 to 80 Hz"),
        (TABLE.replace("10 16 80", "0 0 0"), 10.0, "no frequency above 0 Hz"),
        (NAMED.format("s", LIST.format("1 2", PER, "")), 10.0, "without frequencies"),
        (NAMED.format("s", ONE.format("1", r"\volt\per\newton", "")), None, "0 sensitivities to acceleration"),
    ],
)
def test_what_a_certificate_does_not_say(tmp_path, body, frequency, message):
    """None, or more than one sensitivity; a frequency that is missing or outside."""
    found = read_certificate(written(tmp_path, body))
    with pytest.raises(RigError, match=message):
        found.calibration(("acceleration",), frequency)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"<a/>", "its root is 'a'"),
        (b"no xml", "not an XML file"),
        (b'<?xml version="1.0"?><!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>', "document type"),
        ('<?xml version="1.0" encoding="UTF-16"?><a/>'.encode("utf-16"), "not UTF-8"),
        (FRAME.format(NAMED.format("s", ONE.format("nan", PER, ""))).encode(), "finite"),
        (FRAME.format(NAMED.format("s", ONE.format("1", PER, SI_2.format("0.1", "")))).encode(), "coverage factor"),
        (FRAME.format(NAMED.format("s", LIST.format("1 2", PER, LIST_2.format("1 2 3", "2")))).encode(), "3 uncert"),
        (b"x" * 2000, "expected at most"),
    ],
)  # fmt: skip
def test_what_is_no_certificate(tmp_path, content, message, monkeypatch):
    """Other XML, entities, numbers that are none, uncertainties without a factor, a file too large."""
    monkeypatch.setattr(certificate, "LARGEST_BYTES", 1999)
    path = tmp_path / "dcc.xml"
    path.write_bytes(content[:1990] if content[:1] == b"\n" else content)
    if b"si:real" in content:
        monkeypatch.setattr(certificate, "LARGEST_BYTES", 10000)
    with pytest.raises(RigError, match=message):
        read_certificate(path)


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        (r"\volt\per\metre\second\tothe{2}", "V/(m/s^2)"),
        (r"\kilogram\metre\per\second\tothe{2}", "kg*m/s^2"),
        (r"\pico\coulomb\per\newton", "pC/N"),
        (r"\per\second", "1/s"),
        (r"\one", "1"),
    ],
)
def test_units_of_dsi(text, unit):
    """As this product writes them; per is about the next unit alone."""
    assert unit_of_dsi(text) == unit


def test_the_command_records_it(tmp_path, capsys):
    """The sensitivity is applied to the stored run; the uncertainty is the certificate's; the serial number fits."""
    run = volts.stored(tmp_path, volts.HEAD)
    path = written(tmp_path, SENSITIVITY)
    words = [str(run.path.parent), "acc", "--certificate", str(path), "--offset", "2.5 V", "--reason", "new", "--json"]
    assert calibrate.main(words, standalone_mode=False) == 0
    recorded = json.loads(capsys.readouterr().out)["calibration"]
    assert recorded["uncertainty"] == {"expanded": "0.105 mV/(m/s^2)", "coverage_factor": 2.0}
    si = SIRun.of(open_run(run.path))
    (column,) = si.rig.sensors["acc"].columns("acc")
    np.testing.assert_allclose(si.values(column), volts.ACCELERATION / 9.81 * 100.0 / 10.5, atol=1e-7)
    stated = si.sensitivity_uncertainty(column)
    assert (stated.relative, stated.source[:12]) == (pytest.approx(0.005), "DCC D-K-4711")
    sheet = '[sensors.acc.teds]\nserial = "2008"\n'
    other = volts.stored(tmp_path, volts.HEAD + sheet, name="r2", first=2.6)
    with pytest.raises(RigError, match=r"serial number 2007, sensors\.acc\.teds\.serial is 2008"):
        certified(other, "acc", path, None, "")
