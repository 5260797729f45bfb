"""Frames of a CAN bus decoded by a DBC, against their bits by hand, beside the frames themselves."""

from pathlib import Path

import numpy as np
import pytest

from testbench.errors import RecordingError
from testbench.readers import bus_decoding
from testbench.readers.bus_decoding import BusDatabase
from testbench.recording import Block, Channel, Group, Recording, StartTime, TimeColumn

DBC = """VERSION ""
NS_ :
BS_:
BU_: A B
BO_ 291 Motor: 4 A
 SG_ Speed : 0|16@1+ (0.5,-100) [0|0] "rpm" B
 SG_ Torque : 23|16@0- (0.1,0) [0|0] "N·m" B
BO_ 2364540158 EEC1: 8 A
 SG_ EngineSpeed : 24|16@1+ (0.125,0) [0|8031.875] "rpm" B
BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";
BA_DEF_DEF_ "VFrameFormat" "StandardCAN";
BA_DEF_ "ProtocolType" STRING ;
BA_DEF_DEF_ "ProtocolType" "J1939";
BA_ "VFrameFormat" BO_ 2364540158 3;
"""
ZERO = StartTime("2024-05-01T12:00:00Z", "log")
NAMES = ["Timestamp", "F.ID", "F.IDE", "F.DataLength", *(f"F.DataBytes[{k}]" for k in range(8))]
CLOCK = TimeColumn(0, 1.0)


def frames(*rows):
    """A recording of frames, in blocks of two: time, identifier, whether it is extended, bytes."""
    group = Group("CAN", tuple(Channel(name, "s" if name == "Timestamp" else None) for name in NAMES), CLOCK, ZERO)
    table = np.full((len(rows), len(NAMES)), np.nan)
    for i, (identifier, is_extended, data) in enumerate(rows):
        table[i, : 4 + len(data)] = [i / 8, identifier, is_extended, len(data), *data]

    def read(report):
        for begin in range(0, len(rows), 2):
            yield Block(group, tuple(table[begin : begin + 2].T.copy()), begin)

    return Recording(Path("log.mf4"), "none", "none", (group,), read)


def decoded(tmp_path, recording, text=DBC):
    """Columns by group of the decoded recording, its channels, and what was found."""
    (tmp_path / "bus.dbc").write_text(text, encoding="cp1252")
    found, columns, channels = [], {}, {}
    for block in BusDatabase.load(tmp_path / "bus.dbc").applied(recording).blocks(found.append):
        assert block.start == sum(map(len, columns.get(block.group.name, [])[:1]))
        old = columns.get(block.group.name, [np.empty(0)] * len(block.columns))
        columns[block.group.name] = [np.append(a, b) for a, b in zip(old, block.columns, strict=True)]
        channels[block.group.name] = block.group
    return columns, channels, found


def test_each_message_is_a_group(tmp_path):
    """Bits by hand: 0x03E8 / 2 - 100 rpm, -300 / 10 N·m with the high byte first; frames and start are kept."""
    motor = (0x123, 0, b"\xe8\x03\xfe\xd4")
    rows = [motor, (0x124, 0, b"\x01"), motor, (0x0CF00400, 1, bytes(3) + b"\x40\x1f" + bytes(3))]
    rows += [(0x0CF00417, 1, bytes(8)), (0x123, 1, b"\xe8\x03\xfe\xd4"), (0x123, 0, b"\xe8\x03")]
    columns, groups, found = decoded(tmp_path, frames(*rows))
    np.testing.assert_array_equal(columns["CAN Motor"], [[0, 0.25, 0.75], [400.0] * 3, [-30.0, -30.0, np.nan]])
    assert [(c.name, c.unit) for c in groups["CAN Motor"].channels][1:] == [("Speed", "rpm"), ("Torque", "N·m")]
    assert (groups["CAN Motor"].clock, groups["CAN Motor"].zero) == (CLOCK, ZERO)
    np.testing.assert_array_equal(columns["CAN EEC1 of 0x00"], [[0.375], [1000.0]])
    np.testing.assert_array_equal(columns["CAN EEC1 of 0x17"], [[0.5], [0.0]])
    assert len(columns["CAN"][0]) == 7
    assert "2 frames of 2 identifiers are in no message of it" in found[0].message


@pytest.mark.parametrize(
    ("text", "rows", "said"),
    [("no database", [(1, 0, b"")], "not a DBC"), (DBC, None, "holds no frames of a bus")],
)
def test_what_cannot_be_decoded(tmp_path, text, rows, said):
    """A text that is no database; a recording that holds no frames."""
    group = Group("g", (Channel("a"),))
    recording = frames(*rows) if rows else Recording(Path("a.csv"), "", "", (group,), lambda report: iter(()))
    with pytest.raises(RecordingError, match=said):
        decoded(tmp_path, recording, text)


@pytest.mark.parametrize(
    ("identifier", "group"),
    [(0x18FEF121, 0xFEF1), (0x0CF00421, 0xF004), (0x18EA0021, 0xEA00), (0x18EFFF21, 0xEF00), (0x19FEF121, 0x1FEF1)],
)
def test_parameter_groups_of_j1939(identifier, group):
    """Vehicle speed, engine speed, a request to an address, a proprietary one, and one of the upper data page."""
    assert bus_decoding._parameter_group(identifier) == group
