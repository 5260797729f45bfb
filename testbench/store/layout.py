"""Names inside a run's HDF5 file, and its description read back: all that our own reader needs besides the samples.

The description is one JSON text. Attributes say the same to other people's tools. They are not read here: HDF5 keeps
texts of varying length in a heap, and one flipped bit there makes it search without end.
"""

import json
import re
import unicodedata
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from ..errors import StoreError
from . import safe_hdf5
from .chunk_io import digest_of_texts

if TYPE_CHECKING:
    import h5py

LAYOUT = 1
"""Version of this layout."""
MARK = "counterpoise_layout"
"""The attribute of the file that holds it, by which a stored run is known."""

ENTRY = "entry"
CONDITIONS = f"{ENTRY}/conditions"
PROVENANCE = f"{ENTRY}/provenance"
START_TIME = f"{ENTRY}/start_time"
"""When the first sample of the run was taken, in ISO 8601, as NXentry has it."""
NOTES = f"{ENTRY}/notes"
DESCRIPTION = f"{NOTES}/description"
FINDINGS = f"{NOTES}/findings"
RIG = f"{NOTES}/rig"
MECHANISM = f"{NOTES}/mechanism"
MOTION = f"{NOTES}/motion"
"""Name and texts of the files that a run was made with: of the mechanism; of the motion, and of its samples."""
TEXTS = (FINDINGS, RIG, MECHANISM, MOTION)
"""Texts beside the description, which has the digest of each that is there."""
MINUS = f"{NOTES}/negative_zeros"
"""Of channels kept as whole numbers: a bit for each zero with a minus sign."""
TIME = "time"
"""The dataset of time in each group that has one."""
SAMPLE = "sample"
"""The dimension of a group without time."""

_MEANT = re.compile(r"title|(?:.*_)?errors")
"""What NeXus means by a name beside a signal: a heading, and how unsure the values are. A channel is neither."""
_LETTERS = str.maketrans({"ı": "i", "ß": "ss", "ø": "o", "Ø": "O", "æ": "ae", "µ": "u", "μ": "u", "°": "deg"})


def safe_name(written: str, taken: set[str]) -> str:
    """An HDF5 name that NeXus allows, near to ``written``, not among ``taken``; it is added there."""
    plain = unicodedata.normalize("NFKD", written.translate(_LETTERS))
    plain = "".join(c for c in plain if not unicodedata.combining(c))
    base = re.sub(r"[^A-Za-z0-9]+", "_", plain).strip("_")[:60] or "channel"
    if _MEANT.fullmatch(base):
        base = f"{base}_channel"
    name, n = base, 1
    while name in taken:
        n += 1
        name = f"{base}_{n}"
    taken.add(name)
    return name


LARGEST = 64 << 20
"""Texts longer than this that their file does not hold as they are, but deflated, are none of ours [bytes]."""


def read_description(file: "h5py.File") -> dict[str, Any]:
    """The description of a stored run. Raises StoreError if there is none that we know."""
    known = None
    if safe_hdf5.has(file, DESCRIPTION):
        known = json.loads(safe_hdf5.texts(file, DESCRIPTION, LARGEST)[0])
    if not isinstance(known, dict) or known.get("layout") != LAYOUT:
        raise StoreError(f"{file.filename}: not a run stored by this version (layout {LAYOUT})")
    return known


def read_texts(file: "h5py.File", path: str, digests: Mapping[str, Any] | None) -> list[str]:
    """The texts at ``path``, none if nothing is there. Raises StoreError if they are not those that were written."""
    found = safe_hdf5.texts(file, path, LARGEST) if safe_hdf5.has(file, path) else []
    if digests is not None:
        written = digests["texts"].get(path)
        if (digest_of_texts(found, digests["salt"], path) if found else None) != written:
            raise StoreError(f"{file.filename}: {path} is not what was written")
    return found
