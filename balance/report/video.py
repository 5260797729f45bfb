"""A moving mechanism as a video, encoded by the ffmpeg of imageio-ffmpeg, or as a still: the pictures of its page."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from ..closure import Trajectory
from ..errors import CounterpoiseError
from ..figures.mechanism import COUNTER, GROUND, LINK, PAYLOAD
from ..mechanism.mechanism import Mechanism
from ..results import plain_text
from .moving import animation_page, designs_of, moving, pictures
from .page import writable

FRAMES_PER_SECOND = 25
_PANEL, _BLOCK, _HEADING = 640, 16, 88
"""Width of a panel, of what its sides are multiples of, height of the text above [pixels]."""
_COLOURS = {
    "link": LINK, "payload": PAYLOAD, "stay": COUNTER, "counter": COUNTER, "pivot": GROUND, "ground": GROUND,
    "centre": "#8a1c1c", "force": "#8a1c1c",
}  # fmt: skip
_FILLED = {"counter": COUNTER + "66", "ground": GROUND}


STILLS = (".png", ".svg", ".pdf")
ENDINGS = (".html", ".mp4", *STILLS)


def writable_animation(path: str | Path) -> Path:
    """The path of what is to be written, before anything is computed.

    Raises DataError for another ending, or no folder; CounterpoiseError, with the cure, where no video can be written.
    """
    path = writable(path, ENDINGS)
    if path.suffix.lower() == ".mp4":
        refuse_without_encoder(path)
    return path


def write_animation(
    path: Path, mechanism: Mechanism, motion: str, trajectory: Trajectory, masses: dict[str, float]
) -> dict[str, Any]:
    """Write a page, a video or a still by the ending of ``path``; gives what is drawn, as :func:`moving` does.

    ``motion`` names the ``trajectory``; ``masses`` [kg] by site are shown beside the mechanism without them.
    """
    motion, ending = Path(motion).name, path.suffix.lower()
    drawn = moving(motion, trajectory, designs_of(mechanism, masses))
    if ending == ".html":
        animation_page(mechanism.name, motion, drawn).write(path)
    else:
        write = write_video if ending == ".mp4" else write_still
        write(path, f"{mechanism.name}, motion {motion}", drawn)
    return drawn


def refuse_without_encoder(path: Path) -> None:
    """Raise CounterpoiseError, with the cure, where no video can be written."""
    if find_spec("imageio_ffmpeg") is None:
        raise CounterpoiseError(
            f"{path}: writing a video needs imageio-ffmpeg: pip install 'counterpoise[video]', or name a .html"
        )


def write_video(path: Path, title: str, motion: Mapping[str, Any]) -> Path:
    """Write what :func:`balance.report.moving.moving` gives as H.264, whole, or leave what was there before."""
    import imageio_ffmpeg

    time, part = motion["time"], path.with_name(f".{path.name}.part{path.suffix}")
    slower = len(time) / FRAMES_PER_SECOND / ((time[-1] - time[0]) or 1.0)
    pace = f"{slower:.3g} times slower" if slower > 1.0 else f"{1.0 / slower:.3g} times faster"
    writer = imageio_ffmpeg.write_frames(str(part), _size(motion), fps=FRAMES_PER_SECOND, macro_block_size=_BLOCK)
    try:
        writer.send(None)
        for figure in _drawn(title, motion, range(len(time)), pace):
            figure.canvas.draw()  # rows of red, green and blue, a byte each
            writer.send(np.ascontiguousarray(np.asarray(figure.canvas.buffer_rgba())[:, :, :3]).tobytes())
        writer.close()
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
    return path


def write_still(path: Path, title: str, motion: Mapping[str, Any]) -> Path:
    """Draw the picture in which the first panel's shaking force is largest, by ``path``'s ending."""
    largest = int(np.argmax(motion["panels"][0]["force_N"]))
    next(_drawn(title, motion, [largest], f"of {len(motion['time'])} pictures that of the largest force")).savefig(path)
    return path


def _size(motion: Mapping[str, Any]) -> tuple[int, int]:
    """Width and height of a picture [pixels]."""
    height = _HEADING + _PANEL * motion["height"] / motion["width"]
    return _PANEL * len(motion["panels"]), _BLOCK * int(np.ceil(height / _BLOCK))


def _drawn(title: str, motion: Mapping[str, Any], frames: Iterable[int], note: str) -> Iterator[Any]:
    """The figure with each of the ``frames`` in turn."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    width, height = _size(motion)
    figure = Figure(figsize=(width / 100.0, height / 100.0), dpi=100)
    FigureCanvasAgg(figure)
    heading = figure.text(0.01, 0.985, "", va="top", fontsize=9, parse_math=False)
    panels = [_panel(figure, i, motion) for i in range(len(motion["panels"]))]
    for frame in frames:
        heading.set_text(f"SIMULATED: {plain_text(title)}, t = {motion['time'][frame]:.3f} s\n{note}\n{motion['view']}")
        for draw in panels:
            draw(frame)
        yield figure


def _panel(figure: Any, place: int, motion: Mapping[str, Any]) -> Callable[[int], None]:  # noqa: ANN401
    """A panel of one design; draws one picture of it."""
    from matplotlib.patches import Circle, Polygon

    panel, count = motion["panels"][place], len(motion["panels"])
    points = pictures(panel)
    axes = figure.add_axes((place / count, 0.0, 1.0 / count, 1.0 - _HEADING / figure.bbox.height))
    axes.set(xlim=(0.0, motion["width"]), ylim=(motion["height"], 0.0), aspect="equal")
    axes.axis("off")
    label = axes.text(0.02, 1.0, "", transform=axes.transAxes, va="bottom", fontsize=10, parse_math=False)
    low = motion["height"] - 25.0
    axes.plot([30.0, 30.0 + motion["scale_bar"]], [low, low], color="black")
    axes.text(30.0, low - 10.0, f"{1000.0 * motion['scale_bar_m']:g} mm", fontsize=10)
    patches: list[Any] = []
    for shape in panel["shapes"]:
        kind, is_round = shape["kind"], len(shape["points"]) == 1
        filled = _FILLED.get(kind, "white" if is_round else "none")
        look = {"ec": _COLOURS[kind], "fc": filled, "lw": 1.5 if is_round or kind == "stay" else 3.0}
        if is_round:
            patches.append(Circle((0.0, 0.0), shape.get("radius", 9.0), **look))
        else:
            patches.append(Polygon(np.zeros((2, 2)), closed=kind in ("link", "payload"), **look))
        axes.add_patch(patches[-1])

    def draw(frame: int) -> None:
        force, largest = panel["force_N"][frame], panel["largest_N"]
        label.set_text(f"{panel['label']}: shaking force {force} N, largest {largest:.4g} N")
        for shape, patch in zip(panel["shapes"], patches, strict=True):
            places = points[frame, shape["points"]]
            if len(places) == 1:
                patch.set_center(places[0])
            else:
                patch.set_xy(places)

    return draw
