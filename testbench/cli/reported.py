"""A report of a run as text."""

from typing import TYPE_CHECKING, Any

import click

from balance.cli.console import emit_table

if TYPE_CHECKING:
    from ..report import RunReport

Part = dict[str, Any]


def say(found: "RunReport") -> None:
    """Print a run's report, part by part."""
    from ..figures.style import condition_of, origin_of

    click.echo(f"{origin_of([found.run])}{found.run.name}: {condition_of(found.run)}")
    ways = {
        "motions": _motions, "command": _command, "vibration": _vibration, "modes": _modes, "response": _response,
        "wrench": _wrench, "torque": _torque,
    }  # fmt: skip
    for name, part in found.parts.items():
        if "reason" in part:
            click.echo(f"No {name}: {part['reason']}")
        else:
            ways[name](part)
    for finding in found.findings:
        click.echo(f"  {finding['code']}: {finding['message']}")
    click.echo()


def _motions(part: Part) -> None:
    rows = [
        [m["motion"], m["by"], m["group"], f"{m['start_s']:.4f}", f"{m['end_s']:.4f}", str(m["repeat"]),
         "-" if m["extent_m"] is None else f"{1e3 * m['extent_m']:.1f}", m["reason"]]
        for m in part["found"]
    ]  # fmt: skip
    header = ["motion", "by", "clock of", "start [s]", "end [s]", "repeat", "extent [mm]", "because"]
    emit_table("Motions", header, rows, part["definition"])
    for source, reason in part["reasons"].items():
        click.echo(f"Nothing by {source}: {reason}")


def _command(part: Part) -> None:
    rows = [
        [a["axis"], a["by"], _number(a["target_peak_m_s2"]), _number(a["peak_m_s2"]), _number(a["target_rms_m_s2"]),
         _number(a["error_rms_m_s2"]), "-" if a["delay_s"] is None else f"{1e3 * a['delay_s']:z.2f}"]
        for a in part["axes"]
    ]  # fmt: skip
    header = ["axis", "by", "target peak", "peak", "target RMS", "RMS error", "delay [ms]"]
    noise = ", ".join(f"{joint} {value:.2g}" for joint, value in part["encoder_noise"].items())
    emit_table("Acceleration of what is driven [m/s2]", header, rows,
               f"below {part['bandwidth_hz']:g} Hz; noise of the encoders' steps [rad/s2]: {noise}")  # fmt: skip


def _vibration(part: Part) -> None:
    rows = [
        [a["sensor"], a["component"], *(_number(a[f"{m}_m_s2"]) for m in ("peak", "peak_to_peak", "rms")),
         ", ".join(f"{p['frequency_hz']:.1f}" for p in a["spectrum_peaks"]) or "-"]
        for a in part["axes"]
    ]  # fmt: skip
    header = ["sensor", "axis", "peak", "peak to peak", "RMS", "spectrum peaks [Hz]"]
    emit_table("Vibration of the base [m/s2]", header, rows, "; ".join(part["definitions"].values()))


def _modes(part: Part) -> None:
    rows = [_mode(m) for m in part["modes"]]
    header = ["frequency [Hz]", "95 %", "damping [%]", "95 %", f"amplitude {', '.join(part['channels'])} [m/s2]", ""]
    emit_table(f"Modes of the base, from {part['from_s']:.3f} to {part['to_s']:.3f} s of {part['group']}", header, rows,
               f"{part['definition']}; below {part['band_hz'][1]:g} Hz")  # fmt: skip


def _mode(mode: Part) -> list[str]:
    sizes = " ".join(f"{a:.3g}" for a in mode["amplitudes_m_s2"])
    if mode["reason"]:
        return [f"near {mode['near_hz']:.1f}", "-", "-", "-", sizes, f"not determined: {mode['reason']}"]
    ends, damping = mode["frequency_interval_hz"], mode["damping_interval"]
    return [f"{mode['frequency_hz']:.3f}", f"{ends[0]:.3f} .. {ends[1]:.3f}", f"{100 * mode['damping_ratio']:.2f}",
            f"{100 * damping[0]:.2f} .. {100 * damping[1]:.2f}", sizes, ""]  # fmt: skip


def _response(part: Part) -> None:
    rows = []
    for axis in sorted({(r["sensor"], r["axis"]) for r in part["rows"]}):
        told = [r for r in part["rows"] if (r["sensor"], r["axis"]) == axis]
        top = max(told, key=lambda r: float(r["gain_1_kg"]))
        ends = top["gain_interval_1_kg"]
        rows.append([*axis, str(len(told)), f"{top['frequency_hz']:.1f}", f"{top['gain_1_kg']:.3g}",
                     f"{ends[0]:.3g} .. {ends[1]:.3g}", f"{top['coherence']:.3f}",
                     ", ".join(top["also_follows"]) or "nothing else"])  # fmt: skip
    header = ["sensor", "axis", "significant lines", "largest at [Hz]", "gain [1/kg]", "95 %", "coherence",
              "there it also follows"]  # fmt: skip
    alone = "" if part["of_the_force_alone"] else ", with what follows its moment or other axes: not of the base alone"
    emit_table(f"Acceleration of the base per shaking force{alone}", header, rows, part["definition"])


def _wrench(part: Part) -> None:
    rows = [
        [name, *(_number(v) for v in metrics.values())] if metrics else [name, "-", "-", "-", part["reasons"][name]]
        for name, metrics in part["components"].items()
    ]
    rows = [row + [""] * (5 - len(row)) for row in rows]
    header = ["component", "peak", "peak to peak", "RMS", "not determined, because"]
    point = ", ".join(f"{v:g}" for v in part["point_m"])
    emit_table(
        f"Shaking force and moment about ({point}) m [N, N m]", header, rows, f"{part['definition']}; {part['tare']}"
    )


def _torque(part: Part) -> None:
    rows = []
    for drive in part["drives"]:
        key, unit = ("Nm", "N m") if "measured_rms_Nm" in drive else ("N", "N")
        rows.append([
            drive["joint"], *(_number(drive[f"{name}_{key}"]) for name in ("measured_rms", "model_rms")),
            f"{drive['rms_ratio']:.3f}", f"{drive['scale']:.3f}", f"{100 * drive['residual_share']:.1f}",
            f"{1e3 * drive['delay_s']:z.2f}", unit,
        ])  # fmt: skip
    header = ["joint", "measured RMS", "model RMS", "ratio", "scale", "left [%]", "delay [ms]", "unit"]
    band = part["drives"][0]["bandwidth_hz"] if part["drives"] else 0.0
    words = part["definitions"]
    note = f"below {band:g} Hz; scale: {words['scale']}; left: {words['residual_share']}"
    emit_table("Torques of the drives against the model", header, rows, note)


def _number(value: float) -> str:
    return f"{value:.4g}"
