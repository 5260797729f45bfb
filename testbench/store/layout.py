"""Names inside a run's HDF5 file, in one place for writing and reading."""

import re
import unicodedata

LAYOUT = 1
"""Version of this layout."""
MARK = "counterpoise_layout"
"""The attribute of the file that holds it, by which a stored run is known."""

ENTRY = "entry"
CONDITIONS = f"{ENTRY}/conditions"
COUNTER_MASSES = f"{CONDITIONS}/counter_masses"
PROVENANCE = f"{ENTRY}/provenance"
NOTES = f"{ENTRY}/notes"
DESCRIPTION = f"{NOTES}/description"
FINDINGS = f"{NOTES}/findings"
RIG = f"{NOTES}/rig"
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
