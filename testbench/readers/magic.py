"""First bytes of formats that are not text, so that a refused file can be called by its name."""

_MAGIC = {
    b"PK\x03\x04": "a ZIP archive",
    b"\x1f\x8b": "gzip-compressed",
    b"7z\xbc\xaf\x27\x1c": "a 7-Zip archive",
    b"Rar!": "a RAR archive",
    b"BZh": "bzip2-compressed",
    b"\xfd7zXZ": "xz-compressed",
    b"\x28\xb5\x2f\xfd": "zstd-compressed",
    b"%PDF": "a PDF document",
    b"\xd0\xcf\x11\xe0": "an old Office document (perhaps an .xls workbook)",
    b"\x89HDF": "HDF5",
    b"CDF\x01": "netCDF 3",
    b"CDF\x02": "netCDF 3",
    b"CDF\x05": "netCDF 3",
    b"TDSm": "NI TDMS",
    b"MDF     ": "ASAM MDF",
    b"UnFinMF ": "an unfinished ASAM MDF",
    b"MATLAB 5.0": "MATLAB v5",
    b"PAR1": "Parquet",
    b"ARROW1": "Arrow",
    b"RIFF": "WAV",
    b"SQLite format 3": "an SQLite database",
    b"\x89PNG": "a PNG image",
    b"\x1aE\xdf\xa3": "EBML, such as an enDAQ IDE recording",
    b"\x89MCAP": "MCAP",
    b"#ROSBAG": "a ROS 1 bag",
    b"LabVIEW Measurement": "LabVIEW LVM",
}


_WORKBOOK = (b"[Content_Types].xml", b"xl/", b"_rels/.rels")
_TO_DO = {
    "an .xlsx workbook": "save its sheet as CSV",
    "an old Office document (perhaps an .xls workbook)": "save its sheet as CSV",
    "netCDF 3": "convert it by `nccopy -k nc4`",
    "a ZIP archive": "unpack it and give the log inside",
    "gzip-compressed": "unpack it and give the log inside",
    "a 7-Zip archive": "unpack it and give the log inside",
    "a RAR archive": "unpack it and give the log inside",
    "bzip2-compressed": "unpack it and give the log inside",
    "xz-compressed": "unpack it and give the log inside",
    "zstd-compressed": "unpack it and give the log inside",
}


def to_do(kind: str | None) -> str:
    """What a person can do with a file of a kind that is not read; empty if nothing is known."""
    return _TO_DO.get(kind or "", "")


def known_as(head: bytes) -> str | None:
    """The name of the format that begins with these bytes, if it is one of the above."""
    if head.startswith(b"PK\x03\x04") and any(part in head for part in _WORKBOOK):
        return "an .xlsx workbook"
    for magic, name in _MAGIC.items():
        if head.startswith(magic):
            return name
    return None
