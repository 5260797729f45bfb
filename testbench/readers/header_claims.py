"""What a header states, in any format: doubtful units, steps of time, clocks, rates, counts, ranges, origin, start.

A stated value is taken as written; what contradicts the channel's name, or is written in few digits, is a finding. That
a log calls itself simulated counts, that it calls itself measured does not.
"""

import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from ..recording import (
    Block,
    Channel,
    Finding,
    Origin,
    Recording,
    Report,
    SensorRange,
    StartTime,
    TimeColumn,
    UniformClock,
    point_in_time,
)
from ..units import is_unit, same_unit, seconds_per
from .csv.cell_syntax import DAY, may_be_thousands, read_timestamp, zone_minutes

_FORCE = re.compile(r"f|f[xyz_ ]?\d*|(?:force|kraft|kuvvet|hammer|load)\b.*", re.IGNORECASE)
_PURE_FORCE = re.compile(r"f|f[xyz_ ]?\d*|(?:force|kraft|kuvvet)\b.*", re.IGNORECASE)
_ACCELERATION = re.compile(r"a|a[xyz]|acc?(?:\b|[_ xyz\d]|el).*|ivme.*|beschl.*", re.IGNORECASE)
_UNITS_OF_ACCELERATION = ("g", "m/s^2", "m/s2", "mm/s^2", "g0", "gn")
_UNITS_OF_JERK = ("m/s^3", "mm/s^3")
_UNITS_OF_MASS = ("kg", "mg", "lb")
_UNITS_OF_FORCE = ("N", "kN", "lbf", "kgf", "Newtons", "newton")
_EXACT_ENOUGH = 1e-6
_DAYS = ((25_569, 80_000), (719_529, 800_000))
"""Days as spreadsheets (since 1900) and as MATLAB (since the year 0) count them, from 1970 on."""
_SHORTEST_STEP = 2e-5
"""Seconds from one sample to the next that are rather days: 50 kHz, or a sample in two seconds."""


_DOUBTS = (
    (_FORCE, _UNITS_OF_ACCELERATION, "the name says force, the unit acceleration"),
    (_FORCE, _UNITS_OF_JERK, "the name says force, the unit is of jerk"),
    (_PURE_FORCE, _UNITS_OF_MASS, "the name says force, the unit is of mass"),
    (_ACCELERATION, _UNITS_OF_FORCE, "the name says acceleration, the unit force"),
    (_ACCELERATION, _UNITS_OF_JERK, "the name says acceleration, the unit is of jerk"),
)
"""Names, units that do not go with them, and what is said; the first that applies counts."""


def unit_findings(channels: Iterable[Channel]) -> list[Finding]:
    """Channels whose name says force and whose unit says acceleration or mass, and the reverse; jerk for either."""
    found = []
    for channel in channels:
        label = channel.label.strip().replace("İ", "i")
        for named, units, doubt in _DOUBTS:
            if named.fullmatch(label) and any(same_unit(channel.unit, unit) for unit in units):
                message = f"{channel.unit!r}: {doubt}; kept as written"
                found.append(Finding("unit_doubtful", channel.name, None, message))
                break
    return found


def may_be_days(first: float, step: float) -> bool:
    """Whether times without a unit may be days of a calendar: by the first one, and by the step to the next."""
    return any(low <= first < high for low, high in _DAYS) and 0 < step < _SHORTEST_STEP


def step_findings(text: str, what: str) -> list[Finding]:
    """The finding that a step of time is known only to the digits in which it is written."""
    match = re.fullmatch(r"\s*[+-]?(\d*)[.,]?(\d*)(?:[eEdD]([+-]?\d+))?\s*", text)
    if match is None or not (digits := (match[1] + match[2]).lstrip("0")):
        return []
    share = 0.5 / int(digits)
    if share < _EXACT_ENOUGH:
        return []
    message = f"{what} {text.strip()} is written in {len(digits)} digits: the rate is known to {share:.1g} of itself"
    return [Finding("rate_rounded", None, None, message)]


_SMALLEST, _FASTEST = 1e-300, 1e300


