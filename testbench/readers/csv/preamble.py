"""What comments and the lines above the header say: sensor range, pairs of key and value."""

import re
from collections.abc import Iterable

from ... import units
from ...recording import SensorRange

_RANGE = re.compile(
    r"(?:range|full scale|aralı[kğ]\w*|messbereich)\s*[:=]?\s*(?:±|\+-|\+/-|-\+)\s*(\d+(?:[.,]\d+)?)\s*([^\s,;]+)",
    re.IGNORECASE,
)
_BITS = re.compile(r"\b(\d{1,2})[ -]?bits?\b", re.IGNORECASE)
_LONGEST = 2000
"""Letters of a comment that are looked at."""
_PAIR = re.compile(r"\s*([^:=]{1,60}?)\s*[:=]\s*(.*?)\s*")


def strip(line: str) -> str:
    """A comment without its sign."""
    return line.strip().lstrip("#%/").strip().strip('"')


def ranges(texts: Iterable[str]) -> tuple[SensorRange, ...]:
    """Ranges such as ``range +-16 g, 16 bit``."""
    found = []
    for text in texts:
        bits = _BITS.search(text[:_LONGEST])
        for match in _RANGE.finditer(text[:_LONGEST]):
            if units.is_unit(match[2]):
                limit = float(match[1].replace(",", "."))
                found.append(SensorRange(limit, match[2], int(bits[1]) if bits else None))
    return tuple(found)


def pairs(texts: Iterable[str]) -> dict[str, str]:
    """Lines of the form ``key: value`` or ``key = value``."""
    matches = (_PAIR.fullmatch(strip(text[:_LONGEST])) for text in texts)
    return {match[1]: match[2] for match in matches if match}
