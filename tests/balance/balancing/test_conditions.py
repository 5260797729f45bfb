"""Balance conditions found from the model equal the printed ones; ranks as the theory has them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from balance.balancing import closed_forms, conditions
from balance.balancing.conditions import (
    GAP,
    MOMENTA,
    Conditions,
    UndecidedRank,
    balance_conditions,
    reduced_row_echelon,
    row_space,
)
from balance.balancing.rational_rank import rational_rank
from balance.balancing.sizing import exact_sizing
from balance.closure import Closure
from balance.dynamics.inverse_dynamics import momentum
from balance.dynamics.regressor import momentum_regressor
from balance.errors import ClosureError, ModelError

from .. import models

R = 0.15


def rows_of(conditions: Conditions, printed: list[dict[str, float]]) -> np.ndarray:
    """Printed conditions as rows over the mechanism's parameters."""
    names = conditions.mechanism.parameter_names
    rows = np.zeros((len(printed), len(names)))
    for row, coefficients in zip(rows, printed, strict=True):
        for name, value in coefficients.items():
            row[names.index(name)] = value
    return rows


def projector(rows: np.ndarray) -> np.ndarray:
    """Orthogonal projector onto a row space: two row spaces are one where it is equal."""
    _, size, directions = np.linalg.svd(rows, full_matrices=False)
    basis = directions[size > 1e-10 * size[0]]
    return basis.T @ basis


PRINTED = {
    "serial-1r": closed_forms.serial_chain([0.3]),
    "serial-2r": closed_forms.serial_chain([0.3, 0.25]),
    "serial-3r": closed_forms.serial_chain([0.3, 0.25, 0.2]),
    "four-bar": closed_forms.four_bar_loop_closure(0.1, 0.26, 0.2),
    "parallelogram-6bar": [
        {"mcx[A0A]": 1.0, "mcx[BD]": 1.0, "m[AC]": R, "m[platform]": R},
        {"mcx[B0B]": 1.0, "mcx[AC]": 1.0, "m[BD]": R, "m[platform]": R},
        {"mcy[A0A]": 1.0, "mcy[BD]": 1.0},
        {"mcy[B0B]": 1.0, "mcy[AC]": 1.0},
    ],
}


@pytest.mark.parametrize("name", PRINTED)
def test_conditions_are_the_printed_ones(name: str) -> None:
    """Same number, and the same row space to 1e-12, as the printed conditions of each mechanism."""
    found, printed = balance_conditions(models.load(name)), PRINTED[name]
    assert found.rank == len(printed)
    np.testing.assert_allclose(projector(found.matrix), projector(rows_of(found, printed)), atol=1e-12)


def test_manipulator_conditions_read_as_the_theory_writes_them() -> None:
    """Reduced echelon form with pivots on first moments gives the manipulator's conditions term by term."""
    found = balance_conditions(models.load("parallelogram-6bar"))
    mine = [found.coefficients(i) for i in range(found.rank)]
    a0, ac = {"mcx[A0A]": 1.0, "mcx[BD]": 1.0}, {"mcx[AC]": 1.0, "mcx[B0B]": 1.0}
    expected = [
        a0 | {"m[AC]": R, "m[platform]": R},
        {"mcy[A0A]": 1.0, "mcy[BD]": 1.0},
        ac | {"m[BD]": R, "m[platform]": R},
        {"mcy[AC]": 1.0, "mcy[B0B]": 1.0},
    ]
    assert mine == [pytest.approx(row, abs=1e-12) for row in expected]


def test_printed_manipulator_condition_is_the_symmetric_case() -> None:
    """With two equal arms each condition is m1 p1 + (m2 + m5) r + m2 p2, plus the counter-mass."""
    mechanism = models.load("parallelogram-6bar").with_payload({"platform": 3.4116})
    first = closed_forms.manipulator_first_moment(1.04642, 0.05943, 0.58909, 0.0187, R, 3.4116)
    np.testing.assert_allclose(balance_conditions(mechanism).values(), [first, 0.0, first, 0.0], atol=1e-12)


