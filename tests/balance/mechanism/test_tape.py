"""A tape gives what NumPy gives, by NumPy block by block and by the compiled loop."""

import numpy as np
import pytest

from balance.mechanism import tape
from balance.mechanism.mechanism import Mechanism
from balance.mechanism.tape import Node, Operand, Tape, cross, largest

from .. import models, referees

COUNT = 2 * 2048 + 77
"""Two blocks of NumPy's and a part, and a part of the compiled loop's lanes."""


def outputs(x: Operand, y: Operand, p: Operand) -> list[Operand]:
    """Every operation, joined products, inputs and constants that are outputs themselves."""
    s, c = np.sin(x), np.cos(x)
    written = isinstance(x, Node)
    sign = y.sign() if written else np.sign(y)
    most = largest([x, y, -2.0]) if written else np.maximum(np.maximum(np.abs(x), np.abs(y)), 2.0)
    return [s, c, s * c + y, y - s * y, x * y - c, 1.0 / y, 3.0 * y, sign, most, x, 2.5 + 0.0 * x,
            p * x, -x + y, y * y - p, -(x * -y), (x - y) * (x - y), s + c * p]  # fmt: skip


@pytest.mark.parametrize("way", [0, 1], ids=["NumPy", "compiled"])
def test_both_ways_give_what_numpy_gives(way: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """To the rounding of sine and cosine, and of products that are joined with sums."""
    if way:
        pytest.importorskip("numba")
    loop = tape.kernel().loop() if way else None
    assert (loop is None) == (way == 0)
    monkeypatch.setattr(tape, "COMPILED_FROM", 0)
    monkeypatch.setattr(tape, "compiled_loop", lambda: loop)
    recorded = Tape()
    x, y = recorded.rows(2)
    zero, p = recorded.parameters(np.array([0.0, 2.0]))
    assert zero == 0.0
    program = recorded.program(outputs(x, y, p))
    values, found = np.random.default_rng(0).normal(size=(2, COUNT)) * 20, np.full((17, COUNT), np.nan)
    program.run([values[:1], values[1:]], [found], np.array([0.0, 7.0]))
    expected = np.array([np.broadcast_to(row, COUNT) for row in outputs(*values, 7.0)])
    np.testing.assert_allclose(found, expected, rtol=1e-13, atol=1e-13)


def test_what_occurs_twice_is_computed_once() -> None:
    """Four operations are left of nine, and one of them is a product joined with a sum."""
    recorded = Tape()
    x, y = recorded.rows(2)
    program = recorded.program([x * y + x, y * x - -x, x + y * x])
    assert [tape.Op(op) for op in program.code[:, 0]] == [
        tape.Op.LOAD, tape.Op.LOAD, tape.Op.PLUS_PRODUCT, *[tape.Op.STORE] * 3,
    ]  # fmt: skip


def test_zeros_cost_nothing() -> None:
    """What is zero or one for all samples stays a number: the product of planar vectors has one varying component."""
    x, y = Tape().rows(2)
    planar = np.array([x, y, 0.0], dtype=object)
    assert cross(planar, planar[[1, 0, 2]])[:2].tolist() == [0.0, 0.0]
    assert (0.0 * planar).tolist() == [0.0] * 3
    assert (np.eye(3) @ planar + np.zeros(3)).tolist() == planar.tolist()
    assert (-1.0 * -x).index == x.index


def test_in_the_precision_of_the_inputs() -> None:
    """By extended precision, where the processor has it, half an ulp of a double is not lost."""
    recorded = Tape()
    x, y = recorded.rows(2)
    one, small = np.ones((1, 2), np.longdouble), np.full((1, 2), 2.0**-60, np.longdouble)
    found = recorded.program([(x + y) - x]).values(one, small)
    assert found.dtype == np.longdouble
    np.testing.assert_array_equal(found, (one + small) - one)


def test_pinocchio_stands_guard(monkeypatch: pytest.MonkeyPatch) -> None:
    """A sign that is wrong in the kernel is found at its first use, and no answer is given."""
    from balance.dynamics import inverse_dynamics
    from balance.errors import ModelError

    mechanism: Mechanism = models.model(models.load("four-bar").text)
    motion = referees.random_motion(mechanism, count=4)
    right = inverse_dynamics.body_force
    monkeypatch.setattr(inverse_dynamics, "body_force", lambda *body: 2.0 * right(*body))
    with pytest.raises(ModelError, match="wrench or torque differs from Pinocchio's by"):
        inverse_dynamics.simulate(mechanism, motion)
