"""The bench on its mounts and the loggers, as a rig describes them for a simulation; a measured rig may omit them.

The defaults are assumptions, with their reasons, not published values of the manipulator tests: a rig that is simulated
should state its own. Imperfections of a real bench are tables of ``[bench]``, absent unless the rig states them: levels
and standard deviations as on data sheets. The values drawn from them are written with the truth of a simulated campaign
and nowhere else.
"""

import math
from typing import Annotated, Literal

from pydantic import Field, model_validator

from balance.dynamics.moving_base import MountedBase
from balance.input_files import Quantity, Table

from . import key_types

Share = Annotated[float, Field(ge=0.0, lt=1.0)]
Direction = tuple[float, float, float]
FloorLevel = Literal["workshop", "office", "residential", "operating theatre", "VC-A", "VC-B", "VC-C", "VC-D", "VC-E"]


class Rotor(Table):
    """The rotor of a motor on the base, and the gear between it and its joint."""

    inertia: key_types.Inertia
    """About its own axis, brake and first gear stage included [kg m2]."""
    ratio: float = Field(default=1.0, allow_inf_nan=False)
    """Turns of the rotor per turn of the joint; negative where the gear reverses."""
    axis: Direction = (0.0, 0.0, 1.0)
    """Of the rotor in the base frame, of any length; with a positive ratio it turns with the joint about it."""

    @model_validator(mode="after")
    def _has_direction(self) -> "Rotor":
        if not any(self.axis):
            raise ValueError("axis: expected a direction, found 0, 0, 0")
        return self


Damping = Annotated[float, Quantity("turning damping", at_least=0.0)]


class Transmission(Table):
    """Gear, belt and shaft between motor and joint: a spring with a damper, and the play in it.

    As all of a drive it is referred to the joint: an inertia, stiffness or torque on the motor's side of a gear of
    ratio N counts N^2, N^2 and N times.
    """

    stiffness: key_types.TurningStiffness
    """[N m/rad]"""
    damping: Damping
    """[N m s/rad]"""
    backlash: Annotated[float, Quantity("angle", at_least=0.0)] = 0.0
    """Play of the joint against the motor, from stop to stop: within it the spring carries nothing [rad]."""
    motor_side: tuple[str, ...] = ()
    """Sites whose counter-masses sit on the hub, before the spring, and so turn with the motor."""


class Ripple(Table):
    """Torque that repeats as the motor turns: cogging, poles, teeth. It is T sin(order q) at the joint's angle q."""

    torque: key_types.Moment
    """T [N m]."""
    order: float = Field(gt=0.0, allow_inf_nan=False)
    """Periods in a turn of the joint."""


class Control(Table):
    """Position control of the motor: torque of a spring and a damper to the command, its integral, a feedforward."""

    stiffness: key_types.TurningStiffness
    """Proportional gain [N m/rad]."""
    damping: Damping
    """Derivative gain [N m s/rad]."""
    integral_time: key_types.Duration | None = None
    """Of the integral part, whose gain is the stiffness over this time [s]; None: no integral part."""
    feedforward: float = Field(default=1.0, ge=0.0, le=1.0)
    """Share of the rigid mechanism's torque that is commanded in advance, gravity included."""
    bandwidth: key_types.Frequency | None = None
    """Of the current loop, first order [Hz]; None: torque follows at once."""
    ripple: Ripple | None = None
    """Cogging of the motor; None: none."""


class DriveTrain(Table):
    """The drive of one joint that turns."""

    transmission: Transmission | None = None
    """None: rigid."""
    control: Control | None = None
    """None: the motor follows the command exactly."""

    @model_validator(mode="after")
    def _states_something(self) -> "DriveTrain":
        if self.transmission is None and self.control is None:
            raise ValueError("expected transmission, control or both; leave the table out for a drive without error")
        return self


class ElasticJoint(Table):
    """A joint without a motor that yields across its axis: the spring of pin and bearing, and the clearance between."""

    stiffness: key_types.Stiffness
    """Across the axis, the same in all directions [N/m]."""
    damping: Annotated[float, Quantity("damping", at_least=0.0)]
    """[N s/m]"""
    clearance: Annotated[float, Quantity("length", at_least=0.0)] = 0.0
    """Radius of the bearing less that of the pin: so far the pin moves before the spring carries anything [m]."""


class Roughness(Table):
    """Residual broadband wrench of drives, gears and joints on the base: flat within a band, each axis for itself."""

    force: key_types.Forces | None = None
    """Root mean square [N]."""
    moment: key_types.Moments | None = None
    """Root mean square, about the origin of the base frame [N m]."""
    band: tuple[key_types.Frequency, key_types.Frequency] = (20.0, 500.0)
    """[Hz]"""

    @model_validator(mode="after")
    def _rises(self) -> "Roughness":
        if not self.band[0] < self.band[1]:
            raise ValueError(
                f"band: expected a lower and a higher frequency, found {self.band[0]:g}, {self.band[1]:g} Hz"
            )
        return self


