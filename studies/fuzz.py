"""Coverage-guided fuzzing of every reader and every input file: read or refused, within 10 s and 1 GB.

By atheris, which is libFuzzer (``pip install --group fuzz``). The seeds are the small files of the tests and the
shipped ones; what reaches new code is kept in ``--corpus FOLDER``, and begun with the next time; inputs are counted
over all runs with that folder. What libFuzzer stops at is read again as a user would, in a process of its own: readers
of foreign libraries crash where nobody minds.
"""

import os
import re
import resource
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from importlib import import_module
from operator import attrgetter
from pathlib import Path

from .table import Row, all_of

LONGEST_S, MOST_MEMORY_MB = 10, 1024
LONGEST_INPUT = 1 << 10
"""Or as long as the longest seed [bytes]: what is short is read quickly."""
_MEMORY = Path("/dev/shm")
"""Inputs are files in memory where the system has such."""
_ELEMENTS = 12 << 10
"""Of a recording that is read by its first elements [bytes]."""
STOPS = 20
"""So often is a format gone on with after an input at which libFuzzer stopped."""
INPUT_FILES = {
    "mechanism.xml": ("balance.mechanism.mjcf_parser:load_mechanism", "datasets/mechanisms/*.xml"),
    "mechanism.urdf": ("balance.mechanism.mjcf_parser:load_mechanism", "datasets/robots/*.urdf"),
    "mechanism.sdf": ("balance.mechanism.mjcf_parser:load_mechanism", """
<sdf version="1.7"><model name="m"><pose>0.1 0 0 0 0 0</pose>
<link name="a"><inertial><mass>1</mass><inertia><ixx>1e-3</ixx><iyy>1e-3</iyy><izz>1e-3</izz></inertia>
</inertial></link><joint name="j" type="revolute"><parent>world</parent><child>a</child><axis><xyz>0 0 1</xyz></axis>
</joint></model></sdf>"""),
    "motion.toml": ("balance.motion.motion_files:load_motion", "datasets/motions/*.toml"),
    "plates.csv": ("balance.balancing.stock_plates:load_stock", "datasets/stock/*.csv"),
    "materials.toml": ("balance.balancing.stock_plates:load_densities", "datasets/materials/*.toml"),
    "engine.toml": ("balance.engines.engine_files:load_engine", "datasets/engines/*.toml"),
    "linkage.toml": ("balance.linkages.linkage_files:load_linkage", "datasets/linkages/*.toml"),
    "drive.toml": ("balance.drives.drive_files:load_drive", "datasets/drives/*.toml"),
    "rotor.toml": ("balance.rotors.rotor_files:load_rotor", "datasets/rotors/three*.toml"),
    "unbalances.csv": ("balance.rotors.rotor_files:load_unbalances", "datasets/rotors/*.csv"),
    "trial-runs.toml": ("balance.rotors.trial_runs:load_trial_runs", "datasets/rotors/*.toml"),
    "rig.toml": ("testbench.rig.rig:load_rig", "datasets/rigs/*.toml"),
    "runs.csv": ("testbench.ingestion.run_table:read_run_table", """
file,run,origin,payload_kg,counter_masses,motion,repeat
a.csv,r001,measured,5,counter_A0A=24.2626;counter_B0B=24.2626,x,1
b.csv,r002,simulated,,,y,2
"""),
    "plan.toml": ("testbench.campaign_plan:load_plan", "datasets/plans/*.toml"),
    "logger.toml": ("testbench.readers.import_description:ImportDescription.load", "datasets/loggers/*.toml"),
    "sheet.xml": ("studies.reader_faults:read_as_sheet", """
<worksheet xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main">
<cols><col min="2" max="2" hidden="1"/></cols><sheetData>
<row r="1"><c r="A1" t="s"><v>0</v></c><c r="B1" t="s"><v>1</v></c></row>
<row r="2"><c r="A2" t="inlineStr"><is><t>t</t></is></c><c r="B2" t="str"><f>A2</f><v>x</v></c><c r="C2"><v>y</v>
</c></row>
<row r="3" hidden="1"><c r="A3" s="4"><v>45352.5</v></c><c r="B3" t="e"><v>#N/A</v></c><c r="C3"><f>A3*2</f></c></row>
<row r="4"><c r="A4" s="4"><v>45352.75</v></c><c r="B4"><v>1E-3</v></c><c r="C4" s="3"><v>0.25</v></c></row>
</sheetData><mergeCells count="1"><mergeCell ref="B1:C1"/></mergeCells></worksheet>"""),
    "published.json": ("testbench.published_tables:load_published", "datasets/published/*.json"),
    "certificate.xml": ("testbench.calibration.certificate:read_certificate", """
<?xml version="1.0" encoding="UTF-8"?>
<dcc:digitalCalibrationCertificate xmlns:dcc="https://ptb.de/dcc" xmlns:si="https://ptb.de/si" schemaVersion="3.3.0">
<dcc:administrativeData><dcc:coreData><dcc:uniqueIdentifier>K-1</dcc:uniqueIdentifier><dcc:beginPerformanceDate>
2026-03-30</dcc:beginPerformanceDate></dcc:coreData></dcc:administrativeData><dcc:measurementResults>
<dcc:measurementResult><dcc:results><dcc:result><dcc:data><dcc:list><dcc:quantity><dcc:name><dcc:content>Sensitivity
</dcc:content></dcc:name><si:real><si:value>1e-2</si:value><si:unit>\\volt</si:unit></si:real></dcc:quantity>
</dcc:list></dcc:data></dcc:result></dcc:results></dcc:measurementResult></dcc:measurementResults>
</dcc:digitalCalibrationCertificate>"""),
}  # fmt: skip
"""What reads each, and its seeds: files of the checkout, or a text."""


