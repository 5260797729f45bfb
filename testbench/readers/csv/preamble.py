"""What comments and the lines above the names of a text state: ranges, pairs of key and value, rates, steps, counts."""

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

from ...recording import Block, Finding, Report, SensorRange
from ...units import is_unit, seconds_per
from .. import header_claims
from .cell_syntax import may_be_thousands

Read = Callable[[Report], Iterator[Block]]

_RANGE = re.compile(
    r"(?:range|full scale|aralı[kğ]\w*|messbereich)\s*[:=]?\s*(?:±|\+-|\+/-|-\+)\s*(\d+(?:[.,]\d+)?)\s*([^\s,;]+)",
    re.IGNORECASE,
)
_BITS = re.compile(r"\b(\d{1,2})[ -]?bits?\b", re.IGNORECASE)
_LONGEST = 2000
"""Letters of a comment that are looked at."""
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
_ONE_RATE = 0.005
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
    if any(abs(rate / stated[0] - 1) > _ONE_RATE for rate in stated):
        listed = ", ".join(f"{rate:.10g} Hz" for rate in stated)
        message = f"the lines above the data state several rates ({listed}); none of them is taken"
        return StatedSampling(None, samples, (Finding("header_contradiction", None, None, message),))
    coarse = [] if rates else header_claims.step_findings(next(iter(steps)), "the step of time")
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
