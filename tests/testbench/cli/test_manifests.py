"""Every row of the manifest of malformed recordings against what ``testbench info`` and ``testbench ingest`` say."""

import csv
import json

import pytest

from ..readers import reading

ANSWERS = {
    "b01_truncated_data.tdms": (
        1,
        "cut_file",
        ["the file ends at byte 970283", "segment 2586", "Time 12940", "Load Cell 4040. 1 12930"],
    ),
    "b03_cut_mid_row.csv": (3, "cut_last_row", ["line 1502: 9 of 21 fields and no line end"]),
    "b04_nan_inf_tokens.csv": (3, "not_a_number", ["in line 11"]),
    "b05_header_repeated.csv": (3, "repeated_header", ["0.00735983"]),
    "b06_time_not_monotonic.csv": (1, "time_not_increasing", ["line 202", "line 401", "-0.9949996471 s at line 601"]),
    "b08_cp1254_turkish.csv": (3, "encoding_inferred", ["cp1254"]),
    "b11_empty.csv": (1, "empty_file", ["empty"]),
    "b13_links_outside.h5": (3, "outside_reference", ["b13_outside"]),
    "b15_mixed_decimal.csv": (1, "decimal_mark_changes", ["the first is '"]),
    "b16_saturated_16g.csv": (3, "clipping", ["1715", "1245", "12", "16 g"]),
    "b18_truncated.mat": (
        1,
        "cut_file",
        ["inside variable 'Hf_chan_2'", "last whole variable is 'Auto_Correlation_2'"],
    ),
    "b19_fewer_rows_than_declared.lvm": (1, "count_contradiction", ["declared 10 samples, found 7"]),
}  # fmt: skip
"""Exit code, a finding, and what its message must hold, by the manifest's ``must_report``."""


@pytest.mark.recordings("malformed")
def test_every_malformed_recording_gets_its_answer(command, tmp_path):
    """All rows: the exit code, and a finding that says what the manifest wants reported; what is refused is not stored.

    ``ingest`` answers as ``info`` does.
    """
    with reading.malformed("manifest.csv").open(encoding="utf-8", newline="") as stream:
        assert {row["file"] for row in csv.DictReader(stream)} == set(ANSWERS)
    for name, (expected, finding, said) in ANSWERS.items():
        code, out, _ = command("info", reading.malformed(name), "--json")
        messages = [f"{f['where']}: {f['message']}" for f in json.loads(out)["findings"] if f["code"] == finding]
        assert (code, bool(messages)) == (expected, True), name
        for text in said:
            assert any(text in message for message in messages), f"{name}: {text!r} in {messages}"
        ingested, _, err = command("ingest", reading.malformed(name), "-o", tmp_path / name)
        assert (ingested, "Traceback" in err, (tmp_path / name).exists()) == (expected, False, expected != 1), name