def study(count: int, brief: bool) -> Iterator[Row]:
    """``count`` inputs of each kind of file."""
    from .reader_faults import _examples

    corpus = Path(os.environ["COUNTERPOISE_CORPUS"])
    with tempfile.TemporaryDirectory() as temporary:
        kinds = [(name, [_first_lines(content)]) for name, content in _examples(Path(temporary))]
        kinds += [("run.ide", [seed]) for seed in _of_a_recorder(Path(temporary, "head.ide"))]
        kinds += [(name, _seeds(place)) for name, (_, place) in INPUT_FILES.items()]
    for name, seeds in kinds:
        folder = corpus / name
        folder.mkdir(parents=True, exist_ok=True)
        for number, seed in enumerate(seeds):
            (folder / f"seed-{number}").write_bytes(seed)
        yield _fuzzed(name, folder, count)


def _first_lines(content: bytes) -> bytes:
    """Of a text: an input that is short is read quickly."""
    return content if b"\0" in content else b"".join(content.splitlines(keepends=True)[:12])


def _of_a_recorder(head: Path) -> list[bytes]:
    """The first elements of the smallest public recording of enDAQ, of whose format nobody has a writer.

    The process that fuzzes imports the reader anew, instrumented.
    """
    recordings = import_module("testbench.public_recordings").folder()
    reader, source = import_module("testbench.readers.endaq_ide"), import_module("testbench.readers.byte_source")
    for path in sorted(recordings.rglob("*.[iI][dD][eE]"), key=lambda path: path.stat().st_size)[:1]:
        head.write_bytes(path.read_bytes()[:_ELEMENTS])
        with source.ByteSource(head) as opened:
            return [head.read_bytes()[: reader.whole_elements(opened)[0]]]
    return []


def _seeds(place: str) -> list[bytes]:
    files = [] if "\n" in place else sorted(Path(__file__).parents[1].glob(place))
    return [path.read_bytes() for path in files] or [place.lstrip().encode()]


