"""One small file of each format, written by another program where there is one."""

import gc
import struct
import warnings

import ezc3d
import h5py
import numpy as np
import openpyxl
import polars
import pyuff
from asammdf import MDF, Signal
from nptdms import ChannelObject, TdmsWriter
from scipy.io import savemat, wavfile

from . import robots

TIME = np.arange(200) / 64
WAVE = np.cos(TIME * 9)


def csv(path):
    """Comma-separated."""
    path.write_text("Time (s),F [N]\n" + "".join(f"{t:.6f},{x:.6f}\n" for t, x in zip(TIME, WAVE, strict=True)))


def times(path):
    """Date and time of day in two columns through midnight, and marks of thousands."""
    stamps = [f"{7 + i // 100:02d}.03.2024;{'23:59:59' if i < 100 else '00:00:00'}.{i % 100:02d}" for i in range(200)]
    values = [f"{1000 * x:,.2f}".replace(",", " ") for x in WAVE * 3]
    path.write_text("Date;Time;F [N]\n" + "".join(f"{s};{x}\n" for s, x in zip(stamps, values, strict=True)))


def forces(path):
    """Cortex."""
    rows = "".join(f"{i}\t{x:.2f}\t0.00\t\n" for i, x in enumerate(WAVE, 1))
    head = "[Force Data]\nNumberOfForcePlates=1\nSampleRate=64\nNumberOfSamples=200\n#Sample\tFX1\tFY1\t\n"
    path.write_text(head + rows)


def lvm(path):
    """LabVIEW."""
    head = "LabVIEW Measurement\t\nSeparator\tTab\nX_Columns\tNo\n***End_of_Header***\t\n\t\n"
    head += "Channels\t2\t\t\nSamples\t200\t200\t\nY_Unit_Label\tN\tV\t\nX_Dimension\tTime\tTime\t\n"
    head += "X0\t0\t0\t\nDelta_X\t0.015625\t0.015625\t\n***End_of_Header***\t\t\t\nX_Value\tF\tu\tComment\n"
    path.write_text(head + "".join(f"\t{x:.6f}\t{-x:.6f}\n" for x in WAVE))


def uff(path):
    """Text and binary functions."""
    for binary in (0, 1):
        fields = {
            "type": 58, "binary": binary, "func_type": 1, "id1": f"acc {binary}", "rsp_node": binary, "rsp_dir": 1,
            "ref_node": 0, "ref_dir": 0, "data": WAVE, "x": TIME, "ord_data_type": 4, "abscissa_spacing": 1,
            "abscissa_spec_data_type": 17, "ordinate_spec_data_type": 12, "orddenom_spec_data_type": 0,
        }  # fmt: skip
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ResourceWarning)
            pyuff.UFF(str(path)).write_sets(fields, "add")
            gc.collect(1)


def mat5(path):
    """Plain arrays and a structure."""
    savemat(path, {"t": TIME, "a": WAVE, "s": {"x": np.ones((30, 2)), "name": "hip"}, "z": WAVE[:40] * 1j, "fs": 64.0})


def mat5_packed(path):
    """The same, compressed."""
    savemat(path, {"t": TIME, "a": WAVE, "m": np.ones((30, 3))}, do_compression=True)


def mat4(path):
    """Version 4, of doubles, integers, a text and a rate."""
    variables = {"t": TIME, "a": WAVE, "n": np.arange(200, dtype="i2"), "name": "hip", "z": WAVE[:40] * 1j, "fs": 64.0}
    savemat(path, variables, format="4")


def tdms(path):
    """Several segments, a scale, timestamps."""
    scale = {"NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": "Linear", "NI_Scale[0]_Linear_Slope": 2.0,
             "NI_Scale[0]_Linear_Y_Intercept": 1.0, "NI_Scale[0]_Linear_Input_Source": 0xFFFFFFFF}  # fmt: skip
    with TdmsWriter(path) as writer:
        for i in range(0, 200, 50):
            stamps = np.datetime64("2026-11-21", "us") + np.arange(i, i + 50) * np.timedelta64(15625, "us")
            writer.write_segment([
                ChannelObject("g", "Time", stamps), ChannelObject("g", "a", WAVE[i : i + 50]),
                ChannelObject("g", "b", np.arange(50, dtype="i2"), scale), ChannelObject("g", "s", ["x"] * 50),
            ])  # fmt: skip


def mdf(path, version="4.10", compression=0):
    """Two groups, a law, bits."""
    with MDF(version=version) as file:
        file.append([Signal(WAVE, TIME, name="a", unit="N"), Signal((TIME * 9).astype("u1"), TIME, name="n")])
        file.append([Signal(np.arange(9, dtype="i2"), np.arange(9.0), name="b", conversion={"a": 0.5, "b": 1.0})])
        file.save(path, overwrite=True, compression=compression)


