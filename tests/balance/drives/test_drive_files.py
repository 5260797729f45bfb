"""Drive files: what is read, and what is refused by name."""

import numpy as np
import pytest

from balance import datasets
from balance.drives.drive_files import load_drive
from balance.drives.harmonic_balance import steady_rotation
from balance.drives.machine import Induction, MeasuredMotor
from balance.errors import DataError

from .motor_kinds import constant, dc
from .source import RPM

PLAIN = """
mechanism = "four-bar"
speeds = ["900 rpm"]
[motor]
kind = "dc"
stall_torque = "1.2 N m"
no_load_speed = "3000 rpm"
"""


def written(tmp_path, text, name="mine.toml"):
    """A drive file with this text."""
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


def whole(path):
    """Read a drive file and put its machines together."""
    drive = load_drive(path)
    return drive.machines(drive.load_mechanism())


@pytest.mark.parametrize("name", datasets.dataset_names("drives", ".toml"))
def test_shipped_drives_turn(name):
    """Every shipped drive has a steady rotation that is stable and converged."""
    drive = load_drive(name)
    for machine in drive.machines(drive.load_mechanism()):
        found = steady_rotation(machine)
        assert found.is_converged()
        assert found.is_stable


def test_the_source_s_drive():
    """The source's table, in SI; both readings of the gearbox, since the source does not state it."""
    drive = load_drive("inverted-slider-crank")
    assert drive.table.motor == Induction(
        kind="induction", peak_torque="12.75 N m", peak_slip=0.315, a=2.565, b=1.380, synchronous_speed="nominal"
    )
    assert drive.table.speeds == pytest.approx((276 * RPM, 828 * RPM))
    assert drive.published_at(276 * RPM).fluctuation == 0.201
    assert drive.published_at(828 * RPM).fluctuation == 0.116
    assert drive.published_at(500 * RPM) is None
    machine, other = drive.machines(drive.load_mechanism(), (276 * RPM,))
    assert (machine.reading, other.reading) == ("geared", "ungeared")
    assert machine.constant_inertia == pytest.approx(0.42)
    assert machine.nominal_crank / RPM == pytest.approx(76.45, abs=0.005)


def test_every_kind_of_motor_and_load(tmp_path):
    """Each kind is read with its units; a load on another joint acts there."""
    head = 'mechanism = "inverted-slider-crank"\nspeeds = ["100 rpm"]\ndirection = -1\nstart_angle = "30 deg"\n'
    gear = '[gearbox]\nratio = 2\nreading = "ungeared"\n[[inertia]]\ninertia = "20 kg cm2"\nside = "motor"\n'
    loads = """
[[load]]
kind = "viscous"
joint = "slide"
force = "4 N"
at_speed = "2 m/s"
[[load]]
kind = "quadratic"
torque = "4 N m"
at_speed = "2 rad/s"
[[load]]
kind = "table"
angle = ["0 deg", "90 deg", "270 deg"]
torque = ["1 N m", "2 N m", "0 N m"]
"""
    kinds = {
        'kind = "constant"\ntorque = "50 N cm"': constant(0.5),
        'kind = "dc"\nstall_torque = "1 N m"\nno_load_speed = "10 rad/s"': dc(1.0, 10.0),
        'kind = "induction"\npeak_torque = "2 N m"\npeak_slip = 0.2\na = 2\nb = 1\nsynchronous_speed = "100 rpm"\n'
        'slip_base = "200 rpm"\nbraking = "mirrored"': Induction(
            kind="induction",
            peak_torque="2 N m",
            peak_slip=0.2,
            a=2,
            b=1,
            synchronous_speed="100 rpm",
            slip_base="200 rpm",
            braking="mirrored",
        ),
    }
    for text, motor in kinds.items():
        drive = load_drive(written(tmp_path, f"{head}[motor]\n{text}\n{gear}{loads}"))
        assert drive.table.motor == motor
        (machine,) = drive.machines(drive.load_mechanism())
        assert machine.constant_inertia == pytest.approx(4 * 20e-4)
        assert [load.joint for load in machine.loads] == [2, 0, 0]
        assert [load.value for load in machine.loads][:2] == pytest.approx([2.0, 1.0])
        assert machine.loads[2].torque(np.pi / 2, 1.0, 1.0) == pytest.approx(-2.0)
        assert machine.loads[2].torque(2 * np.pi, 1.0, 1.0) == pytest.approx(-1.0)
    table = 'kind = "table"\nspeed = ["0 rpm", "100 rpm"]\ntorque = ["3 N m", "1 N m"]'
    drive = load_drive(written(tmp_path, f"{head}[motor]\n{table}\n"))
    assert isinstance(drive.table.motor, MeasuredMotor)
    assert drive.table.motor.torque_at(50 * RPM, 0.0) == pytest.approx(2.0)


