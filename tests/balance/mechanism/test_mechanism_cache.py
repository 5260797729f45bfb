"""What MuJoCo made of a file is kept: the same mechanism to the last bit, and made anew where anything differs."""

import sys
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from balance.errors import ModelError
from balance.mechanism import mjcf_parser
from balance.mechanism.mechanism import Mechanism
from balance.mechanism.mjcf_parser import load_mechanism

from .test_robot_files import FOUR_BAR

TETRAHEDRON = "v 0 0 0\nv 0.3 0 0\nv 0 0.1 0\nv 0 0 {height}\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
ARM = """<mujoco><compiler meshdir='parts'/><asset><mesh file='m.obj' inertia='exact'/><mesh file='drawn.stl'/></asset>
    <custom><text name='payload' data='hand'/><numeric name='tip.radius_of_gyration' data='0.1'/></custom>
    <worldbody><body name='arm'><joint type='ball' name='k'/><geom type='mesh' mesh='m' density='600'/>
    <include file='hand.xml'/></body></worldbody>
    <keyframe><key name='home' qpos='0.6 0 0.8 0 0.3'/></keyframe></mujoco>"""
HAND = """<mujoco><body name='hand' pos='0.3 0 0.1' euler='10 20 30'><joint name='turn' ref='15' range='-90 90'/>
    <inertial pos='0.1 0 0' mass='{mass}' diaginertia='0.02 0.02 0.02'/>
    <geom type='mesh' mesh='drawn'/><site name='tip' pos='0.1 0 0'/></body></mujoco>"""
FILES = {
    "arm.xml": {
        "arm.xml": ARM,
        "hand.xml": HAND.format(mass=1.1),
        "parts/m.obj": TETRAHEDRON.format(height=0.05),
        "parts/drawn.stl": "no mesh",
    },
    "robot.urdf": {"robot.urdf": FOUR_BAR, "robot.yaml": "closed_loop: [[end_A, e2]]\ntype: [3d]\n"},
}