def mdf3(path):
    """Version 3."""
    mdf(path, "3.30")


def mdf_packed(path):
    """Compressed."""
    mdf(path, "4.10", 2)


def c3d(path):
    """Points and analog channels."""
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [64.0]
    file["parameters"]["POINT"]["LABELS"]["value"] = ["knee"]
    file["parameters"]["ANALOG"]["RATE"]["value"] = [128.0]
    file["parameters"]["ANALOG"]["LABELS"]["value"] = ["Fx", "Fz"]
    file["data"]["points"] = np.ones((4, 1, 50))
    file["data"]["analogs"] = np.arange(200.0).reshape(1, 2, 100)
    file.write(str(path))


def wav(path):
    """Integers of 16 bits."""
    wavfile.write(path, 64, (WAVE * 1000).astype("i2"))


def parquet(path):
    """Floats and integers."""
    polars.DataFrame({"Time (s)": TIME, "a": WAVE, "n": range(200)}).write_parquet(path)


def hdf5(path):
    """Groups, chunks, links."""
    with h5py.File(path, "w") as file:
        file["daq/time"], file["daq/a"] = TIME, WAVE
        file.create_dataset("b", data=np.arange(60).reshape(20, 3), chunks=(7, 3), compression="gzip", fletcher32=True)
        file["daq/a"].attrs["unit"], file["soft"] = "N", h5py.SoftLink("/daq")


def mat73(path):
    """MATLAB 7.3."""
    with h5py.File(path, "w", userblock_size=512) as file:
        file["x"] = WAVE[None, :]
        file["x"].attrs["MATLAB_class"] = np.bytes_("double")
    raw = bytearray(path.read_bytes())
    raw[:128] = b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM"
    path.write_bytes(raw)


def mcap(path):
    """Messages of ROS 2 and JSON."""
    robots.mcap(path, extra=robots.json_topic)


def bag(path):
    """Messages of ROS 1."""
    robots.bag(path)


def ros2_bag(path):
    """Messages of ROS 2."""
    robots.ros2_bag(path)


def ulog(path, rows=range(200), formats=("imu:uint64_t timestamp;float[2] a;char[8] state;uint8_t[4] _padding0;",)):
    """ULog by its published layout: information, a parameter, two instances of a topic, a message, a dropout."""

    def keyed(key, value):
        return bytes([len(key)]) + key.encode() + value

    def imu(number, i):
        sample = struct.pack("<Qff8s", 15625 * (i + 64), WAVE[i], -WAVE[i], b"armed" if i > 99 else b"idle")
        return b"D", struct.pack("<H", number) + sample

    messages = [(b"B", bytes(40)), *((b"F", text.encode()) for text in formats)]
    messages += [(b"I", keyed("char[5] sys_name", b"bench")), (b"P", keyed("float gain", struct.pack("<f", 0.5)))]
    messages += [(b"A", struct.pack("<BH", n, n) + b"imu") for n in (0, 1)]
    messages += [imu(n, i) for i in rows for n in (0, 1)]
    messages += [(b"L", b"6" + struct.pack("<Q", 9) + b"take-off"), (b"O", struct.pack("<H", 20))]
    body = b"".join(struct.pack("<Hc", len(text), kind) + text for kind, text in messages)
    path.write_bytes(b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 1) + body)


def xlsx(path):
    """A sheet of numbers, a text and a formula, and one of notes."""
    book = openpyxl.Workbook()
    sheet, book["Sheet"].title = book.create_sheet("Run 1", 0), "Notes"
    sheet.append(["Time (s)", "F [N]", "State", "Twice"])
    for i, (t, x) in enumerate(zip(TIME, WAVE, strict=True)):
        sheet.append([t, x, "moving" if i > 99 else "still", f"=2*B{i + 2}"])
    book["Notes"]["B2"] = "bench 2"
    book.save(path)


IN_PROCESS = {
    "run.csv": csv, "run.forces": forces, "run.lvm": lvm, "run.uff": uff, "run.tdms": tdms, "run.mf4": mdf,
    "run.mdf": mdf3, "packed.mf4": mdf_packed, "run.c3d": c3d, "run.wav": wav, "times.csv": times,
}  # fmt: skip
ISOLATED = {
    "run.parquet": parquet,
    "run.h5": hdf5,
    "new.mat": mat73,
    "run.mat": mat5,
    "packed.mat": mat5_packed,
    "old.mat": mat4,
    "run.mcap": mcap,
    "run.bag": bag,
    "run.db3": ros2_bag,
    "run.ulg": ulog,
    "run.xlsx": xlsx,
}
ALL = IN_PROCESS | ISOLATED


def make(folder, name):
    """The example called ``name``, in ``folder``."""
    path = folder / name
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        ALL[name](path)
    return path
