"""A moving mechanism as a video, encoded by the ffmpeg of imageio-ffmpeg, or as a still: the pictures of its page."""

from collections.abc import Iterable, Iterator, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Floats
from ..errors import CounterpoiseError
from ..figures.mechanism import COUNTER, GROUND, LINK, PAYLOAD
from ..results import plain_text
from .moving import pictures

FRAMES_PER_SECOND = 25
_PANEL, _BLOCK, _HEADING = 640, 16, 88
"""Width of a panel, of what its sides are multiples of, height of the text above [pixels]."""
_COLOURS = {
    "link": LINK, "payload": PAYLOAD, "stay": COUNTER, "counter": COUNTER, "pivot": GROUND, "ground": GROUND,
    "centre": "#8a1c1c", "force": "#8a1c1c",
}  # fmt: skip
_FILLED = {"counter": COUNTER + "66", "ground": GROUND}


def refuse_without_encoder(path: Path) -> None:
    """Raise CounterpoiseError, with the cure, where no video can be written."""
    if find_spec("imageio_ffmpeg") is None:
        raise CounterpoiseError(
            f"{path}: writing a video needs imageio-ffmpeg: pip install 'counterpoise[video]', or name a .html"
        )


def write_video(path: Path, title: str, motion: Mapping[str, Any]) -> Path:
    """Write what :func:`balance.report.moving.moving` gives as H.264, whole, or leave what was there before."""
    import imageio_ffmpeg

    part, size = path.with_name(f".{path.name}.part{path.suffix}"), _size(motion)
    writer = imageio_ffmpeg.write_frames(str(part), size, fps=FRAMES_PER_SECOND, macro_block_size=_BLOCK)
    try:
        writer.send(None)
        for picture in _rendered(title, motion):
            writer.send(picture)
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


def _rendered(title: str, motion: Mapping[str, Any]) -> Iterator[bytes]:
    """Every picture as rows of red, green and blue, a byte each."""
    time = motion["time"]
    slower = len(time) / FRAMES_PER_SECOND / ((time[-1] - time[0]) or 1.0)
    pace = f"{slower:.3g} times slower" if slower > 1.0 else f"{1.0 / slower:.3g} times faster"
    for figure in _drawn(title, motion, range(len(time)), pace):
        figure.canvas.draw()
        yield np.ascontiguousarray(np.asarray(figure.canvas.buffer_rgba())[:, :, :3]).tobytes()


def _drawn(title: str, motion: Mapping[str, Any], frames: Iterable[int], note: str) -> Iterator[Any]:
    """The figure with each of the ``frames`` in turn."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    width, height = _size(motion)
    figure = Figure(figsize=(width / 100.0, height / 100.0), dpi=100)
    FigureCanvasAgg(figure)
    heading = figure.text(0.01, 0.985, "", va="top", fontsize=9, parse_math=False)
    panels = [_Panel(figure, i, motion) for i in range(len(motion["panels"]))]
    for frame in frames:
        heading.set_text(f"SIMULATED: {plain_text(title)}, t = {motion['time'][frame]:.3f} s\n{note}\n{motion['view']}")
        for panel in panels:
            panel.draw(frame)
        yield figure


class _Panel:
    """One design."""

    def __init__(self, figure: Any, place: int, motion: Mapping[str, Any]) -> None:  # noqa: ANN401
        from matplotlib.patches import Circle, Polygon

        self.panel, count = motion["panels"][place], len(motion["panels"])
        self.points: Floats = pictures(self.panel)
        height = figure.bbox.height
        axes = figure.add_axes((place / count, 0.0, 1.0 / count, 1.0 - _HEADING / height))
        axes.set(xlim=(0.0, motion["width"]), ylim=(motion["height"], 0.0), aspect="equal")
        axes.axis("off")
        self.label = axes.text(0.02, 1.0, "", transform=axes.transAxes, va="bottom", fontsize=10, parse_math=False)
        low = motion["height"] - 25.0
        axes.plot([30.0, 30.0 + motion["scale_bar"]], [low, low], color="black")
        axes.text(30.0, low - 10.0, f"{1000.0 * motion['scale_bar_m']:g} mm", fontsize=10)
        self.shapes = []
        for shape in self.panel["shapes"]:
            kind, round_ = shape["kind"], len(shape["points"]) == 1
            filled = _FILLED.get(kind, "white" if round_ else "none")
            look = {"ec": _COLOURS[kind], "fc": filled, "lw": 1.5 if round_ or kind == "stay" else 3.0}
            self.shapes.append(axes.add_patch(
                Circle((0.0, 0.0), shape.get("radius", 9.0), **look) if round_
                else Polygon(np.zeros((2, 2)), closed=kind in ("link", "payload"), **look)
            ))  # fmt: skip

    def draw(self, frame: int) -> None:
        """One picture."""
        force, largest = self.panel["force_N"][frame], self.panel["largest_N"]
        self.label.set_text(f"{self.panel['label']}: shaking force {force} N, largest {largest:.4g} N")
        for shape, patch in zip(self.panel["shapes"], self.shapes, strict=True):
            places = self.points[frame, shape["points"]]
            if len(places) == 1:
                patch.set_center(places[0])
            else:
                patch.set_xy(places)
