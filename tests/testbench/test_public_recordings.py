"""Public recordings: found without the network where they are at hand, fetched whole, refused when they differ."""

import hashlib
import http.server
import io
import json
import os
import threading
import zipfile
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner

from testbench import public_recordings
from testbench.cli.recordings import recordings as commands
from testbench.errors import RecordingError

CONTENT = b"time,pos1\n0.0,0.1\n"


class _Repository(http.server.BaseHTTPRequestHandler):
    """Serves ``files`` by path; anything else is not found."""

    files: dict[str, bytes]

    def do_GET(self):
        content = self.files.get(self.path)
        self.send_response(404 if content is None else 200)
        self.end_headers()
        self.wfile.write(content or b"")

    def log_message(self, *args):
        """Say nothing."""


@pytest.fixture
def repository(monkeypatch, tmp_path):
    """A repository on the loopback interface, an empty cache, and one recording in it."""
    _Repository.files = {"/someone/arm/abc/logs/run%20%231.csv": CONTENT}
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), _Repository)
    threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
    monkeypatch.setattr(public_recordings, "RAW", f"http://127.0.0.1:{server.server_port}")
    monkeypatch.setattr(public_recordings, "recordings_by_file", lambda: {RECORDING.file: RECORDING})
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv("LOCALAPPDATA", str(tmp_path))
    monkeypatch.delenv(public_recordings.FOLDER_VARIABLE, raising=False)
    yield _Repository.files
    server.shutdown()
    server.server_close()


RECORDING = public_recordings.PublicRecording(
    "run.csv", "a log", "someone/arm", "logs/run #1.csv", "abc", "MIT", "LICENSE",
    hashlib.sha256(CONTENT).hexdigest(), len(CONTENT),
)  # fmt: skip


def found(name):
    """The file that is at hand, else fetched."""
    return public_recordings.local_recording(name) or public_recordings.fetch(public_recordings.recording_named(name))


def test_fetched_once_then_from_the_cache(repository):
    """A recording is fetched, its name quoted, kept whole, and found again when the repository is gone."""
    assert public_recordings.local_recording("run.csv") is None
    path = found("run.csv")
    repository.clear()
    assert path.read_bytes() == CONTENT
    assert found("run.csv") == public_recordings.local_recording("run.csv") == path
    assert [p.name for p in path.parent.iterdir()] == ["run.csv"]


@pytest.mark.parametrize("served", [CONTENT[:-1], CONTENT + b"x" * 100, b"?" * len(CONTENT)])
def test_other_content_is_refused(repository, served):
    """A shorter, longer or changed file is refused with both digests, and nothing is kept."""
    repository["/someone/arm/abc/logs/run%20%231.csv"] = served
    with pytest.raises(RecordingError, match=f"expected {len(CONTENT)} with {RECORDING.sha256[:12]}"):
        found("run.csv")
    assert public_recordings.local_recording("run.csv") is None


def test_a_changed_file_of_the_cache_is_refused(repository):
    """The cache is not trusted: a changed file is refused, with its place."""
    path = found("run.csv")
    path.write_bytes(CONTENT + b"1,2\n")
    with pytest.raises(RecordingError, match="expected 18 with"):
        found("run.csv")


def test_missing_says_where_from_and_what_else(repository):
    """A file that is not there: its address, and the variable that names a folder instead."""
    repository.clear()
    with pytest.raises(RecordingError, match=r"127\.0\.0\.1.*404.*COUNTERPOISE_RECORDINGS"):
        found("run.csv")


def test_a_folder_takes_the_place_of_the_network(repository, monkeypatch, tmp_path):
    """With the variable set nothing is fetched: the file is found there, or the message says to put it there."""
    monkeypatch.setenv(public_recordings.FOLDER_VARIABLE, str(tmp_path))
    with pytest.raises(RecordingError, match="put it there"):
        found("run.csv")
    (tmp_path / "run.csv").write_bytes(CONTENT)
    assert found("run.csv") == tmp_path / "run.csv"
    monkeypatch.setenv(public_recordings.FOLDER_VARIABLE, str(tmp_path / "nowhere"))
    with pytest.raises(RecordingError, match="no folder"):
        found("run.csv")