def cache_in(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Caches are kept there."""
    for variable in ("XDG_CACHE_HOME", "LOCALAPPDATA"):
        monkeypatch.setenv(variable, str(folder))


@pytest.fixture
def compiled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """An empty cache, and the names of what is compiled from now on."""
    monkeypatch.setenv("COUNTERPOISE_CACHE", "on")
    cache_in(tmp_path, monkeypatch)
    names, compile_spec = [], mjcf_parser.compile_spec
    monkeypatch.setattr(mjcf_parser, "compile_spec", lambda *a: names.append(a[2]) or compile_spec(*a))
    return names


def written(folder: Path, name: str) -> Path:
    """The file of that name, and what belongs to it."""
    for other, text in FILES[name].items():
        (folder / other).parent.mkdir(exist_ok=True)
        (folder / other).write_text(text, encoding="utf-8")
    return folder / name


def assert_same(found: Mechanism, other: Mechanism) -> None:
    """All of two mechanisms, bit by bit."""
    np.testing.assert_equal(asdict(found), asdict(other))
    assert found.parameters.tobytes() == other.parameters.tobytes()


@pytest.mark.parametrize("name", ["four-bar", "delta", *FILES])
def test_it_is_compiled_once(name: str, tmp_path: Path, compiled: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """Of balls, loops, meshes, links and names the same is read as without the cache."""
    path = written(tmp_path, name) if name in FILES else name
    found = [load_mechanism(path)]
    monkeypatch.delitem(sys.modules, "mujoco")
    found.append(load_mechanism(path))
    assert "mujoco" not in sys.modules
    monkeypatch.undo()
    assert len(compiled) == 1
    for one in found:
        assert_same(one, load_mechanism(path))


def flipped(entry: Path) -> None:
    """One bit of an entry."""
    content = entry.read_bytes()
    entry.write_bytes(content[:-9] + bytes([content[-9] ^ 1]) + content[-8:])


def of_another_text(entry: Path) -> None:
    """A sound entry in the place of another."""
    load_mechanism("serial-1r")
    (other,) = set(entry.parent.iterdir()) - {entry}
    other.replace(entry)


DAMAGE: dict[str, Callable[[Path], object]] = {
    "a flipped bit": flipped,
    "cut short": lambda entry: entry.write_bytes(entry.read_bytes()[:-1]),
    "empty": lambda entry: entry.write_bytes(b""),
    "other bytes": lambda entry: entry.write_bytes(bytes(100)),
    "without end": lambda entry: entry.write_bytes(entry.read_bytes() + b" " * 3_000_000),
    "of another text": of_another_text,
    "that others may write": lambda entry: entry.chmod(0o666),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_a_damaged_entry_is_made_anew(damage: str, compiled: list[str], tmp_path: Path) -> None:
    """And is sound from then on."""
    sound = load_mechanism("four-bar")
    (entry,) = (tmp_path / "counterpoise").iterdir()
    DAMAGE[damage](entry)
    compiled.clear()
    for _ in range(2):
        assert_same(load_mechanism("four-bar"), sound)
    assert compiled == ["four-bar.xml"]


CHANGES = {
    "include": ("arm.xml", "hand.xml", HAND.format(mass=1.2)),
    "mesh": ("arm.xml", "parts/m.obj", TETRAHEDRON.format(height=0.06)),
    "text": ("arm.xml", "arm.xml", ARM.replace("600", "500")),
    "loops": ("robot.urdf", "robot.yaml", ""),
}


@pytest.mark.parametrize("change", CHANGES)
def test_what_changed_is_compiled_again(change: str, compiled: list[str], tmp_path: Path) -> None:
    """Whichever file it is in; put back, it is known again or the same."""
    name, file, text = CHANGES[change]
    path = written(tmp_path, name)
    before = load_mechanism(path)
    (tmp_path / file).write_text(text, encoding="utf-8")
    after = load_mechanism(path)
    assert len(compiled) == 2
    assert after.pi.tobytes() != before.pi.tobytes() or after.loops != before.loops
    assert_same(load_mechanism(written(tmp_path, name)), before)


def test_a_file_that_went_is_missed(compiled: list[str], tmp_path: Path) -> None:
    """Also one that is only drawn, and one that now lies elsewhere."""
    path = written(tmp_path, "arm.xml")
    load_mechanism(path)
    (tmp_path / "parts/drawn.stl").unlink()
    with pytest.raises(ModelError, match=r"'drawn\.stl', which is not there"):
        load_mechanism(path)
    written(tmp_path, "arm.xml")
    (tmp_path / "parts/m.obj").rename(tmp_path.parent / "m.obj")
    (tmp_path / "parts/m.obj").symlink_to(tmp_path.parent / "m.obj")
    with pytest.raises(ModelError, match=r"'m\.obj' lies outside the folder"):
        load_mechanism(path)


def test_another_mujoco_compiles_anew(compiled: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """Or other sources of ours: an entry holds for what is installed."""
    load_mechanism("four-bar")
    key = mjcf_parser._key
    monkeypatch.setattr(mjcf_parser, "_key", lambda text, folders: key(text, folders[1:]))
    load_mechanism("four-bar")
    assert compiled == ["four-bar.xml"] * 2


def test_few_entries_are_kept(compiled: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The newest; and none where they would be too large, or where nothing can be written."""
    monkeypatch.setattr(mjcf_parser, "_COUNT", 2)
    for name in ("four-bar", "serial-1r", "delta"):
        load_mechanism(name)
    assert len(list((tmp_path / "counterpoise").iterdir())) == 2
    monkeypatch.setattr(mjcf_parser, "_LIMIT", 1000)
    cache_in(tmp_path / "other", monkeypatch)
    load_mechanism("four-bar")
    assert not (tmp_path / "other").exists()
    monkeypatch.undo()
    monkeypatch.setenv("COUNTERPOISE_CACHE", "on")
    (tmp_path / "file").write_text("")
    for variable in (tmp_path / "file", tmp_path / "full", Path("relative"), Path()):
        cache_in(variable, monkeypatch)
        with monkeypatch.context() as without:
            without.setattr(Path, "home", Mock(side_effect=RuntimeError("no home")))
            without.setattr(Path, "replace", Mock(side_effect=OSError("disk full")))
            assert load_mechanism("four-bar").name == "four-bar"
    assert not list((tmp_path / "full/counterpoise").iterdir())
    assert not Path("relative").exists()
