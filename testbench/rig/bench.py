"""The bench on its mounts and the loggers, as a rig describes them for a simulation; a measured rig may omit them.

The defaults are assumptions, with their reasons, not published values of the manipulator tests: a rig that is simulated
should state its own. Imperfections of a real bench are tables of ``[bench]``, absent unless the rig states them: levels
and standard deviations as on data sheets. The values drawn from them are written with the truth of a simulated campaign
and nowhere else.
"""

import math
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from balance.dynamics.moving_base import MountedBase
from balance.errors import DataError
from balance.input_files import Quantity, Table

from . import key_types

Share = Annotated[float, Field(ge=0.0, lt=1.0)]
Vector = tuple[float, float, float]


def _not_zero(direction: Vector) -> Vector:
    if not any(direction):
        raise ValueError("expected a direction, with a component other than 0")
    return direction


Direction = Annotated[Vector, AfterValidator(_not_zero)]
FloorLevel = Literal["workshop", "office", "residential", "operating theatre", "VC-A", "VC-B", "VC-C", "VC-D", "VC-E"]


class Rotor(Table):
    """The rotor of a motor on the base, and the gear between it and its joint."""

    inertia: key_types.Inertia
    """Inertia about its own axis, brake and first gear stage included [kg m2]."""
    ratio: float = Field(default=1.0, allow_inf_nan=False)
    """Turns of the rotor per turn of the joint; negative where the gear reverses."""
    axis: Direction = (0.0, 0.0, 1.0)
    """Direction of its axis in the base frame; with a positive ratio it turns about it as the joint turns."""


Damping = Annotated[float, Quantity("turning damping", at_least=0.0)]


class Transmission(Table):
    """Gear, belt and shaft between motor and joint: a spring with a damper, and the play in it.

    As all of a drive it is referred to the joint: an inertia, stiffness or torque on the motor's side of a gear of
    ratio N counts N^2, N^2 and N times.
    """

    stiffness: key_types.TurningStiffness
    """Stiffness, referred to the joint [N m/rad]."""
    damping: Damping
    """Damping, referred to the joint [N m s/rad]."""
    backlash: Annotated[float, Quantity("angle", at_least=0.0)] = 0.0
    """Play of the joint against the motor, from stop to stop: within it the spring carries nothing [rad]."""
    motor_side: tuple[str, ...] = ()
    """Sites whose counter-masses sit on the hub, before the spring, and so turn with the motor."""


class Ripple(Table):
    """Torque that repeats as the motor turns: cogging, poles, teeth. It is T sin(order q) at the joint's angle q."""

    torque: key_types.Moment
    """Its amplitude T [N m]."""
    order: float = Field(gt=0.0, allow_inf_nan=False)
    """Periods in a turn of the joint."""


class Control(Table):
    """Position control of the motor: proportional, derivative and integral feedback, and a feedforward."""

    stiffness: key_types.TurningStiffness
    """Proportional gain [N m/rad]."""
    damping: Damping
    """Derivative gain [N m s/rad]."""
    integral_time: key_types.Duration | None = None
    """Integral gain = ``stiffness`` over this time [s]; left out: no integral part."""
    feedforward: float = Field(default=1.0, ge=0.0, le=1.0)
    """Share of the rigid mechanism's torque that is commanded in advance, gravity included."""
    bandwidth: key_types.Frequency | None = None
    """Bandwidth of the current loop, first order [Hz]; left out: the torque follows at once."""
    ripple: Ripple | None = None
    """Cogging of the motor; left out: none."""


class DriveTrain(Table):
    """The drive of one joint that turns."""

    transmission: Transmission | None = None
    """Transmission; left out: rigid."""
    control: Control | None = None
    """Position control; left out: the motor follows the command exactly."""

    def _check(self) -> None:
        if self.transmission is None and self.control is None:
            raise DataError("expected transmission, control or both; leave the table out for a drive without error")