def test_side_links_lumped_half_and_half_leave_linear_momentum_alone() -> None:
    """The complete manipulator has 4 conditions over 11 links, and the same values as the reduced one."""
    whole, reduced = (balance_conditions(models.load(name)) for name in reversed(models.MANIPULATORS))
    assert (whole.rank, whole.dof) == (reduced.rank, reduced.dof) == (4, 2)
    np.testing.assert_allclose(whole.values(), reduced.values(), atol=1e-12)
    assert whole.coefficients(0) == pytest.approx(
        {"mcx[A0A]": 1, "mcx[K0K]": 1, "mcx[BD]": 1, "mcx[HJ]": 1}
        | dict.fromkeys(["m[AC]", "m[AK]", "m[KL]", "m[platform]"], R),
        abs=1e-12,
    )


RANKS = {
    ("serial-1r", "linear"): 2,
    ("serial-2r", "linear"): 4,
    ("serial-3r", "linear"): 6,
    ("serial-1r", "planar"): 3,
    ("four-bar", "linear"): 4,
    ("parallelogram-6bar", "linear"): 4,
    ("parallelogram-6bar-full", "linear"): 4,
    ("parallelogram-6bar-full", "planar"): 12,
    ("parallelogram-6bar", "planar"): 11,
}


@pytest.mark.parametrize(("name", "kind"), RANKS)
def test_ranks(name: str, kind: str) -> None:
    """Ranks of linear, and of linear with planar angular momentum, with a gap that leaves no doubt."""
    found = balance_conditions(models.load(name), kind)
    kept, dropped = found.singular_values
    assert found.rank == RANKS[name, kind]
    assert kept > 1e3 * GAP * dropped
    assert dropped < 1e-12


def planar_conditions_of_the_reduced_manipulator(a: float = 0.24) -> list[dict[str, float]]:
    """Coefficients of the 12 independent functions of the motion in L and Hz, written out by hand; r = R.

    A0A and BD turn by t1, AC and B0B by t2; A0 lies at x = -a/2, B0 at a/2; the platform translates.
    L: d(e1)/dt and d(e2)/dt, two components each. Hz: t1', t2', cos t1 t1', cos t2 t2', sin t1 t1', sin t2 t2',
    and cos(t1 - t2) (t1' + t2'), sin(t1 - t2) (t1' + t2').
    """
    h = a / 2
    return [
        *PRINTED["parallelogram-6bar"],
        {"Izz[A0A]": 1, "Izz[BD]": 1, "m[AC]": R**2, "m[platform]": R**2},
        {"Izz[B0B]": 1, "Izz[AC]": 1, "m[BD]": R**2, "m[platform]": R**2},
        {"mcx[A0A]": -h, "m[AC]": -h * R, "mcx[BD]": h, "mcx[platform]": R},
        {"mcx[B0B]": h, "m[BD]": h * R, "mcx[AC]": -h, "mcx[platform]": R},
        {"mcy[A0A]": h, "mcy[BD]": -h, "mcy[platform]": R},
        {"mcy[B0B]": -h, "mcy[AC]": h, "mcy[platform]": R},
        {"mcx[AC]": 1, "mcx[BD]": 1, "m[platform]": R},
        {"mcy[AC]": 1, "mcy[BD]": -1},
    ]


def test_planar_rank_of_the_reduced_manipulator_is_eleven() -> None:
    """Of the 12 planar conditions the reduced model makes one dependent, so its rank is 11.

    Every link hangs on A0 or B0, at x = -a/2 and a/2. With L1, L2 the conditions on Lx and c1, c2 those on
    cos t1 t1' and cos t2 t2', a/2 L1 + c1 = a mcx[BD] + a/2 r m[platform] + r mcx[platform] and a/2 L2 - c2 =
    a mcx[AC] + a/2 r m[platform] - r mcx[platform]: their sum is a times the condition on cos(t1 - t2). In the
    complete model links hang on K0 and H0 too, at other x: no such sum, rank 12.
    """
    found = balance_conditions(models.load("parallelogram-6bar"), "planar")
    twelve = rows_of(found, planar_conditions_of_the_reduced_manipulator())
    assert np.linalg.matrix_rank(twelve) == found.rank == 11
    np.testing.assert_allclose(projector(found.matrix), projector(twelve), atol=1e-10)
    first, second, c1, c2, mixed = (twelve[k] for k in (0, 1, 6, 7, 10))
    np.testing.assert_allclose((first + second) / 2 + (c1 - c2) / 0.24, mixed, atol=1e-12)


