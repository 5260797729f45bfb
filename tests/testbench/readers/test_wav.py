"""WAV, written by the standard library, SciPy, and byte by byte."""

import struct
import wave

import numpy as np
import pytest

from testbench.recording import UniformClock

from . import reading

RANDOM = np.random.default_rng(16)


def _riff(tmp_path, form, data, declared=None, extra=b""):
    size = len(data) if declared is None else declared
    body = b"WAVEfmt " + struct.pack("<I", len(form)) + form + extra + b"data" + struct.pack("<I", size) + data
    path = tmp_path / "run.wav"
    path.write_bytes(b"RIFF" + struct.pack("<I", len(body)) + body)
    return path


def _form(code, channels, rate, bits):
    frame = channels * (-(-bits // 8))
    return struct.pack("<HHIIHH", code, channels, rate, rate * frame, frame, bits)


@pytest.mark.parametrize("width", [1, 2, 3, 4])
def test_integers_are_as_recorded(tmp_path, width):
    """Two channels of integers of each width; nothing is scaled."""
    low, high = (0, 256) if width == 1 else (-(1 << 8 * width - 1), 1 << 8 * width - 1)
    values = RANDOM.integers(low, high, (300, 2))
    path = tmp_path / "run.wav"
    with wave.open(str(path), "wb") as file:
        file.setnchannels(2)
        file.setsampwidth(width)
        file.setframerate(51200)
        file.writeframes(b"".join(int(v).to_bytes(width, "little", signed=width > 1) for v in values.ravel()))
    found = reading.read(path)
    np.testing.assert_array_equal(found.column("channel 2"), values[:, 1])
    assert found.group().clock == UniformClock(51200.0)
    assert found.unit("channel 1") is None


def test_extensible_formats_and_texts_are_read(tmp_path):
    """24 bits in an extensible format; the texts of the file are metadata."""
    form = struct.pack("<HHIIHH", 0xFFFE, 1, 100, 300, 3, 24) + struct.pack("<HHIH14s", 22, 24, 4, 1, bytes(14))
    texts = b"INFOICMT" + struct.pack("<I", 6) + b"hello\0"
    extra = b"LIST" + struct.pack("<I", len(texts)) + texts
    found = reading.read(_riff(tmp_path, form, b"\xff\xff\xff\x01\x00\x00", extra=extra))
    assert found.column("channel 1").tolist() == [-1, 1]
    assert found.recording.metadata["ICMT"] == "hello"


SECOND = b"data" + struct.pack("<I", 20) + bytes(20)
LIST = b"LIST" + struct.pack("<I", 4) + b"INFO"


@pytest.mark.parametrize(
    ("declared", "behind", "message"),
    [
        (40, b"", "cut_file: 10 frames are declared, 5 whole ones"),
        (0xFFFFFFFF, b"", "cut_file: the length of its samples was never written; 5 frames"),
        (0, b"", "cut_file: the length of its samples was never written; 5 frames"),
        (18, b"", "count_contradiction: 18 bytes are declared, which are 4 frames and a part"),
        (20, SECOND, "a second chunk of samples"),
        (20, LIST + SECOND, "a second chunk"),
        (20, struct.pack("<40h", *range(-20, 20)), "more samples than declared"),
        (20, bytes(400), "more samples than declared"),
        (20, LIST, ""),
        (20, b"cue \3\0\0\0abc\0", ""),
        (20, b"\0\0", ""),
    ],
)
def test_lengths_that_contradict_the_file_are_found(tmp_path, declared, behind, message):
    """Cut, never closed, with a part of a frame; and samples behind those declared, as of a recorder that appends."""
    path = _riff(tmp_path, _form(1, 2, 100, 16), bytes(range(20)), declared)
    path.write_bytes(path.read_bytes() + behind)
    text = reading.said(path)
    assert message in text
    assert bool(message) == ("cut_file" in text or "count_contradiction" in text)
    assert len(reading.read(path).column("channel 1")) == (4 if declared == 18 else 5)


@pytest.mark.parametrize("padded", [True, False])
def test_an_odd_length_may_be_padded_or_not(tmp_path, padded):
    """Behind seven bytes of samples the next chunk begins at the next even byte, or, by some writers, at once."""
    path = _riff(tmp_path, _form(1, 1, 100, 8), bytes(7))
    path.write_bytes(path.read_bytes() + bytes(padded) + LIST)
    assert "count_contradiction" not in reading.said(path)


@pytest.mark.parametrize("form", [_form(2, 1, 100, 4), _form(1, 0, 100, 16), _form(3, 1, 100, 16), b"\x01\x00"])
def test_other_formats_are_refused(tmp_path, form):
    """Compressed sound, no channel, floats of two bytes, half a format."""
    assert reading.said(_riff(tmp_path, form, bytes(20))).startswith("damaged_file")


def test_the_other_byte_order_is_read(tmp_path):
    """RIFX: as RIFF, each number with its highest byte first; texts and what lies behind too."""
    form = struct.pack(">HHIIHH", 0xFFFE, 2, 100, 600, 6, 24) + struct.pack(">HHII12s", 22, 24, 4, 1, bytes(12))
    texts = b"INFOICMT" + struct.pack(">I", 6) + b"hello\0"
    body = b"WAVEfmt " + struct.pack(">I", len(form)) + form + b"LIST" + struct.pack(">I", len(texts)) + texts
    body += b"data" + struct.pack(">I", 12) + bytes.fromhex("ffffff 000001 000100 800000")
    path = tmp_path / "run.wav"
    path.write_bytes(b"RIFX" + struct.pack(">I", len(body)) + body + b"data" + struct.pack(">I", 20) + bytes(20))
    found = reading.read(path)
    assert found.column("channel 1").tolist() == [-1, 256]
    assert found.column("channel 2").tolist() == [1, -(1 << 23)]
    assert found.recording.metadata["ICMT"] == "hello"
    assert "a second chunk" in found.message("count_contradiction")