class ElasticJoint(Table):
    """A joint without a motor that yields across its axis: the spring of pin and bearing, and the clearance between."""

    stiffness: key_types.Stiffness
    """Stiffness across the axis, the same in all directions [N/m]."""
    damping: Annotated[float, Quantity("damping", at_least=0.0)]
    """Damping across the axis [N s/m]."""
    clearance: Annotated[float, Quantity("length", at_least=0.0)] = 0.0
    """Radius of the bearing less that of the pin: so far the pin moves before the spring carries anything [m]."""


class ElasticLink(Table):
    """A body that bends: two parts, a hinge and a spring between; what is mounted farther out is on the part beyond.

    So is a body that is fixed to it, if its centre of mass is farther out. Places are in the body's frame as in the
    mechanism's file, and along its axes.

    A bar of length L and bending stiffness EI that is clamped at one end and loaded across the other bends like a hinge
    of 2.25 EI / L at 0.15 L from the clamp (Howell, "Compliant mechanisms", 2001: pseudo-rigid-body model).
    """

    at: key_types.Point
    """Place of the hinge, not at the body's joint; farther out is beyond it, along the line from the joint [m]."""
    axis: Direction = (0.0, 0.0, 1.0)
    """Axis of the hinge, along the body's axes."""
    stiffness: key_types.TurningStiffness
    """Stiffness of the hinge [N m/rad]."""
    damping: Damping
    """Damping of the hinge [N m s/rad]."""
    mass: key_types.Mass
    """Mass of the part beyond the hinge, of what the mechanism's file gives the body [kg]."""
    centre: key_types.Point
    """Its centre of mass [m]."""
    inertia: Annotated[tuple[key_types.Inertia, key_types.Inertia, key_types.Inertia], key_types.EACH_AXIS]
    """Its inertia about that centre, along the axes of the body [kg m2]."""


class Roughness(Table):
    """Residual broadband wrench of drives, gears and joints on the base: flat within a band, each axis for itself."""

    force: key_types.Forces | None = None
    """Root mean square of the force along each axis [N]."""
    moment: key_types.Moments | None = None
    """Root mean square of the moment about the origin of the base frame [N m]."""
    band: tuple[key_types.Frequency, key_types.Frequency] = (20.0, 500.0)
    """Lower and upper end of the band [Hz]."""

    def _check(self) -> None:
        if not self.band[0] < self.band[1]:
            raise DataError(
                f"band: expected a lower and a higher frequency, found {self.band[0]:g}, {self.band[1]:g} Hz"
            )


class Mode(Table):
    """An elastic mode of the frame on top of its rigid-body motion, excited by the mechanism's wrench."""

    frequency: key_types.Frequency
    """Natural frequency [Hz]."""
    damping: float = Field(gt=0.0, lt=1.0)
    """Share of critical damping."""
    mass: key_types.Mass
    """Modal mass that belongs to the shape as scaled here [kg]."""
    translation: Vector = (0.0, 0.0, 0.0)
    """The shape's displacement where the mechanism stands, at the origin of the base frame."""
    rotation: Vector = (0.0, 0.0, 0.0)
    """The shape's rotation there [rad/m]."""
    at: dict[str, Vector]
    """The shape's displacement at accelerometers on the base, by sensor."""


class FloorMode(Table):
    """A mode of the floor under all mounts, which moves as a rigid body: it translates along, or turns about, an axis.

    Noise drives it, of a flat density up to 80 Hz; the bench does not act back on it.
    """

    frequency: key_types.Frequency
    """Natural frequency, below 80 Hz [Hz]."""
    damping: float = Field(gt=0.0, lt=1.0)
    """Share of critical damping."""
    acceleration: Annotated[float, Quantity("acceleration", at_least=0.0)] | None = None
    """Root mean square of the acceleration along ``axis``, for a mode that translates [m/s2]."""
    angle: Annotated[float, Quantity("angle", at_least=0.0)] | None = None
    """Root mean square of the angle about ``axis``, for a mode that turns [rad]."""
    axis: Direction
    """Direction in the base frame."""
    centre: key_types.Point = (0.0, 0.0, 0.0)
    """Point of the base frame about which the floor turns [m]."""

    def _check(self) -> None:
        if (self.acceleration is None) == (self.angle is None):
            raise DataError("expected acceleration, of a mode that translates, or angle, of one that turns; not both")
        if self.angle is None and any(self.centre):
            raise DataError("centre: expected only with angle, for a mode that turns")
        if not self.frequency < 80.0:
            raise DataError(
                f"frequency: expected less than 80 Hz, up to where noise drives it, found {self.frequency:g} Hz"
            )