@pytest.mark.parametrize("name", models.MANIPULATORS)
def test_angular_momentum_cannot_be_balanced_by_masses_alone(name: str) -> None:
    """One condition on angular momentum has only masses and moments of inertia, all with the same sign."""
    found = balance_conditions(models.load(name), "planar")
    side = {"Izz[K0K]": 1, "Izz[HJ]": 1, "m[KL]": R**2, "m[AK]": R**2} if name.endswith("full") else {}
    bodies = {"Izz[A0A]": 1, "Izz[BD]": 1, "m[AC]": R**2, "m[platform]": R**2}
    row = rows_of(found, [bodies | side])
    np.testing.assert_allclose(row @ projector(found.matrix), row, atol=1e-10)


FOUR_BARS = {
    "general": (models.four_bar(0.3, 0.12, 0.31, 0.24, 1.0), 4),
    "parallelogram": (models.four_bar(0.3, 0.2, 0.3, 0.2, 1.0), 2),
    "kite": (models.four_bar(0.2, 0.2, 0.35, 0.35, 1.2), 4),
    "equal crank and coupler": (models.four_bar(0.3, 0.2, 0.2, 0.3, 1.0), 4),
}


@pytest.mark.parametrize("name", FOUR_BARS)
def test_special_four_bars(name: str) -> None:
    """A parallelogram needs 2 conditions, weaker than the 4 printed ones; a kite needs all 4."""
    text, rank = FOUR_BARS[name]
    found = balance_conditions(models.model(text))
    assert (found.dof, found.rank) == (1, rank)


def test_the_parallelogram_conditions_are_implied_by_the_printed_ones() -> None:
    """For the parallelogram four-bar the printed four are sufficient, not necessary: its two lie in their span."""
    text = FOUR_BARS["parallelogram"][0].replace("crank", "A0A").replace("coupler", "AB").replace("rocker", "B0B")
    found = balance_conditions(models.model(text))
    printed = rows_of(found, closed_forms.four_bar_loop_closure(0.2, 0.3, 0.2))
    np.testing.assert_allclose(found.matrix @ projector(printed), found.matrix, atol=1e-12)
    assert np.linalg.matrix_rank(printed) == 4


def test_spatial_conditions_hold_exactly_where_momentum_vanishes() -> None:
    """For a spatial linkage, parameters in the null space of the conditions carry no linear momentum in any motion."""
    mechanism = models.model(models.spatial_four_bar())
    found, closure = balance_conditions(mechanism), Closure(mechanism)
    q = closure.states(12, seed=99)
    w = momentum_regressor(mechanism, q, closure.velocities(q, seed=5))[:, :3].reshape(-1, found.matrix.shape[1])
    np.testing.assert_allclose(w @ projector(found.matrix), w, atol=1e-9)
    allowed = np.linalg.svd(found.matrix)[2][found.rank :]
    assert np.abs(w @ allowed.T).max() < 1e-9


def test_a_mechanism_balanced_by_construction() -> None:
    """Two equal bars turning on one axis, each balanced by its twin on the same link, meet every condition."""
    text = models.load("serial-1r").text.replace('pos="0.14 0 0" mass="1.2"', 'pos="0 0 0" mass="1.2"')
    found = balance_conditions(models.model(text))
    assert found.first_moment_residual() == 0.0
    assert found.is_balanced(0.0)
    lift = models.load("scara-quill")
    best = exact_sizing(balance_conditions(lift), lift, lift.counter_sites)
    assert best.residual() < 1e-9, "in the plane nothing is left, and of the lift no first moment"
    assert not balance_conditions(models.load("serial-1r")).is_balanced(0.1)


@pytest.mark.parametrize("name", models.BUILT_IN)
def test_conditions_decide_momentum(name: str) -> None:
    """Parameters moved along a condition raise momentum, moved across all conditions leave it as it is."""
    mechanism = models.load(name)
    found, closure = balance_conditions(mechanism), Closure(mechanism)
    q = closure.states(8, seed=4)
    v = closure.velocities(q, seed=4)
    across = np.random.default_rng(0).normal(size=found.matrix.shape[1])
    across -= projector(found.matrix) @ across
    moved = replace(mechanism, parameters=mechanism.parameters + across.reshape(mechanism.parameters.shape))
    np.testing.assert_allclose(momentum(moved, q, v)[:, :3], momentum(mechanism, q, v)[:, :3], atol=1e-11)
    np.testing.assert_allclose(found.values(moved), found.values(), atol=1e-11)


