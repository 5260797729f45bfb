"""The parts of a mechanism that a rig names: those of a shipped file, of one beside the rig, and none."""

import pytest

from testbench.errors import RigError
from testbench.rig import load_rig

RIG = """
mechanism = "{mechanism}"
[loggers.daq]
[sensors.encoder]
kind = "encoder"
logger = "daq"
channel = "q"
joint = "{joint}"
[sensors.acc]
kind = "accelerometer"
logger = "daq"
channels = {{ x = "a" }}
position = ["0 m", "0 m", "0 m"]
attached_to = "{body}"
"""
MODEL = (
    '<mujoco><worldbody><body name="base"><body name="arm"><joint name="elbow"/><site name="tip"/></body></body>'
    "</worldbody></mujoco>"
)


@pytest.fixture
def rig(tmp_path):
    """Load a rig from a file."""

    def written(mechanism="parallelogram-6bar", joint="A0", body="platform", before=""):
        (tmp_path / "rig.toml").write_text(
            before + RIG.format(mechanism=mechanism, joint=joint, body=body), encoding="utf-8"
        )
        return load_rig(tmp_path / "rig.toml")

    return written


def test_names_of_a_shipped_mechanism(rig):
    """Joints, bodies and sites come from its file."""
    names = rig().names
    assert {"A0", "B0"} <= set(names.joints)
    assert {"A0A", "platform", "base"} <= set(names.bodies)
    assert {"counter_A0A", "counter_B0B"} <= set(names.sites)


def test_a_mechanism_beside_the_rig(rig, tmp_path):
    """A file of the user's own, with or without its ending, goes before what is shipped."""
    (tmp_path / "mine.xml").write_text(MODEL)
    for name in ("mine", "mine.xml"):
        assert rig(name, "elbow", "arm").names.sites == ("tip",)
    with pytest.raises(RigError, match=r"sensors\.encoder\.joint: mine has no joint 'A0': expected elbow"):
        rig("mine", "A0", "arm")


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (
            {"joint": "AO"},
            r"sensors\.encoder\.joint: parallelogram-6bar has no joint 'AO': expected A0, A, B0, B, ",
        ),
        ({"body": "plattform"}, r"sensors\.acc\.attached_to: .*no body 'plattform'.*did you mean 'platform'"),
        ({"mechanism": "parallelogram-6bra"}, r"no shipped mechanism .*did you mean 'parallelogram-6bar'"),
        ({"mechanism": "../parallelogram-6bar"}, "no shipped mechanism"),
    ],
)
def test_what_the_mechanism_does_not_have(rig, given, said):
    """Refused with the key, and the names that there are."""
    with pytest.raises(RigError, match=said):
        rig(**given)


def test_a_file_that_is_no_mechanism(rig, tmp_path):
    """Its name and place in the message."""
    (tmp_path / "mine.xml").write_text("<mujoco>")
    with pytest.raises(RigError, match=r"mechanism: mine\.xml: not an XML file"):
        rig("mine")


def test_a_bench_without_a_mechanism(rig):
    """``none`` is said, and nothing is checked against it."""
    assert rig("none", "any", "table").names is None


def test_a_byte_order_mark(rig):
    """Windows' editors put one at the head; the text that is kept has it still."""
    found = rig(before="\ufeff")
    assert found.text.startswith("\ufeff")
    assert load_rig(found.text).mechanism == "parallelogram-6bar"
