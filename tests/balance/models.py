"""Mechanisms that the tests build: small MJCF files with a known geometry and a closed home configuration."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from balance.datasets import dataset_names
from balance.mechanism.mechanism import Mechanism
from balance.mechanism.mjcf_parser import load_mechanism, mechanism_from_text
from balance.mechanism.tape import Symbols, Tape

BUILT_IN = ("serial-1r", "serial-2r", "serial-3r", "four-bar", "parallelogram-6bar", "parallelogram-6bar-full")
MANIPULATORS = BUILT_IN[4:]
SHIPPED = tuple(dataset_names("mechanisms", ".xml"))
LOADS = {
    "serial-1r": ({"link_1": 2.0}, {"counter_link_1": 1.5}),
    "serial-2r": ({"link_2": 2.0}, {"counter_link_1": 1.5, "counter_link_2": 0.5}),
    "serial-3r": ({"link_3": 2.0}, {"counter_link_2": 1.5, "counter_link_3": 0.5}),
    "four-bar": ({"AB": 1.1}, {"counter_A0A": 2.0, "counter_B0B": 0.7}),
    "parallelogram-6bar": ({"platform": 5.0}, {"counter_A0A": 24.2626, "counter_B0B": 17.1}),
    "parallelogram-6bar-full": ({"platform": 5.0}, {"counter_A0A": 24.2626, "counter_B0B": 17.1}),
}
"""A payload and counter-masses for each built-in mechanism, unequal on purpose [kg]."""


@cache
def load(name: str) -> Mechanism:
    """A built-in mechanism, read once."""
    return load_mechanism(name)


@cache
def loaded(name: str) -> Mechanism:
    """A built-in mechanism with its payload and counter-masses of LOADS, of which some have none."""
    payload, counters = LOADS.get(name, ({}, {}))
    return load(name).with_payload(payload).with_counter_mass(counters)


def mjcf(bodies: str, rest: str = "", options: str = '<option gravity="0.4 -9.81 1.3"/>') -> str:
    """A MJCF file with ``bodies`` under the base, angles in rad."""
    return (
        f'<mujoco><compiler angle="radian"/>{options}'
        f'<worldbody><body name="base">{bodies}</body></worldbody>{rest}</mujoco>'
    )


def inertial(mass: float = 1.3, pos: str = "0.1 0.02 0.03") -> str:
    """An <inertial> without any symmetry."""
    return f'<inertial pos="{pos}" mass="{mass}" fullinertia="0.02 0.03 0.04 0.001 0.002 0.003"/>'


def link(inner: str, name: str, joint: str = "", place: str = "", mass: float = 1.3) -> str:
    """A body with one joint named like it, an inertia, and ``inner``."""
    hinge = joint or f'<joint name="{name}" axis="0 0 1"/>'
    return f'<body name="{name}" {place}>{hinge}{inertial(mass)}{inner}</body>'


def four_bar(base: float, crank: float, coupler: float, rocker: float, angle: float, driven: str = "crank") -> str:
    """A planar four-bar, closed at a crank ``angle`` [rad] with its coupler above the line of the pivots [m]."""
    a, b0 = crank * np.exp(1j * angle), complex(base)
    span = b0 - a
    lift = np.arccos((coupler**2 + abs(span) ** 2 - rocker**2) / (2 * coupler * abs(span)))
    b = a + coupler * span / abs(span) * np.exp(1j * lift)
    home = [angle, np.angle(b - a) - angle, np.angle(b - b0)]
    return mjcf(
        link(f'<site name="counter_crank" pos="-0.1 0 0"/>{_coupler(crank, coupler)}', "crank")
        + link(f'<site name="end" pos="{rocker} 0 0"/>', "rocker", place=f'pos="{base} 0 0"', mass=0.9),
        '<equality><connect name="loop" site1="tip" site2="end"/></equality>' + motors(driven) + key(home),
    )


def _coupler(crank: float, length: float) -> str:
    return link(f'<site name="tip" pos="{length} 0 0"/>', "coupler", place=f'pos="{crank} 0 0"', mass=0.7)


def motors(*joints: str) -> str:
    """<actuator> with a motor on each joint."""
    listed = "".join(f'<motor joint="{joint}"/>' for joint in joints)
    return f"<actuator>{listed}</actuator>"


def key(qpos: "list[float] | np.ndarray", name: str = "home") -> str:
    """<keyframe> with one key."""
    return f'<keyframe><key name="{name}" qpos="{" ".join(repr(float(x)) for x in qpos)}"/></keyframe>'


def skew_arm() -> str:
    """A spatial arm: skew axes, joints off their origins, a slide, two joints on a body, losses, a fixed part."""
    wrist = '<joint name="w1" type="slide" axis="0.6 0 0.8"/><joint name="w2" axis="1 2 2" pos="0 0.1 0"/>'
    fixed = f'<body name="tool" pos="0.1 0.2 0.3" quat="0.5 0.5 -0.5 0.5">{inertial(0.4)}</body>'
    hand = link(fixed, "hand", wrist, 'pos="0.1 0.3 0" quat="0.9 0.1 0.3 -0.2"')
    slide = '<joint name="reach" type="slide" axis="1 0.5 0" damping="0.4" armature="0.3"/>'
    fore = link(hand, "fore", slide, 'pos="0.4 0 0.1" euler="0.3 -0.5 0.2"')
    turn = '<joint name="turn" axis="0.3 -0.2 0.9" pos="0.05 -0.1 0.2" damping="0.2" armature="0.1"/>'
    return mjcf(link(fore, "upper", turn, 'pos="0.2 0.1 0" euler="0.1 0.4 -0.6"'), motors("turn", "reach", "w1", "w2"))


def slider_crank(crank: float, rod: float, sign: float = 1.0, slider_first: bool = False) -> str:
    """A crank in the origin at ``sign`` rad, a rod and a slider along x, before or after them in the file [m]."""
    lean = -np.arcsin(crank * np.sin(sign) / rod)
    slide = '<joint name="slide" type="slide" axis="1 0 0"/>'
    slider = link('<site name="end" pos="0 0 0"/>', "slider", slide)
    turning, x = link(_coupler(crank, rod), "crank"), crank * np.cos(sign) + rod * np.cos(lean)
    return mjcf(
        slider + turning if slider_first else turning + slider,
        '<equality><connect name="loop" site1="tip" site2="end"/></equality>' + motors("slide")
        + key(np.roll([sign, lean - sign, x], int(slider_first))),
    )  # fmt: skip


def spatial_four_bar() -> str:
    """A crank, a universal joint, a ball and a rocker, their axes in no common plane: one degree of freedom."""
    cross = '<joint name="u1" axis="0 0 1"/><joint name="u2" axis="0 1 0"/>'
    coupler = link('<site name="ball" pos="0.5 0 0"/>', "coupler", cross, 'pos="0.12 0 0.03"')
    rocker = '<joint name="rocker" axis="0.28 0 0.96"/>'
    return mjcf(
        link(coupler, "crank", '<joint name="crank" axis="0 0.6 0.8"/>')
        + link('<site name="end" pos="0.3 0 0.05"/>', "rocker", rocker, 'pos="0.4 0 0.1"'),
        '<equality><connect name="ball" site1="ball" site2="end"/></equality>' + motors("crank")
        + key([0.8868958594656499, -0.2168524618811428, -1.0250701931098987, 1.3937656521338404]),
    )  # fmt: skip


def on_a_slide(along: str, reach: float, stroke: str = "") -> str:
    """A carriage along an axis with a pendulum, and on that a second one or a ram; each with a site."""
    tip = (
        f'<joint name="S" type="slide" axis="1 0 0" {stroke}/>'
        if stroke
        else '<joint name="B" type="hinge" axis="0 0 1"/>'
    )
    return f"""<mujoco model="on-a-slide"><compiler angle="radian"/><worldbody>