def recorded_time(index: int, unit: str | None) -> TimeColumn:
    """The clock of a recorded column of time in its stated unit; without one, seconds are assumed."""
    return TimeColumn(index, seconds_per(unit) if unit else 1.0, assumed=not unit)


def clock_of_step(step_s: float, start_s: float) -> UniformClock | None:
    """The clock of a step [s] and a start [s]; None if they are no step and no time."""
    return clock_of_rate(1.0 / step_s, start_s) if _SMALLEST < step_s < math.inf else None


def clock_of_rate(rate_hz: float, start_s: float = 0.0) -> UniformClock | None:
    """The clock of a rate [Hz] and a start [s]; None if they are no rate and no time."""
    return UniformClock(rate_hz, start_s) if _SMALLEST < rate_hz < _FASTEST and math.isfinite(start_s) else None


_ORIGIN = re.compile(r"\borigin\"?\s*[:=]\s*\"?(\w+)", re.IGNORECASE)
_LONGEST = 2000
"""Letters of a text that are looked at."""


def stated_origin(texts: Iterable[str]) -> Origin:
    """``simulated`` if a text says so; that a log calls itself measured counts for nothing."""
    found = {match[1].casefold() for text in texts for match in _ORIGIN.finditer(text[:_LONGEST])}
    return "simulated" if "simulated" in found else "unstated"


def with_stated_origin(recording: Recording) -> Recording:
    """The recording, ``simulated`` if its comments or metadata say so."""
    if recording.origin != "unstated":
        return recording
    texts = (*recording.comments, *(f"{key}: {text[:_LONGEST]}" for key, text in recording.metadata.items()))
    origin = stated_origin(texts)
    # the data through the recording as it was opened, which may hold a process that waits
    return recording if origin == "unstated" else replace(recording, origin=origin, read=recording.blocks)


SINCE_1970 = StartTime("1970-01-01T00:00:00Z", "time since 1970")
"""The zero of times that are counted from there in UTC."""
DAYS_TO_1970 = 719_163
"""Days of the calendar up to 1970, counted from the year 1."""
_FINER = re.compile(r"(?<=[.,]\d{9})\d+")
_START = re.compile(
    r"(?:(?:test|recording|measurement|acquisition|log|data)[ _]?)?(?:start(?:ed)?|begin|recorded)"
    r"(?:[ _]?(?:at|time|date/time|datetime|date[ _]and[ _]time|date[ _]time))?"
    r"|start[ _]of[ _](?:recording|measurement|test|acquisition)|date/time|date[ _]?time|date[ _]and[ _]time"
    r"|startzeit|messbeginn|aufnahmebeginn|zeitpunkt|başlangıç(?: zamanı)?",
    re.IGNORECASE,
)
_DATE = re.compile(
    r"(?:(?:test|recording|measurement|acquisition|start)[ _]?)?date|(?:start)?datum|tarih", re.IGNORECASE
)
_TIME = re.compile(
    r"(?:(?:test|recording|measurement|acquisition|start)[ _]?)?time|uhrzeit|startzeit|saat", re.IGNORECASE
)
_SAID = re.compile(r"\s*\"?([^:=;,\t\"]{2,40}?)\"?\s*[:=;,\t]\s*\"?([^;\t\"]{5,60}?)\"?[\s;,]*")


def start_at(text: str, source: str) -> StartTime | None:
    """The point in time that a text is, a date with or without a time of day; None where it is not exactly one."""
    text = _FINER.sub("", text.strip())
    time = read_timestamp(text)
    if time is None or not time.notation.date or time.notation.date.startswith("?") or (days := time.days()) is None:
        return None
    coarse = 10.0**-time.decimals if time.notation.clock else DAY / 1e9
    minutes = zone_minutes(text) if time.notation.zone else None
    return point_in_time((days - DAYS_TO_1970) * DAY + time.nanoseconds, source, coarse, minutes)


