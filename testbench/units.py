"""Units as loggers write them: which text is a unit, which two are the same, how long a unit of time is.

A small grammar rather than a unit library: reading a header must take a millisecond, and a text that it does not
know stays a text. Quantities that people type are read by ``balance.units``.
"""

import re

_SUPERSCRIPTS = str.maketrans("²³⁴⁻¹·⋅×*", "234-1    ")
_PREFIXES = ("da", *"yzafpnumcdhkMGTPEµμ")
_PREFIXED_WORDS = "m g s N Nm Pa V A W J Hz bar rad sec eps ε Ω ohm F C T strain lbf volt Volt cps"
_PLAIN_WORDS = (
    "min h hr rpm RPM deg degree degrees ° °C °F degC degF K % ‰ dB lb lbs in inch ft psi ksi kp kgf g0 gn gee rev"
    " U turn cycles count counts cnt bit bits digit digits LSB ADC EU Newton Newtons newton newtons meter meters"
    " metre metres second seconds saniye sn dk volts Volts amps ampere Ampere Amps gram grams radian radians"
    " Celsius Kelvin Pascal Grad grad tr rps st N.m Nmm Ncm kgm px frames day days -"
)
_PREFIXED, _PLAIN = frozenset(_PREFIXED_WORDS.split()), frozenset(_PLAIN_WORDS.split())
_USUAL = {
    other: usual
    for usual, others in {
        "deg": "° degree degrees", "rad": "radian radians", "N": "Newton Newtons newton newtons",
        "V": "volt Volt volts Volts", "A": "amp amps Amps ampere Ampere", "m": "meter meters metre metres",
        "Pa": "Pascal", "K": "Kelvin", "degC": "°C Celsius", "degF": "°F", "Ω": "ohm", "ε": "eps strain", "lb": "lbs",
        "kgf": "kp", "cycle": "cycles", "count": "counts cnt", "bit": "bits", "digit": "digits", "turn": "U rev tr",
        "turn min^-1": "rpm RPM", "turn s^-1": "rps", "N m": "Nm N.m", "N mm": "Nmm", "N cm": "Ncm", "kg m": "kgm",
    }.items()
    for other in others.split()
}  # fmt: skip
"""Words and signs of a unit, and how it is usually written."""
_SECONDS = {
    "s": 1.0, "sec": 1.0, "secs": 1.0, "second": 1.0, "seconds": 1.0, "saniye": 1.0, "sn": 1.0, "sek": 1.0,
    "ms": 1e-3, "msec": 1e-3, "millisecond": 1e-3, "milliseconds": 1e-3, "us": 1e-6, "usec": 1e-6,
    "microsecond": 1e-6, "microseconds": 1e-6, "ns": 1e-9, "nsec": 1e-9, "nanoseconds": 1e-9,
    "min": 60.0, "minutes": 60.0, "dk": 60.0, "h": 3600.0, "hr": 3600.0, "hours": 3600.0,
    "day": 86400.0, "days": 86400.0,
}  # fmt: skip
_FACTOR = re.compile(r"([^\d^\s/-][^\d^\s/-]*|-)(?:\^?[({]?(-?\d)[)}]?)?")


def seconds_per(unit: str) -> float | None:
    """Seconds in one ``unit`` of time; None if it is not known as one."""
    return _SECONDS.get(unit.strip().casefold().replace("µ", "u").replace("μ", "u"))


def is_unit(text: str) -> bool:
    """Whether ``text`` is a unit, such as ``m/s^2``, ``N·m`` or ``°/s``."""
    return _factors(text) is not None


def same_unit(one: str | None, other: str | None) -> bool:
    """Whether two texts are one unit in different spelling, such as ``m/s²`` and ``m/s^2``."""
    if one is None or other is None:
        return False
    factors = _factors(one)
    return one.strip() == other.strip() or (factors is not None and factors == _factors(other))


def _factors(text: str) -> dict[str, int] | None:
    """``m/s²`` as {"m": 1, "s": -2}; None if any factor is no known unit."""
    plain = re.sub(r"\s+", " ", text.translate(_SUPERSCRIPTS).replace("**", "^")).strip()
    if not plain or len(plain) > 40:
        return None
    factors: dict[str, int] = {}
    for i, part in enumerate([plain] if plain == "-" else re.sub(r"[()]", " ", plain).split("/")):
        for word in part.split() or [""]:
            match = _FACTOR.fullmatch(word)
            if word == "1" and i == 0:
                continue
            unit = match[1] if match else ""
            known = unit in _PLAIN or unit in _PREFIXED or unit.casefold() in _SECONDS
            if match is None or not (known or any(unit.removeprefix(p) in _PREFIXED for p in _PREFIXES)):
                return None
            power = int(match[2] or 1)  # of the last part: Nm^2 is N m^2
            for part_of in map(_FACTOR.fullmatch, reversed(_usual(unit).split())):
                assert part_of is not None
                name, own = part_of[1], int(part_of[2] or 1)
                factors[name] = factors.get(name, 0) + own * power * (-1 if i else 1)
                power = 1
    return factors or None


def _usual(unit: str) -> str:
    """A unit that is known, as it is usually written: ``us`` as ``µs``, ``kNm`` as ``kN m``."""
    if (seconds := seconds_per(unit)) is not None:
        unit = next(name for name, length in _SECONDS.items() if length == seconds)
    known = unit in _PLAIN or unit in _PREFIXED
    prefix = "" if known else next((p for p in _PREFIXES if unit.removeprefix(p) in _PREFIXED), "")
    word = unit[len(prefix) :]
    return ("µ" if prefix in ("u", "μ") else prefix) + _USUAL.get(word, word)