<body name="carriage"><joint name="X" type="slide" axis="{along}"/>
<inertial pos="0 0 0" mass="6" diaginertia="0.05 0.05 0.05"/>
<body name="upper" pos="0 0 0.08"><joint name="A" type="hinge" axis="0 0 1"/>
<inertial pos="0.13 0 0" mass="2" diaginertia="0.002 0.018 0.018"/><site name="counter_upper" pos="-0.15 0 0"/>
<body name="tip" pos="{reach} 0 0">{tip}
<inertial pos="0.12 0 0" mass="1.2" diaginertia="0.001 0.007 0.007"/><site name="counter_tip" pos="-0.1 0 0"/>
</body></body></body></worldbody>
<actuator><motor joint="X"/><motor joint="A"/><motor joint="{"S" if stroke else "B"}"/></actuator></mujoco>"""


def bennett(angle: float = 0.8, alpha: float = 0.6, beta: float = 1.1, a: float = 0.3) -> str:
    """Bennett's linkage, cut in its last link and welded: six rows, of which three are independent.

    G. T. Bennett (1903): a / sin(alpha) = b / sin(beta), opposite sides equal;
    tan(t1/2) tan(t2/2) = sin((alpha + beta)/2) / sin((beta - alpha)/2), t3 = -t1, t4 = -t2.
    """
    b = a * np.sin(beta) / np.sin(alpha)
    other = 2 * np.arctan(np.sin((alpha + beta) / 2) / np.sin((beta - alpha) / 2) / np.tan(angle / 2))
    sides = [(0.0, 0.0), (a, alpha), (b, beta), (a, alpha)]
    text = f'<site name="end" pos="{b} 0 0" euler="{beta} 0 0"/>'
    for k, (length, twist) in reversed(list(enumerate(sides, 1))):
        text = link(text, f"j{k}", place=f'pos="{length} 0 0" euler="{twist} 0 0"', mass=0.5 + 0.2 * k)
    mount = '<body name="mount"><site name="start" pos="0 0 0"/></body>'
    weld = '<equality><weld name="cut" site1="end" site2="start"/></equality>'
    return mjcf(mount + text, weld + motors("j1") + key([angle, other, -angle, -other]))


def model(text: str, name: str = "test") -> Mechanism:
    """A mechanism from the text of a MJCF file."""
    return mechanism_from_text(text, name)


def reframed(text: str, world: np.ndarray, seed: int = 0) -> str:
    """The same machine, its axes without the attribute ``euler``, in the base's axes turned by ``world`` (3, 3).

    With a ``seed`` other than 0 the frames of its bodies are turned too, at random.
    """
    root, rng = ElementTree.fromstring(text), np.random.default_rng(seed)

    def written(values: np.ndarray) -> str:
        return " ".join(repr(float(value)) for value in values)

    def turn(element: ElementTree.Element, own: np.ndarray) -> None:
        for key in {"pos", "axis", "gravity"} & set(element.keys()):
            element.set(key, written(own.T @ np.array(element.get(key, "").split(), float)))
        if (principal := element.attrib.pop("diaginertia", None)) is not None:
            about = own.T @ np.diag(np.array(principal.split(), float)) @ own
            element.set("fullinertia", written(about[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]))

    def body(element: ElementTree.Element, frame: np.ndarray) -> None:
        for one in element:
            turn(one, frame)
            if one.tag == "body":
                inner = Rotation.random(random_state=rng).as_matrix() if seed else world
                one.set("quat", written(Rotation.from_matrix(frame.T @ inner).as_quat(scalar_first=True)))
                body(one, inner)

    for one in root:
        if one.tag == "option":
            turn(one, world)
        elif one.tag == "worldbody":
            body(one, world)
    return ElementTree.tostring(root, encoding="unicode")


def scaled(text: str, times: float) -> str:
    """The same machine with all lengths ``times`` as large, masses as they are; slides without limits."""
    root = ElementTree.fromstring(text)
    slides = [joint.get("type") == "slide" for joint in root.iterfind("worldbody//joint")]
    for key, factor in {"pos": times, "diaginertia": times**2, "fullinertia": times**2}.items():
        for one in root.iterfind(f".//*[@{key}]"):
            one.set(key, " ".join(repr(factor * float(value)) for value in one.get(key, "").split()))
    for one in root.iter("key"):
        values = zip(one.get("qpos", "").split(), slides, strict=True)
        one.set("qpos", " ".join(repr((times if slide else 1.0) * float(value)) for value, slide in values))
    return ElementTree.tostring(root, encoding="unicode")


def serial_chain(count: int, seed: int) -> str:
    """A serial chain in no file of the project: random lengths, masses, centres off the line."""
    rng = np.random.default_rng(seed)
    text = ""
    for k in reversed(range(count)):
        place = "" if k == 0 else f'pos="{rng.uniform(0.1, 0.4)} 0 0"'
        centre = f"{rng.uniform(-0.1, 0.3)} {rng.uniform(-0.05, 0.05)} 0"
        inertial = f'<inertial pos="{centre}" mass="{rng.uniform(0.3, 2)}" diaginertia="0.01 0.01 0.01"/>'
        joint = f'<joint name="J{k + 1}" axis="0 0 1"/><site name="counter_{k + 1}" pos="-0.1 0 0"/>'
        text = f'<body name="link_{k + 1}" {place}>{joint}{inertial}{text}</body>'
    rest = motors(*(f"J{k + 1}" for k in range(count))) + key(rng.uniform(-1, 1, count))
    return mjcf(text, rest, '<option gravity="0 -9.81 0"/>')


def evaluated(write: Callable[..., Symbols], *inputs: np.ndarray) -> np.ndarray:
    """What ``write`` gives of symbols, a row of each of the ``inputs`` (rows, n) each, at n samples: (n, ...)."""
    tape = Tape()
    written = np.asarray(write(*(tape.rows(len(rows)) for rows in inputs)), dtype=object)
    return tape.program(written.ravel()).values(*inputs).T.reshape(-1, *written.shape)