class Mode(Table):
    """An elastic mode of the frame on top of its rigid-body motion, excited by the mechanism's wrench."""

    frequency: key_types.Frequency
    """Natural frequency [Hz]."""
    damping: float = Field(gt=0.0, lt=1.0)
    """Share of critical damping."""
    mass: key_types.Mass
    """Modal mass, for the shape as it is written here [kg]."""
    translation: Direction = (0.0, 0.0, 0.0)
    """Shape where the mechanism stands, at the origin of the base frame."""
    rotation: Direction = (0.0, 0.0, 0.0)
    """Its rotation there [rad/m]."""
    at: dict[str, Direction]
    """Shape at accelerometers on the base, by sensor."""


class Contact(Table):
    """Feet that stand on the floor and are not fixed to it: a mount carries pressure only, and slides by dry friction.

    A mount is loaded by its share of the weight at rest. Where that is used up it lifts, and carries nothing.
    """

    friction: float = Field(gt=0.0, allow_inf_nan=False)
    """Coefficient of dry friction between foot and floor."""


class Rider(Table):
    """The part of the base that rides on the force sensors, above them: they carry the force that accelerates it."""

    mass: key_types.Mass
    """Contained in the base's [kg]."""
    centre: key_types.Point = (0.0, 0.0, 0.0)
    """In the base frame [m]."""
    inertia: Annotated[tuple[key_types.Inertia, key_types.Inertia, key_types.Inertia], key_types.EACH_AXIS]
    """About its centre, along the axes of the base [kg m2]."""


class SensorErrors(Table):
    """How far a sensor is from its data sheet: standard deviations, from which one value a campaign is drawn."""

    sensitivity: Share = 0.0
    """Of the calibration factor of each channel: true, and unknown to the analysis."""
    cross: Share = 0.0
    """Cross-talk from each other channel of its sensor; between different units as a share of the ranges."""
    offset: Share = 0.0
    """Preload or zero offset, as a share of the range."""
    drift_per_minute: float = Field(default=0.0, ge=0.0, allow_inf_nan=False)
    """Of the zero, as a share of the range, from the reset when the loggers start: a charge amplifier's."""
    high_pass: key_types.Frequency | None = None
    """Corner of an AC-coupled sensor, first order [Hz]; None: it responds down to zero frequency."""


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
    """How often a whole block is lost."""
    dropout: key_types.Duration = 0.02
    """Length of such a block [s]."""
    low_pass: key_types.Frequency | None = None
    """Corner of the anti-alias filter, Butterworth of fourth order [Hz]; None: no filter."""
    delimiter: Literal[",", ";", "\t"] = ","
    """Between the cells of its text."""
    decimal: Literal[".", ","] = "."
    """Decimal mark of its text."""
    decimals: int = Field(default=6, ge=0, le=15)
    """Digits written after the decimal mark."""

    @property
    def delay(self) -> float:
        """Delay of its filter far below the corner [s]: sum of 2 cos over the poles, per 2 pi f."""
        return 0.0 if self.low_pass is None else BUTTERWORTH_DELAY / (2.0 * math.pi * self.low_pass)


class Bench(MountedBase):
    """The base as a rigid body on mounts, without the mechanism; the defaults are a steel frame on four feet."""

    settling: key_types.Time = 0.5
    """How long the loggers go on after the motion [s]."""
    coupling: Literal["locked", "moving"] = "locked"
    """Mechanism's inertia on the moving base: ``locked`` as the motion starts, or ``moving`` with the configuration,
    Coriolis forces and the base's share of the drive torques included."""
    weight: bool = False
    """Whether the weight's moment wanders with the platform, and sensors and loads turn in gravity with the base."""
    tilt: tuple[key_types.Turn, key_types.Turn, key_types.Turn] = (0.0, 0.0, 0.0)
    """Of the base at rest, a rotation vector in its own axes [rad]: it turns gravity; sensors were zeroed level."""
    planes: dict[str, key_types.Length] = Field(default_factory=dict)
    """How far out along its own z axis a body or the counter-mass of a site lies, beyond what the file says [m]."""
    stacks: dict[str, key_types.MassPerLength] = Field(default_factory=dict)
    """Of the plates of a counter-mass, by site: mass per length along the z axis of its body, outwards from its plane,
    so that a heavier counter-mass lies farther out [kg/m]."""
    unstated_mass: dict[str, key_types.MassOfEitherSign] = Field(default_factory=dict)
    """What moves with a body beyond what the mechanism's file says, by body: cables, fixtures; less than zero where the
    file says too much. Placed and spread as the body's own mass [kg]."""
    rotors: dict[str, Rotor] = Field(default_factory=dict)
    """Of the motors, by joint."""
    drives: dict[str, DriveTrain] = Field(default_factory=dict)
    """Transmission and control of the drives, by joint; a joint without follows its command exactly."""
    joints: dict[str, ElasticJoint] = Field(default_factory=dict)
    """Joints without a motor that yield across their axis, with clearance, by joint or `connect`."""
    contact: Contact | None = None
    """Between mounts and floor; None: the mounts are fixed to the floor, and pull as well as push."""
    rider: Rider | None = None
    """What of the base rides on the force sensors; None: nothing."""
    floor: FloorLevel | None = None
    """Vibration of the floor: as much as a curve of the generic vibration criteria allows in each band, 4 to 80 Hz."""
    roughness: Roughness | None = None
    """Residual broadband wrench of the drives on the base."""
    modes: tuple[Mode, ...] = ()
    """Elastic modes of the frame."""
    errors: dict[str, SensorErrors] = Field(default_factory=dict)
    """Of the sensors, by name."""
