"""A tape gives what NumPy gives, by NumPy block by block and by the compiled loop."""

import numpy as np
import pytest

from balance.mechanism import tape
from balance.mechanism.mechanism import Mechanism
from balance.mechanism.sparse_components import largest, sign, sincos
from balance.mechanism.tape import Operand, Tape

from .. import models, referees

COUNT = 2 * 2048 + 77
"""Two blocks of NumPy's and a part, and a part of the compiled loop's lanes."""


def outputs(x: Operand, y: Operand, p: Operand) -> list[Operand]:
    """Every operation, joined products, inputs and constants that are outputs themselves."""
    s, c = sincos(x)
    return [s, c, s * c + y, y - s * y, x * y - c, 1.0 / y, 3.0 * y, sign(y), largest([x, y, -2.0]), x, 2.5 + 0.0 * x,
            p * x, -x + y, y * y - p, -(x * -y), (x - y) ** 2, s + c * p]  # fmt: skip


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
    ((zero, p),) = recorded.parameter_rows(np.array([[0.0, 2.0]]))
    assert zero == 0.0
    program = recorded.program(outputs(x, y, p))
    values, found = np.random.default_rng(0).normal(size=(2, COUNT)) * 20, np.full((17, COUNT), np.nan)
    program.run([values[:1], values[1:]], [found], np.array([0.0, 7.0]))
    np.testing.assert_allclose(found, np.array(outputs(*values, 7.0)), rtol=1e-13, atol=1e-13)


def test_what_occurs_twice_is_computed_once() -> None:
    """Four operations are left of nine, and one of them is a product joined with a sum."""
    recorded = Tape()
    x, y = recorded.rows(2)
    program = recorded.program([x * y + x, y * x - -x, x + y * x])
    assert [tape.Op(op) for op in program.code[:, 0]] == [
        tape.Op.LOAD, tape.Op.LOAD, tape.Op.PLUS_PRODUCT, *[tape.Op.STORE] * 3,
    ]  # fmt: skip


def test_pinocchio_stands_guard(monkeypatch: pytest.MonkeyPatch) -> None:
    """A sign that is wrong in the kernel is found at its first use, and no answer is given."""
    from balance.dynamics import inverse_dynamics
    from balance.errors import ModelError

    mechanism: Mechanism = models.model(models.load("four-bar").text)
    motion = referees.random_motion(mechanism, count=4)
    right = inverse_dynamics.body_force
    monkeypatch.setattr(inverse_dynamics, "body_force", lambda *body: right(*body).plus(right(*body)))
    with pytest.raises(ModelError, match="wrench or torque differs from Pinocchio's by"):
        inverse_dynamics.simulate(mechanism, motion)
