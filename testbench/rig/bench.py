"""The bench that stands on mounts, and the loggers: what the simulated bench needs and a real one may leave out.

The defaults are assumptions, with their reasons, and nothing that the source of the manipulator tests prints. A rig
that is simulated should state its own.
"""

import math
from typing import Literal

from pydantic import Field

from balance.input_files import Table

from . import schema
from .effects import FloorLevel, Mode, Rotor, Roughness, SensorErrors, Share

DEFAULT_RATE_HZ = 2000.0
"""Of a logger whose rate the rig does not state [Hz]: ten times the vibration that the motions excite."""
DEFAULT_START_S = -0.2
"""When a logger is started, from the start of the motion [s]."""


BUTTERWORTH_DELAY = 2.0 * (math.cos(math.pi / 8.0) + math.cos(3.0 * math.pi / 8.0))
"""Group delay of a Butterworth filter of fourth order at rest, per period of its corner over 2 pi."""


class Logger(Table):
    """A logger: its clock, and how it writes text. Its own time is (1 + drift) (t - start)."""

    clock: Literal["uniform", "recorded"] = "recorded"
    """``uniform``: the rate stands in the head of the log; ``recorded``: the log has a column of time."""
    rate: schema.Frequency = DEFAULT_RATE_HZ
    """Samples per second of its own clock [Hz]."""
    start: schema.Time = DEFAULT_START_S
    """When it is started, from the start of the motion [s]."""
    drift_ppm: float = Field(default=0.0, ge=-1e5, le=1e5)
    """How much too fast its clock runs, in millionths."""
    start_scatter: schema.Time = Field(default=0.0, ge=0.0)
    """Standard deviation of the start from run to run [s]."""
    drift_scatter_ppm: float = Field(default=0.0, ge=0.0, le=1e4)
    """Standard deviation of the drift from run to run, in millionths."""
    jitter: schema.Time = Field(default=0.0, ge=0.0)
    """Standard deviation of the instant of a sample [s]; a recorded time column shows it, a uniform clock does not."""
    lost: Share = 0.0
    """Share of samples lost one by one: a gap in a recorded time, on a uniform clock a shift of all that follows."""
    dropouts_per_minute: float = Field(default=0.0, ge=0.0, le=6e4)
    """How often a whole block is lost."""
    dropout: schema.Time = Field(default=0.02, gt=0.0)
    """Length of such a block [s]."""
    low_pass: schema.Frequency | None = None
    """Corner of the anti-alias filter, Butterworth of fourth order [Hz]; None: no filter."""
    delimiter: Literal[",", ";", "\t"] = ","
    """Between the cells of its text."""
    decimal: Literal[".", ","] = "."
    """Decimal mark of its text."""
    decimals: int = Field(default=6, ge=0, le=15)
    """Digits written after the decimal mark."""

    @property
    def delay(self) -> float:
        """By which its filter delays what is slow beside the corner [s]: sum of 2 cos over the poles, per 2 pi f."""
        return 0.0 if self.low_pass is None else BUTTERWORTH_DELAY / (2.0 * math.pi * self.low_pass)


class Mount(Table):
    """A spring and a damper along each axis of the base, at a point of it."""

    position: schema.Point
    """Point of the base in its own frame [m]."""
    stiffness: schema.Stiffnesses
    """Along each axis of the base [N/m]."""
    damping: schema.Dampings
    """Along each axis of the base [N s/m]."""


def _feet() -> tuple[Mount, ...]:
    """Rubber feet under the corners of a frame 0.8 m wide and 0.5 m deep, stiffer upright (y) than sideways."""
    return tuple(
        Mount.model_validate(
            {
                "position": (f"{x} m", "-0.5 m", f"{z} m"),
                "stiffness": ("250 kN/m", "400 kN/m", "250 kN/m"),
                "damping": ("400 N s/m", "600 N s/m", "400 N s/m"),
            }
        )
        for x in (-0.4, 0.4)
        for z in (-0.4, 0.1)
    )


class Bench(Table):
    """The base as a rigid body on mounts, without the mechanism; the defaults are a steel frame on four feet."""

    mass: schema.Mass = 150.0
    """[kg]"""
    centre: schema.Point = (0.03, -0.2, -0.12)
    """Centre of mass in the base frame [m]: below and behind the mechanism, its cabinet to one side."""
    inertia: schema.Inertias = (13.0, 11.0, 18.0)
    """About the centre of mass, principal axes along the base frame's [kg m2]: a box of 0.8 x 0.9 x 0.5 m."""
    mounts: tuple[Mount, ...] = Field(default_factory=_feet, min_length=1)
    """What the base stands on."""
    settling: schema.Time = 0.5
    """How long the loggers go on after the motion [s]."""
    coupling: Literal["locked", "moving"] = "locked"
    """Mechanism's inertia on the moving base: ``locked`` as the motion starts, or ``moving`` with the configuration,
    Coriolis forces and the base's share of the drive torques included."""
    weight: bool = False
    """Whether the weight's moment wanders with the platform, and sensors and loads turn in gravity with the base."""
    tilt: tuple[schema.Turn, schema.Turn, schema.Turn] = (0.0, 0.0, 0.0)
    """Of the base at rest, a rotation vector in its own axes [rad]: it turns gravity; sensors were zeroed level."""
    planes: dict[str, schema.Length] = Field(default_factory=dict)
    """How far out along its own z axis a body or the counter-mass of a site lies, beyond what the file says [m]."""
    rotors: dict[str, Rotor] = Field(default_factory=dict)
    """Of the motors, by joint."""
    floor: FloorLevel | None = None
    """Vibration of the floor: as much as a curve of the generic vibration criteria allows in each band, 4 to 80 Hz."""
    roughness: Roughness | None = None
    """Residual broadband wrench of the drives on the base."""
    modes: tuple[Mode, ...] = ()
    """Elastic modes of the frame."""
    errors: dict[str, SensorErrors] = Field(default_factory=dict)
    """Of the sensors, by name."""
