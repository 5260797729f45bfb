"""Free forces and moments of an engine as plain values for JSON, units in the keys."""

from collections.abc import Sequence
from math import degrees
from typing import Any

from ..rotors.polar import document as vector
from .engine import Engine
from .firing import dead_centres, firing
from .left import Left, OverATurn
from .orders import Free, Turning, sums
from .peak import largest
from .shafts import Shaft


def document(
    engine: Engine, free: Sequence[Free], balancing: Sequence[Shaft], left: OverATurn, omega: float
) -> dict[str, Any]:
    """Orders, balance shafts, what is left over a turn, firing; of a layout in m r omega^2 and m r omega^2 a."""
    force, moment = ("mrw2", "mrw2a") if engine.normalised else ("N", "Nm")
    length, unbalance = ("a", "mr") if engine.normalised else ("m", "kgm")
    return {
        "engine": engine.name,
        "source": engine.source or None,
        "normalised": engine.normalised,
        "ratio_r_over_l": engine.cylinders[0].crank.ratio,
        "speed_rad_per_s": None if engine.normalised else omega,
        f"moments_about_{length}": free[0].about,
        "orders": [
            {
                "order": f.force.order,
                "force": _turning(f.force, force, omega),
                "moment": _turning(f.moment, moment, omega),
                f"place_{length}": f.place,
            }
            for f in free
        ],
        "textbook_sums": {str(k): sums(engine, k) for k in (1, 2)} if engine.in_line else None,
        "balance_shafts": [_shaft(shaft, length, unbalance) for shaft in balancing],
        "over_a_turn_exact": _exact(engine, left, omega, force, moment),
        "left_over_a_turn": {
            "theta_deg": [degrees(angle) for angle in left.theta],
            **{stage: _left(each, force, moment) for stage, each in left.stages.items()},
        },
        "firing": _firing(engine),
    }


def _turning(part: Turning, unit: str, omega: float) -> dict[str, Any]:
    scale = omega**2
    return {
        f"largest_{unit}": scale * part.largest,
        f"least_{unit}": scale * part.least,
        "direction_of_largest_deg": degrees(part.direction) % 180.0,
        "forward": vector(scale * part.forward, unit),
        "backward": vector(scale * part.backward, unit),
    }


def _shaft(shaft: Shaft, length: str, unbalance: str) -> dict[str, Any]:
    return {
        "order": shaft.order,
        "turns": "forward" if shaft.forward else "backward",
        "is_crankshaft": shaft.is_crankshaft,
        "unbalances": [{f"at_{length}": u.at} | vector(u.vector, unbalance) for u in shaft.unbalances],
    }


def _exact(engine: Engine, left: OverATurn, omega: float, force: str, moment: str) -> dict[str, float]:
    """Largest values of the exact motion over a turn, all orders together, as the engine is."""
    rolling, _ = largest(lambda theta: abs(engine.rolling(theta, omega)))
    return {
        f"force_{force}": left.stages["before"].largest_force,
        f"moment_{moment}": left.stages["before"].largest_moment,
        f"rolling_moment_{moment.replace('a', 'r')}": rolling,
    }


def _left(left: Left, force: str, moment: str) -> dict[str, Any]:
    return {
        f"largest_force_{force}": left.largest_force,
        f"largest_moment_{moment}": left.largest_moment,
        f"force_x_{force}": left.force.real.tolist(),
        f"force_y_{force}": left.force.imag.tolist(),
        f"moment_x_{moment}": left.moment.real.tolist(),
        f"moment_y_{moment}": left.moment.imag.tolist(),
    }


def _firing(engine: Engine) -> dict[str, Any]:
    fired = firing(engine)
    return {
        "strokes": engine.strokes,
        "order": list(fired.order),
        "angles_deg": list(fired.angles_deg),
        "intervals_deg": list(fired.intervals_deg),
        "even": fired.even,
        "dead_centres_deg": dead_centres(engine),
    }