def _fuzzed(name: str, folder: Path, count: int) -> Row:
    counted, before = folder.with_name(f"{name}.count"), sorted((folder.parent / "stopped").glob(f"*-{name}"))
    found = [said for kept in before if (said := _judged(name, kept))]  # what stopped it once must not again
    done = int(counted.read_text()) if counted.exists() else 0
    longest = max(LONGEST_INPUT, *(path.stat().st_size for path in folder.glob("seed-*")))
    for _ in range(STOPS):
        if done >= count:
            break
        with tempfile.TemporaryDirectory(dir=_MEMORY if _MEMORY.is_dir() else None) as work:
            (stopped := Path(work, "stopped")).mkdir()
            limits = [f"-runs={count - done}", f"-timeout={LONGEST_S}", f"-rss_limit_mb={MOST_MEMORY_MB}",
                      f"-max_len={longest}", f"-seed={done + 1}", f"-artifact_prefix={stopped}/",
                      "-entropic_scale_per_exec_time=1"]  # fmt: skip
            ended = _run("fuzz", name, str(folder), work, "-print_final_stats=1", *limits)
            if (units := re.search(rb"stat::number_of_executed_units: (\d+)", ended.stderr)) is None:
                raise RuntimeError(f"{name}: libFuzzer did not begin or was killed: {ended.stderr[-2000:].decode()}")
            done += int(units[1])
            counted.write_text(f"{done}")
            for file in stopped.iterdir():
                (folder.parent / "stopped").mkdir(exist_ok=True)
                shutil.move(file, kept := folder.parent / "stopped" / f"{file.name}-{name}")
                if said := _judged(name, kept):
                    found.append(said)
    size = sum(1 for _ in folder.iterdir())
    note = "; ".join([f"{size} inputs kept, each of which reached something new", *found[:3]])
    return all_of(f"{name}, inputs read or refused within {LONGEST_S} s and {MOST_MEMORY_MB} MB",
                  done - len(found), done, note)  # fmt: skip


def _judged(name: str, kept: Path) -> str:
    """What is wrong where a user reads an input; empty if it is read or refused."""
    with tempfile.TemporaryDirectory() as work:
        judged = _run("judge", name, str(kept), work)
    return f"{kept.name}: {judged.stderr.decode().splitlines()[-1:] or judged.returncode}" if judged.returncode else ""


def _run(*arguments: str) -> subprocess.CompletedProcess[bytes]:
    return subprocess.run([sys.executable, "-m", f"{__package__}.fuzz", *arguments], capture_output=True, check=False)


def _reading(name: str) -> Callable[[Path], None]:
    if name not in INPUT_FILES:
        return import_module("studies.reader_faults").read_or_refused
    module, _, function = INPUT_FILES[name][0].partition(":")
    load = attrgetter(function)(import_module(module))
    refusal = import_module("balance.errors").CounterpoiseError

    def read(path: Path) -> None:
        with suppress(refusal):
            load(path)

    return read


def main(what: str, name: str, place: str, work: str, *limits: str) -> None:
    """``fuzz`` a kind of file with the corpus ``place``; or ``judge`` one, as a user would read it; in ``work``."""
    if what == "judge":
        resource.setrlimit(resource.RLIMIT_CPU, (LONGEST_S, LONGEST_S))
        read = _reading(name)
        read(Path(shutil.copy(place, Path(work, name))))
        largest = max(resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
        assert largest < MOST_MEMORY_MB << 10, f"took {largest >> 10} MB"
        spent = sum(os.times()[:4])  # a process that reads apart ends at the limit too, and is said to be refused
        assert spent < LONGEST_S, f"took {spent:.0f} s"
        return
    import atheris

    path = Path(work, name)
    with atheris.instrument_imports(
        include=["balance", "testbench", "mcap", "rosbags", "tomllib", "idelib", "ebmlite", "pyulog", "openpyxl"]
    ):
        read = _reading(name)
        registry, faults = import_module("testbench.readers.registry"), import_module("studies.reader_faults")
        registry.open_in_subprocess = faults.open_here  # type: ignore[attr-defined]
        import_module("testbench.readers.xlsx").answer_in_subprocess = faults.answer_here  # type: ignore[attr-defined]
        for seed in Path(place).glob("seed-*"):
            read(Path(shutil.copy(seed, path)))  # modules are imported late
    pages = int(Path("/proc/self/statm").read_text().split()[0]) + (MOST_MEMORY_MB << 20) // resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize(),) * 2)

    def one(content: bytes) -> None:
        path.write_bytes(content)
        read(path)

    atheris.Setup([sys.argv[0], place, *limits], one)
    atheris.Fuzz()


if __name__ == "__main__":
    main(*sys.argv[1:])
