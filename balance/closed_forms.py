"""Printed closed forms. The oracle of the tests, and the only sizing where Pinocchio cannot be installed.

Source: G. Kiper, "Dinamik Dengeleme Calismalari", slides, METU Mechanical Engineering, Ankara, 20-21 November 2019.
"""

from collections.abc import Sequence


def manipulator_first_moment(m1: float, p1: float, m2: float, p2: float, r: float, payload: float) -> float:
    """First moment that each counter-mass of the parallelogram 6-bar manipulator must make up [kg m].

    m1 p1 + (m2 + m5) r + m2 p2, the same for both arms: m1 [kg] and p1 [m] mass and centre of an inner arm, m2 and p2
    of an outer arm, r [m] the arms' length, m5 = ``payload`` [kg], the platform included.
    """
    return m1 * p1 + (m2 + payload) * r + m2 * p2


def manipulator_counter_mass(first_moment: float, p_cm: float) -> float:
    """Counter-mass of one arm [kg] at p_cm [m] along the arm, negative behind the pivot: m_cm p_cm = -first moment."""
    return -first_moment / p_cm


def manipulator_balanced_payload(
    m1: float, p1: float, m2: float, p2: float, r: float, m_cm: float, p_cm: float
) -> float:
    """Payload that a counter-mass m_cm [kg] at p_cm [m] on each arm balances [kg]."""
    return (-m_cm * p_cm - m1 * p1 - m2 * p2) / r - m2


def serial_chain(lengths: Sequence[float]) -> list[dict[str, float]]:
    """Conditions of a planar serial chain of n revolute joints, bodies ``link_1`` ... ``link_n``.

    m_i e_i + l_i (m_i+1 + ... + m_n) = 0 and m_i f_i = 0 for each link, e along it and f across, lengths in m.
    """
    count = len(lengths)
    rows: list[dict[str, float]] = []
    for i, length in enumerate(lengths, 1):
        outer = {f"m[link_{j}]": length for j in range(i + 1, count + 1)}
        rows += [{f"mcx[link_{i}]": 1.0} | outer, {f"mcy[link_{i}]": 1.0}]
    return rows


def four_bar_loop_closure(l1: float, l2: float, l3: float) -> list[dict[str, float]]:
    """Conditions of the four-bar A0-A-B-B0 by loop closure, bodies ``A0A``, ``AB``, ``B0B`` of lengths l1, l2, l3 [m].

    Printed with link 3 measured from B: m1 e1 + m2 (1 - e2/l2) l1 = 0, m1 f1 - m2 (f2/l2) l1 = 0,
    m3 (l3 - e3) + m2 (e2/l2) l3 = 0, m3 f3 - m2 (f2/l2) l3 = 0; here link 3 is measured from B0, turned by 180 degrees.
    """
    return [
        {"mcx[A0A]": 1.0, "m[AB]": l1, "mcx[AB]": -l1 / l2},
        {"mcy[A0A]": 1.0, "mcy[AB]": -l1 / l2},
        {"mcx[B0B]": 1.0, "mcx[AB]": l3 / l2},
        {"mcy[B0B]": 1.0, "mcy[AB]": l3 / l2},
    ]