def stated_start(texts: Iterable[str]) -> StartTime | None:
    """The start that lines such as ``Start time: 2024-03-01 12:00:05`` state, or a date and a time of day apart."""
    said = [match for text in texts if (match := _SAID.fullmatch(text[:_LONGEST]))]
    for match in said:
        if _START.fullmatch(match[1].strip()) and (found := start_at(match[2], match[1].strip())) is not None:
            return found
    dates = [match for match in said if _DATE.fullmatch(match[1].strip())]
    times = [match for match in said if _TIME.fullmatch(match[1].strip())]
    return start_in({"Date": dates[0][2], "Time": times[0][2] if times else ""}, "Date", "Time") if dates else None


def start_in(stated: Mapping[str, str], date: str, time: str) -> StartTime | None:
    """The start that two keys of a header state, its date and its time of day; the date alone if that is all."""
    day = stated.get(date, "")
    return start_at(f"{day} {stated.get(time, '')}".strip(), f"{date}, {time}") or start_at(day, date)


Read = Callable[[Report], Iterator[Block]]

_RANGE = re.compile(
    r"(?:range|full scale|aralı[kğ]\w*|messbereich)\s*[:=]?\s*(?:±|\+-|\+/-|-\+)\s*(\d+(?:[.,]\d+)?)\s*([^\s,;]+)",
    re.IGNORECASE,
)
_BITS = re.compile(r"\b(\d{1,2})[ -]?bits?\b", re.IGNORECASE)
_PAIR = re.compile(r"\s*([^:=]{1,60}?)\s*[:=]\s*(.*?)\s*")
_NUMBER = r"(?P<number>\d+(?:[.,]\d+)?(?:[eE][+-]?\d+)?)"
_OF_SAMPLING = (
    r"(?:\b(?:sampl(?:e|es|ing)?|frame|scan|acquisition|data|log(?:ging|ger)?|record(?:ing)?|update)"
    r"[ _.-]*(?:rate|freq\w*)"
    r"|\bsampl(?:ing|ed)|\babtast\w*|\börnekleme(?: (?:hızı|frekansı|oranı|sıklığı))?|\bfs|(?:^|[,;\t|])\s*\"?rate)"
)
"""What a rate is called that is the data's own: ``rate gyro, bandwidth 80 Hz`` and ``strain rate at 5 Hz`` are none."""
_LINK = r"(?:\s|[:=\"]|\b(?:at|with|of|is|was|per|the|all|each|channels?|bei|mit|für|alle|kanäle)\b)*"
_HERTZ = r"(?P<kilo>k?)(?:Hz|Sa?/s|samples/s|sps)"
_RATES = (
    rf"{_OF_SAMPLING}{_LINK}(?:[,;\t]\s*\"?)?{_NUMBER}[\s,;\"]*{_HERTZ}\b",
    rf"{_OF_SAMPLING}{_LINK}[([]\s*{_HERTZ}\s*[)\]]\"?\s*[:=;,\t]\s*\"?{_NUMBER}",
    rf"\brate_hz(?P<kilo>)\s*[:=]\s*{_NUMBER}",
)
_RATE_OF_OTHERS = re.compile(r"decimat|downsampl|down-sampl|resampl|averag", re.IGNORECASE)
"""Words of a line whose rate is that of other data: what was recorded before it was thinned out."""
_STEP = (
    r"\b(?:sampl\w*[ _](?:interval|period|time)|time[ _](?:step|interval|increment)|delta[ _]?[tx]|dt|Δt"
    r"|abtast(?:intervall|zeit|periode)|örnekleme (?:aralığı|süresi|periyodu))"
)
_UNIT = r"(?P<unit>s|sec|ms|us|µs|μs|ns)"
_STEPS = (
    rf"{_STEP}\"?\s*[:=;,\t ]\s*\"?{_NUMBER}\"?[\s;,]*{_UNIT}\b",
    rf"{_STEP}\s*[([]\s*{_UNIT}\s*[)\]]\"?\s*[:=;,\t]\s*\"?{_NUMBER}",
)
_COUNT = re.compile(
    r"(?:(?:number|no\.?|count)[ _]?of[ _]?(?:samples|points|rows|scans)|samples(?:[ _]per[ _]channel)?|sample[ _]count"
    r"|n(?:um)?[ _]?(?:of[ _])?samples|data[ _]points|record[ _]length|rows"
    r"|anzahl[ _](?:der[ _])?\w*(?:werte|punkte|samples)|örnek sayısı)\s*[:=;,\t]\s*(\d{1,15})(?:[\s;,]+\1)*[\s;,]*",
    re.IGNORECASE,
)
ONE_RATE = 0.005
"""Rates that differ by this share are one, written in few digits."""