def test_member_of_an_archive(repository, monkeypatch):
    """Where the repository holds an archive, its member is what is kept and whose digest counts."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("run.csv", CONTENT * 1000)
    inside = replace(
        RECORDING, path="run.zip", member="run.csv", sha256=hashlib.sha256(CONTENT * 1000).hexdigest(),
        bytes=len(CONTENT) * 1000,
    )  # fmt: skip
    repository["/someone/arm/abc/run.zip"] = packed.getvalue()
    assert public_recordings.fetch(inside).read_bytes() == CONTENT * 1000
    repository["/someone/arm/abc/run.zip"] = b"no archive"
    with pytest.raises(RecordingError, match="not a zip archive"):
        public_recordings.fetch(inside)


def test_redirection_to_plain_http_is_refused():
    """A redirection that leaves https is not followed."""
    with pytest.raises(OSError, match="not https"):
        public_recordings._OnlyHttps().redirect_request(None, None, 302, "", {}, "http://example.org/run.csv")


def test_registry_is_complete():
    """Twenty files, each of one commit, with licence, size and digest; a name may be shortened while unique."""
    known = public_recordings.recordings_by_file()
    assert len(known) == 20
    for recording in known.values():
        assert len(recording.commit) == 40
        assert len(recording.sha256) == 64
        assert recording.bytes > 0
        assert recording.licence
        assert recording.url.startswith(f"https://raw.githubusercontent.com/{recording.repository}/{recording.commit}/")
    assert public_recordings.recording_named("09") is known["09_double_pendulum_A0_061705.csv"]
    for wrong in ("", "0", "no such"):
        with pytest.raises(RecordingError, match="there are 01_loadcell_wagon55"):
            public_recordings.recording_named(wrong)


@pytest.mark.recordings
def test_recordings_at_hand_are_those_of_the_registry():
    """Every recording in the folder that the environment names has the registered content; one's own may lack some."""
    folder = Path(os.environ[public_recordings.FOLDER_VARIABLE])
    there = [name for name in public_recordings.recordings_by_file() if (folder / name).is_file()]
    assert len(there) >= 14
    for name in there:
        assert found(name) == folder / name


@pytest.fixture
def fetch():
    """The command: exit code and what it prints."""

    def run(*words):
        result = CliRunner().invoke(commands, ["fetch", *map(str, words)], standalone_mode=False)
        assert result.exception is None, result.exception
        return result.return_value, result.stdout

    return run


def test_the_command_fetches_and_says_how_to_use(repository, fetch, tmp_path):
    """One line a file with its licence, whole in the folder, and the variable to set; the second time it is present."""
    code, text = fetch("--to", tmp_path / "logs")
    assert code == 0
    assert text.startswith(f"run.csv: fetched: {len(CONTENT)} bytes, SHA-256")
    assert "MIT" in text.splitlines()[0]
    assert f"COUNTERPOISE_RECORDINGS={tmp_path / 'logs'}" in text
    assert (tmp_path / "logs" / "run.csv").read_bytes() == CONTENT
    repository.clear()
    assert fetch("run", "--to", tmp_path / "logs")[1].startswith("run.csv: present")


def test_the_command_refuses_what_differs(repository, fetch, tmp_path):
    """Another content is not written, and what lies there is not overwritten; exit code 1."""
    repository["/someone/arm/abc/logs/run%20%231.csv"] = CONTENT + b"more\n"
    code, text = fetch("--to", tmp_path / "logs")
    assert code == 1
    assert text.startswith("run.csv: refused: http://127.0.0.1")
    assert not (tmp_path / "logs").exists()
    (tmp_path / "run.csv").write_bytes(b"mine\n")
    assert fetch("--to", tmp_path)[0] == 1
    assert (tmp_path / "run.csv").read_bytes() == b"mine\n"


def test_the_command_copies_from_a_folder(repository, fetch, monkeypatch, tmp_path):
    """Files are copied from the folder of the variable, verified; without --to they are checked where they lie."""
    repository.clear()
    (tmp_path / "mine").mkdir()
    monkeypatch.setenv(public_recordings.FOLDER_VARIABLE, str(tmp_path / "mine"))
    code, text = fetch("--to", tmp_path / "logs", "--json")
    assert code == 1
    assert json.loads(text)["recordings"][0]["status"] == "refused"
    (tmp_path / "mine" / "run.csv").write_bytes(CONTENT)
    assert fetch("--to", tmp_path / "logs")[0] == 0
    assert (tmp_path / "logs" / "run.csv").read_bytes() == CONTENT
    assert fetch()[1].startswith("run.csv: present")
    (tmp_path / "mine" / "run.csv").write_bytes(CONTENT[:-1])
    assert fetch("--to", tmp_path / "others")[0] == 1


def test_the_command_lists_source_and_licence():
    """Every recording of the registry, with what identifies it."""
    result = CliRunner().invoke(commands, ["list", "--json"], standalone_mode=False)
    listed = json.loads(result.stdout)["recordings"]
    assert [one["file"] for one in listed] == list(public_recordings.recordings_by_file())
    assert all(one["licence"] and len(one["sha256"]) == 64 and one["url"].startswith("https://") for one in listed)