def test_a_mechanism_beside_the_drive_s_file_is_found(tmp_path):
    """A relative path counts from the drive's file."""
    text = datasets.find_dataset("four-bar", "mechanisms", ".xml").read_text(encoding="utf-8")
    written(tmp_path, text, "own.xml")
    drive = load_drive(written(tmp_path, PLAIN.replace("four-bar", "own.xml")))
    assert drive.load_mechanism().name == "own"


WRONG = {
    'speeds = ["15 Hz"]': "may count turns or radians: write rpm",
    'speeds = ["-900 rpm"]': "'-900 rpm': expected more than zero",
    'mechanism = "no-such"': "no such file",
    "[motor]": "motor.kind: missing: expected induction or dc",
    '[motor]\nkind = "steam"': "motor.kind: 'steam': expected induction or dc",
    '[motor]\nkind = "dc"\nstall_torque = "1 N"\nno_load_speed = "1 rpm"': "not a unit of moment",
    '[motor]\nkind = "dc"\nstall_torque = "1 N m"\nno_load_speed = "1 rpm"\ncolour = 1':
        "motor.colour: unknown key: expected",
    '[motor]\nkind = "table"\nspeed = ["2 rpm", "1 rpm"]\ntorque = ["1 N m", "2 N m"]': "speeds increasing",
    '[gearbox]\nratio = -2': "gearbox.ratio: -2: expected more than zero",
    '[[inertia]]\ninertia = "1 kg m2"': "side: missing: expected shaft that it turns with: 'crank' or 'motor'",
    '[[load]]\nkind = "dry"\nforce = "1 N"': "unknown key 'force'",
    '[[load]]\nkind = "dry"\ntorque = "-1 N m"': "opposes the motion",
    '[[load]]\nkind = "viscous"\ntorque = "1 N m"': "at_speed: missing: expected speed",
    '[[load]]\nkind = "dry"\njoint = "Z"\ntorque = "1 N m"': "no joint 'Z'",
    '[[load]]\nkind = "table"\nangle = ["0 deg", "9 deg"]\ntorque = ["1 N m", "1 N m"]': "as many, angles increasing",
    'speeds = ["900 rpm", "94.24777960769379 rad/s"]': "holds one speed twice",
    '[[load]]\nname = "a"\nkind = "dry"\ntorque = "1 N m"\n[[load]]\nname = "a"\nkind = "dry"\ntorque = "1 N m"':
        "load: 'a' is there twice",
    '[[inertia]]\nname = "a"\ninertia = "1 kg m2"\nside = "crank"\n[[inertia]]\nname = "a"\ninertia = "1 kg m2"'
    '\nside = "crank"': "inertia: 'a' is there twice",
    "direction = 2": "direction: 2: expected 1 or -1",
}  # fmt: skip


@pytest.mark.parametrize(("change", "message"), WRONG.items(), ids=WRONG)
def test_what_is_wrong_is_named(tmp_path, change, message):
    """A key, kind, unit or joint that cannot be meant is refused, the file named."""
    key = change.split(" = ")[0]
    kept = [line for line in PLAIN.strip().splitlines() if not line.startswith(f"{key} =")]
    head = [line for line in kept if line.startswith(("mechanism", "speeds"))]
    motor = kept[kept.index("[motor]") :]
    lines = [*head, change] if change.startswith("[motor]") else [*head, *motor, change]
    if not change.startswith("["):
        lines = [change, *head, *motor]
    path = written(tmp_path, "\n".join(lines))
    with pytest.raises(DataError, match=message):
        whole(path)
