"""SHA-256 of the logs that a run was made of: a dataset of fixed size, filled in after HDF5 has closed the file.

A long log's digest is known last. So the run's own digest is computed up to this dataset meanwhile.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import StoreError
from . import fletcher, layout, safe

if TYPE_CHECKING:
    import h5py

LENGTH = 64
"""Hexadecimal digits of a SHA-256."""
_UNKNOWN = "-" * LENGTH
"""Of a log that is not wholly in the run; zeros are those of a run that was not finished."""
_TEXT = re.compile(f"[0-9a-f]{{{LENGTH}}}|{_UNKNOWN}")
_LARGEST = 1 << 20


@dataclass(frozen=True)
class Room:
    """Where the digests of ``count`` sources lie in a file: from byte ``at``, their checksum behind them."""

    at: int
    count: int

    @classmethod
    def of(cls, dataset: "h5py.Dataset") -> "Room":
        """That of ``dataset``, which has one chunk."""
        dataset.flush()
        return cls(int(dataset.id.get_chunk_info(0).byte_offset), len(dataset))

    def fill(self, part: Path, digests: Sequence[str]) -> None:
        """Write the digests and their checksum into a closed file. An empty text: the log is not wholly in it."""
        texts = [digest or _UNKNOWN for digest in digests]
        if len(texts) != self.count or not all(map(_TEXT.fullmatch, texts)):
            raise StoreError(f"{part.name}: {texts} are not the SHA-256 of {self.count} sources; nothing was stored")
        content = "".join(texts).encode("ascii")
        checksum = fletcher.checksum(np.frombuffer(content, np.uint8))
        with part.open("r+b", buffering=0) as stream:
            stream.seek(self.at)
            stream.write(content + checksum.to_bytes(4, "little"))


def without(provenance: Mapping[str, Any]) -> dict[str, Any]:
    """The provenance but for the digests of its sources."""
    sources = [{k: v for k, v in source.items() if k != "sha256"} for source in provenance["sources"]]
    return {**provenance, "sources": sources}


def filled(file: "h5py.File", provenance: Mapping[str, Any]) -> dict[str, Any]:
    """The provenance with the digests of its sources. Raises StoreError if they were never filled in."""
    sources: Iterable[Mapping[str, Any]] = provenance["sources"]
    names = [source["name"] for source in sources]
    found = safe.texts(file, layout.SOURCE_SHA256, _LARGEST) if names else []
    if len(found) != len(names) or not all(map(_TEXT.fullmatch, found)):
        raise StoreError(
            f"{file.filename}: {layout.SOURCE_SHA256} holds {found}, expected a SHA-256 for each of {names}; "
            "the run was not finished, or is damaged"
        )
    known = ["" if digest == _UNKNOWN else digest for digest in found]
    full = [{**source, "sha256": digest} for source, digest in zip(sources, known, strict=True)]
    return {**provenance, "sources": full}