def test_values_are_for_the_mechanism_asked() -> None:
    """Conditions found once hold for other masses: payload and counter-masses change the values, not the rows."""
    plain = models.load("parallelogram-6bar")
    found = balance_conditions(plain)
    other = balance_conditions(models.loaded("parallelogram-6bar"))
    np.testing.assert_allclose(found.matrix, other.matrix, atol=1e-12)
    np.testing.assert_allclose(found.values(models.loaded("parallelogram-6bar")), other.values(), atol=1e-12)
    assert found.text(1) == "mcy[A0A] + mcy[BD] = 0"


def test_conditions_are_written_in_lengths_of_the_file() -> None:
    """A length by its name where it is a mass's coefficient, a ratio where a first moment's; not where two fit."""
    found = balance_conditions(models.load("four-bar"))
    assert found.text(0) == "mcx[A0A] + crank m[AB] + crank/rocker mcx[B0B] = 0"
    assert found.text(2) == "mcx[AB] + coupler/rocker mcx[B0B] = 0"
    other = replace(found, mechanism=replace(found.mechanism, lengths={"a": 0.1, "b": 0.1, "c": 0.2, "zero": 0.0}))
    assert other.text(0) == "mcx[A0A] + 0.1 m[AB] + 0.5 mcx[B0B] = 0"


@pytest.mark.parametrize("name", ["four-bar", "five-bar", "scara-quill", "delta", "slider-crank"])
def test_the_residual_depends_neither_on_the_order_of_conditions_nor_on_axes(name: str) -> None:
    """Pivots in any order, and every body's axes turned: the same first moment is lacking, of a size of its own."""
    found, rng = balance_conditions(models.loaded(name)), np.random.default_rng(6)
    count = len(found.mechanism.bodies)
    order = [10 * body + k for block in ((1, 2, 3), (0,)) for body in rng.permutation(count) for k in block]
    turned, matrix = found.mechanism.parameters.copy(), reduced_row_echelon(found.matrix, order)
    turns = Rotation.random(count, rng=rng).as_matrix()
    for body, turn in enumerate(turns):
        turned[body, 1:4] = turn @ turned[body, 1:4]
        matrix[:, 10 * body + 1 : 10 * body + 4] = matrix[:, 10 * body + 1 : 10 * body + 4] @ turn.T
    other = replace(found, mechanism=replace(found.mechanism, parameters=turned), matrix=matrix)
    if "kg" in found.units:
        factor = found._momentum_of_single_motions.copy()
        for body, turn in enumerate(turns):
            factor[:, 10 * body + 1 : 10 * body + 4] = factor[:, 10 * body + 1 : 10 * body + 4] @ turn.T
        other.__dict__["_momentum_of_single_motions"] = factor
    assert other.first_moment_residual() == pytest.approx(found.first_moment_residual(), rel=1e-9)
    assert found.first_moment_residual() > 1e-3
    if "kg" not in found.units:
        required = np.einsum("bij,bj->bi", turns, found.required_first_moments())
        np.testing.assert_allclose(other.required_first_moments(), required, atol=1e-9)


@pytest.mark.parametrize("times", [1e-4, 1e4])
@pytest.mark.parametrize("name", ["delta", "inverted-slider-crank", "4-rrr"])
def test_a_machine_of_another_size_has_the_same_conditions(name: str, times: float) -> None:
    """A delta of 30 um, a slider-crank written in millimetres as if these were metres: moments go with the length."""
    text = models.load(name).text
    found, other = (balance_conditions(models.model(one)) for one in (text, models.scaled(text, times)))
    assert (other.rank, other.dof, other.rank_by) == (found.rank, found.dof, found.rank_by)
    assert other.first_moment_residual() / times == pytest.approx(found.first_moment_residual(), rel=1e-9)


@pytest.mark.parametrize("name", [name for name in models.SHIPPED if name != "stewart"])  # its objective takes seconds
def test_the_required_first_moments_leave_no_momentum_that_masses_alone_do_not(name: str) -> None:
    """Added to the file's bodies they meet the conditions; along z a quill's momentum stays, and in x and y none."""
    found = balance_conditions(models.load(name))
    parameters = found.mechanism.parameters.copy()
    parameters[:, 1:4] += found.required_first_moments()
    balanced = replace(found.mechanism, parameters=parameters)
    if "kg" not in found.units:
        assert np.abs(found.values(balanced)).max() < 1e-9
    left = momentum_regressor(balanced, *_moving(found)) @ balanced.pi
    size = np.abs(momentum_regressor(balanced, *_moving(found)) @ found.mechanism.pi)[:, :3].max()
    assert np.abs(left[:, : 2 if name == "scara-quill" else 3]).max() < 1e-7 * size