class Contact(Table):
    """Feet that stand on the floor and are not fixed to it: a mount carries pressure only, and slides by dry friction.

    A mount is loaded by its share of the weight at rest. Where that is used up it lifts, and carries nothing.
    """

    friction: float = Field(gt=0.0, allow_inf_nan=False)
    """Coefficient of dry friction between foot and floor."""


class Rider(Table):
    """The part of the base that rides on the force sensors, above them: they carry the force that accelerates it."""

    mass: key_types.Mass
    """Its mass, which is part of the base's [kg]."""
    centre: key_types.Point = (0.0, 0.0, 0.0)
    """Its centre of mass in the base frame [m]."""
    inertia: Annotated[tuple[key_types.Inertia, key_types.Inertia, key_types.Inertia], key_types.EACH_AXIS]
    """Its inertia about that centre, along the axes of the base [kg m2]."""


class SensorErrors(Table):
    """How far a sensor is off its data sheet: standard deviations, of which one value is drawn for a campaign."""

    sensitivity: Share = 0.0
    """Relative error of each channel's sensitivity; the analysis does not know it."""
    cross: Share = 0.0
    """Cross-talk from each other channel of its sensor; where units differ, as a share of the ranges."""
    offset: Share = 0.0
    """Preload or zero offset, as a share of the range."""
    drift_per_minute: float = Field(default=0.0, ge=0.0, allow_inf_nan=False)
    """Drift of the zero, as a share of the range, from the loggers' start on: that of a charge amplifier."""
    high_pass: key_types.Frequency | None = None
    """Lower corner of an AC-coupled sensor, first order [Hz]; left out: it responds down to zero."""


DEFAULT_RATE_HZ = 2000.0
"""Of a logger whose rate the rig does not state [Hz]: ten times the vibration that the motions excite."""
DEFAULT_START_S = -0.2
"""When a logger is started, from the start of the motion [s]."""
BUTTERWORTH_DELAY = 2.0 * (math.cos(math.pi / 8.0) + math.cos(3.0 * math.pi / 8.0))
"""Group delay of a Butterworth filter of fourth order at rest, per period of its corner over 2 pi."""


class Logger(Table):
    """A logger: its clock, and how it writes text and is read. Its own time is (1 + drift) (t - start)."""

    clock: Literal["uniform", "recorded"] = "recorded"
    """``uniform``: the rate stands in the head of the log; ``recorded``: the log has a column of time."""
    rate: key_types.Frequency = DEFAULT_RATE_HZ
    """Samples per second of its own clock [Hz]."""
    start: key_types.Time = DEFAULT_START_S
    """When it is started, from the start of the motion [s]."""
    drift_ppm: float = Field(default=0.0, ge=-1e5, le=1e5)
    """How much too fast its clock runs, in millionths."""
    start_scatter: key_types.Deviation = 0.0
    """Standard deviation of the start from run to run [s]."""
    drift_scatter_ppm: float = Field(default=0.0, ge=0.0, le=1e4)
    """Standard deviation of the drift from run to run, in millionths."""
    jitter: key_types.Deviation = 0.0
    """Standard deviation of the instant of a sample [s]; a recorded time column shows it, a uniform clock does not."""
    lost: Share = 0.0
    """Share of samples lost one by one: a gap in a recorded time, on a uniform clock a shift of all that follows."""
    dropouts_per_minute: float = Field(default=0.0, ge=0.0, le=6e4)
    """How many times a minute a whole block is lost."""
    dropout: key_types.Duration = 0.02
    """Length of such a block [s]."""
    low_pass: key_types.Frequency | None = None
    """Corner of the anti-alias filter, Butterworth of fourth order [Hz]; left out: no filter."""
    delimiter: Literal[",", ";", "\t"] = ","
    """What stands between the cells of its text."""
    decimal: Literal[".", ","] = "."
    """Decimal mark of its text."""
    decimals: int = Field(default=6, ge=0, le=15)
    """Digits written after the decimal mark."""
    read_as: str = ""
    """Import description of its logs, a file beside the rig or a shipped one; left out: detected."""

    @property
    def delay(self) -> float:
        """Delay of its filter far below the corner [s]: sum of 2 cos over the poles, per 2 pi f."""
        return 0.0 if self.low_pass is None else BUTTERWORTH_DELAY / (2.0 * math.pi * self.low_pass)


