"""Equations in symbols."""

import re

import pytest

from balance.linkages.equivalence_method import balance_linkage
from balance.linkages.expressions import read_length
from balance.linkages.linkage_files import load_linkage
from balance.linkages.results import linkage_equations


@pytest.fixture
def pantograph():
    """Texts of the pantograph's equations."""
    return [equation.text for equation in linkage_equations(balance_linkage(load_linkage("pantograph")))]


def test_counter_masses_read_as_published(pantograph):
    """m3* of the source: own part, slider and what the slider's pin receives."""
    assert "m3* = (m3 L3/2 + m4 L3 + (m5 + m5*) L3) / R3" in pantograph
    assert "m8* = (m_z3 (L2 + L7) + m_z2 L2) / (L2/4 + L7/4)" in pantograph


def test_gears_read_as_published(pantograph):
    """The planet's ratio, and both terms that its carrier gains."""
    assert "I_z2 = (Z*/Z) I[3], Z = 1, Z* = 1" in pantograph
    whole = next(text for text in pantograph if text.startswith("I[2+7]"))
    assert whole.endswith("+ I[5] + I_z3 + I_z3 Z/Z* + I_z2 + I_z2 Z/Z*")


@pytest.mark.parametrize("name", ["pantograph", "sewing-machine", "dwell-short-two-point", "two-levels"])
def test_evaluated_symbols_give_the_results(name):
    """Sums of products, read back with the values of their symbols, are the numbers that follow them."""
    result = balance_linkage(load_linkage(name))
    checked = 0
    for equation in linkage_equations(result):
        left, _, right = equation.text.partition(" = ")
        if left.startswith("I["):
            assert sum(_term(term, result) for term in _terms(right)) == pytest.approx(equation.value, rel=1e-5)
            checked += 1
    assert checked >= 4


def _terms(text):
    """Terms of a sum, brackets kept together."""
    depth, start, found = 0, 0, []
    for k, letter in enumerate(text):
        depth += (letter in "([") - (letter in ")]")
        if depth == 0 and text[k : k + 3] == " + ":
            found.append(text[start:k])
            start = k + 3
    return [*found, text[start:]]


def _term(text, result):
    """Value of one term such as (m3 + m3*) L2^2, I5 or I_z2 Z/Z*."""
    known = {**result.values, **result.results()}
    known |= {f"m_{name}*": gear.counter_mass for name, gear in result.moment.gears.items()}
    if text.endswith(" Z/Z*"):
        gear = result.moment.gears[text.removesuffix(" Z/Z*").removeprefix("I_")]
        return gear.inertia * gear.gear.ratio
    if text in known:
        return known[text]
    at = re.match(r"\(.*?\)|m\[.*?\]|\S+", text).end()
    mass = sum(known[symbol] for symbol in text[:at].strip("()").split(" + "))
    squares = text[at + 1 :].removeprefix("[").removesuffix("]")
    return mass * sum(_length(square.removesuffix("^2"), result) ** 2 for square in _terms(squares))


def _length(text, result):
    lengths = {name: symbol for name, symbol in result.linkage.symbols.items() if name[0] in "LR"}
    return read_length(text.strip("()"), lengths).at(result.values)
