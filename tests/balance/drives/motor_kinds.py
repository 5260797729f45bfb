"""Motors of numbers in SI, as a file would state them with units."""

from collections.abc import Iterable

from balance.drives.machine import Constant, DirectCurrent, MeasuredMotor


def dc(stall_torque: float, no_load_speed: float) -> DirectCurrent:
    """Of a torque at standstill [N m] and a speed without load [rad/s]."""
    return DirectCurrent(
        kind="dc", stall_torque=f"{stall_torque!r} N m", no_load_speed=f"{no_load_speed!r} rad/s"
    )  # fmt: skip


def constant(torque: float) -> Constant:
    """Of a torque [N m]."""
    return Constant(kind="constant", torque=f"{torque!r} N m")


def measured(speeds: Iterable[float], torques: Iterable[float]) -> MeasuredMotor:
    """Through points, of speeds [rad/s] and torques [N m]."""
    return MeasuredMotor(
        kind="table",
        speed=[f"{float(speed)!r} rad/s" for speed in speeds],
        torque=[f"{float(torque)!r} N m" for torque in torques],
    )