class Bench(MountedBase):
    """The base as a rigid body on mounts, without the mechanism; the defaults are a steel frame on four feet."""

    fixed: bool = False
    """Whether the base does not move, as one bolted to a stiff floor: then its accelerometers are not used, forces have
    nothing of its motion, and no doubt is raised where none was recorded. Such a base has no mass and mounts."""
    settling: key_types.Time = 0.5
    """How long the loggers go on after the motion [s]."""
    coupling: Literal["locked", "moving"] = "locked"
    """Mechanism's inertia on the moving base: ``locked`` as the motion starts, or ``moving`` with the configuration,
    Coriolis forces and the base's share of the drive torques included."""
    weight: bool = False
    """Whether the weight's moment wanders with the platform, and sensors and loads turn in gravity with the base."""
    tilt: tuple[key_types.Turn, key_types.Turn, key_types.Turn] = (0.0, 0.0, 0.0)
    """Tilt of the base at rest, a rotation vector in its own axes [rad]; sensors were zeroed level."""
    planes: dict[str, key_types.Length] = Field(default_factory=dict)
    """By body or site: how much farther along the axis that the body turns about it lies than the file says [m]."""
    stacks: dict[str, key_types.MassPerLength] = Field(default_factory=dict)
    """By site: mass per length of its counter-mass, plates stacked along that axis from its plane on, so
    that the centre of a heavier one lies farther out [kg/m]."""
    unstated_mass: dict[str, key_types.MassOfEitherSign] = Field(default_factory=dict)
    """By body: mass of cables and fixtures that move with it and are not in the mechanism's file, spread as the body's
    own; less than zero where the file says too much [kg]."""
    rotors: dict[str, Rotor] = Field(default_factory=dict)
    """Rotors of the motors, by joint."""
    drives: dict[str, DriveTrain] = Field(default_factory=dict)
    """Transmission and control of the drives, by joint; a joint that is left out follows its command exactly."""
    joints: dict[str, ElasticJoint] = Field(default_factory=dict)
    """Joints without a motor that yield across their axis, with clearance, by the name of the joint or ``connect``."""
    links: dict[str, ElasticLink] = Field(default_factory=dict)
    """Bodies that bend, by name."""
    contact: Contact | None = None
    """Feet that only stand on the floor; left out: the mounts are fixed to it, and pull as well as push."""
    rider: Rider | None = None
    """Part of the base that rides on the force sensors; left out: none."""
    floor: FloorLevel | None = None
    """Vibration of the floor: as much as a curve of the generic vibration criteria allows in each band, 4 to 80 Hz."""
    floor_modes: tuple[FloorMode, ...] = ()
    """Modes of the floor, translating or turning, besides that vibration."""
    roughness: Roughness | None = None
    """Residual broadband wrench of the drives on the base."""
    modes: tuple[Mode, ...] = ()
    """Elastic modes of the frame."""
    errors: dict[str, SensorErrors] = Field(default_factory=dict)
    """Errors of the sensors, by name."""

    def _check(self) -> None:
        if self.fixed and (stated := sorted({"mass", "mounts"} & self.model_fields_set)):
            raise DataError(
                f"fixed: expected a base without {' and '.join(stated)}, for it does not move; leave one out"
            )

    @property
    def is_stated(self) -> bool:
        """Whether the rig itself states mass and mounts of the base; else they are assumed, for a simulation alone."""
        return {"mass", "mounts"} <= self.model_fields_set