def _moving(found: Conditions) -> tuple[np.ndarray, np.ndarray]:
    closure = Closure(found.mechanism)
    q = closure.states(20)
    return q, closure.velocities(q)


def test_required_first_moments_are_asked_of_the_bodies_with_sites_first() -> None:
    """Of A0A or BD, and of B0B or AC, those that carry a site, or that are named."""
    found = balance_conditions(models.load("parallelogram-6bar"))
    bodies = found.mechanism.bodies
    for named, chosen in ([], {"A0A", "B0B"}), (["BD", "B0B"], {"BD", "B0B"}):
        required = found.required_first_moments(bodies=named)
        assert {bodies[body] for body in required.any(axis=1).nonzero()[0]} == chosen


def test_echelon_keeps_the_row_space() -> None:
    """Reduced row echelon form: unit pivots, nothing else in their columns, the same space."""
    rows = np.random.default_rng(3).normal(size=(3, 7))
    form = reduced_row_echelon(rows, [4, 2, 0, 1, 3, 5, 6])
    np.testing.assert_allclose(form[:, [4, 2, 0]], np.eye(3), atol=1e-12)
    np.testing.assert_allclose(projector(form), projector(rows), atol=1e-12)


EXTENDED = "elimination in extended precision"


@pytest.mark.parametrize(
    ("off", "rank", "decided_by"), [(0.0, 2, "singular values"), (1e-7, 4, EXTENDED), (3e-10, 4, EXTENDED)]
)
def test_a_rank_in_doubt_is_decided_in_extended_precision(off: float, rank: int, decided_by: str) -> None:
    """A four-bar that is nearly a parallelogram is none, however near: its singular values have two gaps or none.

    On processors whose long double is a double it may be refused, but never answered otherwise.
    """
    try:
        found = balance_conditions(models.model(models.four_bar(0.3, 0.2, 0.3 + off, 0.2, 1.0)))
    except UndecidedRank:
        assert decided_by == EXTENDED
        assert np.finfo(np.longdouble).eps >= np.finfo(float).eps
        return
    assert (found.rank, found.rank_by) == (rank, decided_by)


@pytest.mark.parametrize(("off", "in_doubt"), [(3e-11, True), (1e-12, True), (1e-16, False)])
def test_a_rank_that_rounding_may_explain_is_in_doubt(off: float, in_doubt: bool) -> None:
    """A parallelogram up to the twelfth decimal is taken for one, and it is said that to the letter it is none."""
    found = balance_conditions(models.model(models.four_bar(0.3, 0.2, 0.3 + off, 0.2, 1.0)))
    assert (found.rank, found.in_doubt) == (2, in_doubt)
    assert found.rank_to_the_letter in ((4, None) if np.finfo(np.longdouble).eps > 1e-18 else (4,)) or not in_doubt


@pytest.mark.parametrize("tilt", [1e-3, 1e-7, 2.7e-8, 1e-11])
def test_a_rank_in_doubt_is_confirmed_in_rational_arithmetic(tilt: float) -> None:
    """Three hinges of which one is not quite parallel: to the letter 19 conditions, as where the tilt is plain."""
    third = models.link("", "c", place='pos="0.2 0 0"')
    second = models.link(third, "b", f'<joint name="b" axis="{tilt} 0 1"/>', 'pos="0.3 0 0"')
    found = balance_conditions(models.model(models.mjcf(models.link(second, "a"))), "all")
    assert (found.rank_to_the_letter if found.in_doubt else found.rank) == 19
    assert found.rank_rational == (None if tilt == 1e-3 else 19)


@pytest.mark.parametrize("name", ["serial-3r", "scara-quill", "two-joint-arm-a0"])
@pytest.mark.parametrize("momentum", MOMENTA)
def test_rational_arithmetic_finds_the_rank_of_singular_values(name: str, momentum: str) -> None:
    """Open chains whose rank is plain: hinges, slides, turned frames."""
    model = models.load(name)
    assert rational_rank(model.tree, MOMENTA[momentum]) == balance_conditions(model, momentum).rank


