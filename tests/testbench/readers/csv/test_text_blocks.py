import pytest

from testbench.readers.csv.text_blocks import detect_encoding

TURKISH = "Zaman (s);İvme X (m/s²);Açısal hız (°/s);Şaft torku (N·m)\n0,1;0,2;0,3;0,4\n"


@pytest.mark.parametrize("name", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "cp1254"])
def test_encoding_gives_the_text_back(name: str) -> None:
    """Whatever encoding a Turkish header was written in, its letters come back."""
    data = (TURKISH * (20 if "-16-" in name else 1)).encode(name)
    found = detect_encoding(data)
    assert found is not None
    assert data[found.mark :].decode(found.name).startswith(TURKISH)


def test_encoding_without_turkish_letters_is_western() -> None:
    """Degree and micro signs alone, or Icelandic letters, are not taken for Turkish."""
    for text in ("Winkel (°);Größe (µm)\n", "Tími (s);þrýstingur (Pa)\n"):
        found = detect_encoding(text.encode("cp1252"))
        assert found is not None
        assert (found.name, bool(found.inferred)) == ("cp1252", True)


def test_declared_encodings_are_not_called_inferred() -> None:
    """A byte order mark, or valid UTF-8, leaves nothing to infer."""
    assert [detect_encoding(TURKISH.encode(name)).inferred for name in ("utf-8", "utf-8-sig", "utf-16")] == ["", "", ""]


@pytest.mark.parametrize("head", [b"PK\x03\x04....", b"\x1f\x8b\x08", b"\x89HDF\r\n", bytes(range(256)) * 8])
def test_binary_content_is_no_text(head: bytes) -> None:
    """Archives and binary files have no encoding."""
    assert detect_encoding(head) is None