def comment_text(line: str) -> str:
    """A comment without its sign."""
    return line.strip().lstrip("#%/").strip().strip('"')


def sensor_ranges(texts: Iterable[str]) -> tuple[SensorRange, ...]:
    """Ranges such as ``range +-16 g, 16 bit``."""
    found = []
    for text in texts:
        bits = _BITS.search(text[:_LONGEST])
        for match in _RANGE.finditer(text[:_LONGEST]):
            if is_unit(match[2]):
                limit = float(match[1].replace(",", "."))
                found.append(SensorRange(limit, match[2], int(bits[1]) if bits else None))
    return tuple(found)


def key_value_pairs(texts: Iterable[str]) -> dict[str, str]:
    """Lines of the form ``key: value`` or ``key = value``."""
    matches = (_PAIR.fullmatch(comment_text(text[:_LONGEST])) for text in texts)
    return {match[1]: match[2] for match in matches if match}


@dataclass(frozen=True)
class StatedSampling:
    """What is stated of the data: ``rate_hz``, the ``samples`` of each channel, and what is odd in that."""

    rate_hz: float | None = None
    samples: int | None = None
    findings: tuple[Finding, ...] = ()

    def checked(self, read: Read) -> Read:
        """``read`` that reports at its end if it brought another number of samples than is stated."""
        stated = self.samples
        if stated is None:
            return read

        def counted(report: Report) -> Iterator[Block]:
            found: Counter[str] = Counter()
            for block in read(report):
                found[block.group.name] += len(block)
                yield block
            total = found.total()
            if stated != total and any(samples != stated for samples in found.values()):
                code = "count_contradiction" if total < stated else "header_contradiction"
                message = f"the lines above the data state {stated} samples, {total} are there"
                report(Finding(code, None, None, message))

        return counted


def stated_sampling(texts: Iterable[str], decimal: str) -> StatedSampling:
    """What the ``texts`` state of sampling in a file whose numbers have this ``decimal`` mark."""
    texts = [text[:_LONGEST] for text in texts]
    rates, steps = set[float](), dict[str, Fraction]()
    for match in _matches(_RATES, [text for text in texts if not _RATE_OF_OTHERS.search(text)]):
        if rate := _value(match["number"], decimal) * (1000 if match["kilo"] else 1):
            rates.add(float(rate))
    for match in _matches(_STEPS, texts):
        if step := _value(match["number"], decimal) * Fraction(repr(seconds_per(match["unit"]) or 0.0)):
            steps[match["number"]] = step
    stated = [*sorted(rates), *(float(1 / step) for step in steps.values())]
    counts = {int(found[1]) for text in texts if (found := _COUNT.fullmatch(text.strip()))}
    samples = counts.pop() if len(counts) == 1 else None
    if not stated:
        return StatedSampling(None, samples)
    if any(abs(rate / stated[0] - 1) > ONE_RATE for rate in stated):
        listed = ", ".join(f"{rate:.10g} Hz" for rate in stated)
        message = f"the lines above the data state several rates ({listed}); none of them is taken"
        return StatedSampling(None, samples, (Finding("header_contradiction", None, None, message),))
    coarse = [] if rates else step_findings(next(iter(steps)), "the step of time")
    return StatedSampling(stated[0], samples, tuple(coarse))


def _matches(patterns: Sequence[str], texts: Sequence[str]) -> Iterator["re.Match[str]"]:
    for text in texts:
        for pattern in patterns:
            yield from re.finditer(pattern, text, re.IGNORECASE)


def _value(text: str, decimal: str) -> Fraction:
    """A number with the file's decimal mark; three digits behind the other mark are thousands."""
    other = "," if decimal == "." else "."
    if other in text and may_be_thousands(text):
        text = text.replace(other, "")
    return Fraction(text.replace(",", "."))