@pytest.mark.parametrize("turned", [False, True])
def test_rational_arithmetic_looks_at_enough_states(turned: bool) -> None:
    """Of a wrist each state adds one moment alone; of lengths from 1 mm to 1000 km parallel axes are not made skew."""
    rolled = models.link("", "d", '<joint name="d" axis="1 0 0"/>')
    wrist = models.link(rolled, "c", '<joint name="c" axis="0 1 0"/>')
    model = models.model(models.mjcf(models.link(models.link(wrist, "b", '<joint name="b" axis="1 0 0"/>'), "a")))
    assert rational_rank(model.tree, MOMENTA["planar"]) == balance_conditions(model, "planar").rank == 23
    roll = 0.7 * turned
    third = models.link("", "c", place=f'pos="0.001 0 0" euler="{-roll} 0 0"')
    hinge = f'<joint name="b" axis="0 {np.sin(roll):.17g} {np.cos(roll):.17g}"/>'
    far = models.model(
        models.mjcf(models.link(models.link(third, "b", hinge, f'pos="1e6 0 0" euler="{roll} 0 0"'), "a"))
    )
    found = balance_conditions(far, "all")
    assert (found.rank_by, found.rank_rational) == ("elimination in extended precision", None if turned else 15)


def test_small_singular_values_of_the_computation_leave_no_doubt() -> None:
    """The delta's states are worse conditioned than others: extended precision confirms its rank."""
    found = balance_conditions(models.load("delta"))
    assert (found.rank, found.in_doubt) == (13, False)


def test_a_long_chain_has_two_conditions_a_link() -> None:
    """Forty hinges: states are added until they add nothing to the rank."""
    links = ""
    for k in reversed(range(40)):
        links = models.link(links, f"l{k}", place=f'pos="{0.1 * (k > 0)} 0 0"')
    assert balance_conditions(models.model(models.mjcf(links))).rank == 80


def test_an_undecided_rank_is_refused() -> None:
    """Singular values that fall without a gap decide nothing: refused, not guessed."""
    graded = np.diag(10.0 ** -np.arange(0.0, 15.0, 1.5))
    with pytest.raises(ModelError, match="rank"):
        row_space(graded, "graded")


def test_no_momentum_at_all_has_no_conditions() -> None:
    """A zero matrix has an empty row space."""
    basis, _ = row_space(np.zeros((5, 4)), "none")
    assert basis.shape == (0, 4)


def test_what_cannot_close_has_no_conditions() -> None:
    """A mechanism whose links do not reach each other is refused by name."""
    text = models.load("four-bar").text.replace(
        '<site name="B_B0B" pos="0.2 0 0"/>', '<site name="B_B0B" pos="9 0 0"/>'
    )
    with pytest.raises(ClosureError, match=r"four-bar.*cannot be closed.*B"):
        balance_conditions(models.model(text, "four-bar"))


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("mcx[A0A] + crank m[AB] = 0", r"(m c_{x})_{\mathrm{A0A}} + \mathrm{crank}\, m_{\mathrm{AB}} &= 0"),
        (
            "mcx[A] - crank/rod_2 mcy[B] = 0",
            r"(m c_{x})_{A} - \tfrac{\mathrm{crank}}{\mathrm{rod\_2}}\, (m c_{y})_{B} &= 0",
        ),
        ("-r_1 m[arm_1] + r m[B] = 0", r"-\mathrm{r\_1}\, m_{\mathrm{arm\_1}} + r\, m_{B} &= 0"),
        ("Ixx[left arm] + 2e-05 m[AB] = 0", r"I_{xx,\mathrm{left\ arm}} + 2\cdot 10^{-5} m_{\mathrm{AB}} &= 0"),
        ("Ixz[be-2] + 0.15 m[e] = 0", r"I_{xz,\mathrm{be-2}} + 0.15 m_{e} &= 0"),
    ],
)
def test_names_stay_whole_in_mathematics(text: str, shown: str) -> None:
    """Names of several letters stand upright, with what TeX would read otherwise escaped; one letter is a symbol."""
    assert conditions._latex(text) == shown


def test_the_four_bar_in_a_notebook() -> None:
    """Lengths that the file names are no product of their letters."""
    shown = balance_conditions(models.load("four-bar"))._repr_latex_()
    assert r"\mathrm{crank}\, m_{\mathrm{AB}}" in shown
    assert r"\tfrac{\mathrm{crank}}{\mathrm{rocker}}\, (m c_{x})_{\mathrm{B0B}}" in shown
