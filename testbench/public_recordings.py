"""Public recordings of other people, found by name: in a folder of the user's, in the cache, or else fetched.

Nothing of them is shipped. ``datasets/recordings.toml`` says where each lies, under which licence, with which SHA-256;
a file that has another digest is refused, wherever it came from.
"""

import hashlib
import http.client
import io
import os
import tempfile
import tomllib
import urllib.error
import urllib.parse
import urllib.request
import zipfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import IO, Annotated

from balance import datasets, user_cache
from balance.results import Key

from .errors import RecordingError

FOLDER_VARIABLE = "COUNTERPOISE_RECORDINGS"
"""Environment variable: a folder that holds the recordings and takes the place of the network."""
RAW = "https://raw.githubusercontent.com"
"""Where a public repository's files are had, as ``RAW/owner/name/commit/path``."""
TIMEOUT_S = 30.0


@dataclass(frozen=True)
class PublicRecording:
    """One file of a public repository at one commit."""

    file: Annotated[str, Key("", "file")]
    what: Annotated[str, Key("", "what")]
    repository: str
    """``owner/name`` on github.com."""
    path: str
    commit: str
    licence: Annotated[str, Key()]
    licence_file: str
    sha256: Annotated[str, Key()]
    """Of the file; where ``member`` is given, of that member of the archive at ``path``."""
    bytes: Annotated[int, Key("", "size", lambda size: f"{size / 1e3:.0f} kB")]
    member: Annotated[str | None, Key()] = None

    @property
    def url(self) -> Annotated[str, Key()]:
        """Where the file is fetched from."""
        return f"{RAW}/{self.repository}/{self.commit}/{urllib.parse.quote(self.path)}"

    @property
    def credit(self) -> Annotated[str, Key(None, "source and licence")]:
        """Source and licence, to be shown with the data."""
        inside = f" ({self.member})" if self.member else ""
        return f"github.com/{self.repository}: {self.path}{inside} at {self.commit[:12]}, {self.licence}"


@cache
def recordings_by_file() -> dict[str, PublicRecording]:
    """The known recordings by file name."""
    table = tomllib.loads((datasets.ROOT / "recordings.toml").read_text(encoding="utf-8"))
    return {row["file"]: PublicRecording(**row) for row in table["recording"]}


def recording_named(name: str) -> PublicRecording:
    """The recording of this file name, or the only one whose name starts so. Raises RecordingError, listing them."""
    known = recordings_by_file()
    starting = [name] if name in known else [file for file in known if name and file.startswith(name)]
    if len(starting) != 1:
        raise RecordingError(f"{name!r} names no public recording, or several: there are {', '.join(known)}")
    return known[starting[0]]


def local_recording(name: str) -> Path | None:
    """A recording's file if it can be had without the network, else None."""
    recording = recording_named(name)
    path = folder() / recording.file
    return checked(path, recording) if path.is_file() else None


def checked(path: Path, recording: PublicRecording) -> Path:
    """``path``, if its content is the recording's. Raises RecordingError otherwise."""
    with path.open("rb") as stream:
        _check(stream.read(recording.bytes + 1), recording, str(path))
    return path


def fetch(recording: PublicRecording, into: Path | None = None) -> Path:
    """Get a recording into a folder, or the cache: from its source, or the folder of ``COUNTERPOISE_RECORDINGS``.

    Raises RecordingError, saying how else to provide it; nothing is written unless the content is the recording's.
    """
    own = _own_folder()
    if own is None:
        _check(content := _downloaded(recording), recording, recording.url)
    elif (own / recording.file).is_file():
        content = checked(own / recording.file, recording).read_bytes()
    else:
        raise RecordingError(
            f"{recording.file}: not in {own} ({FOLDER_VARIABLE}); put it there, or unset the variable to fetch it "
            f"from {recording.credit}"
        )
    path = (into or cache_folder()) / recording.file
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as part:
        part.write(content)
    Path(part.name).replace(path)
    return path


def folder() -> Path:
    """Where recordings are looked for: the folder of ``COUNTERPOISE_RECORDINGS``, else the cache."""
    return _own_folder() or cache_folder()


def cache_folder() -> Path:
    """Where fetched recordings are kept."""
    return user_cache.cache_folder() / "recordings"


class _OnlyHttps(urllib.request.HTTPRedirectHandler):
    """Follows redirections to https alone."""

    def redirect_request(
        self,
        req: urllib.request.Request,
        fp: IO[bytes],
        code: int,
        msg: str,
        headers: http.client.HTTPMessage,
        newurl: str,
    ) -> urllib.request.Request | None:
        if not newurl.startswith("https://"):
            raise urllib.error.URLError(f"redirected to {newurl}, which is not https")
        return super().redirect_request(req, fp, code, msg, headers, newurl)


def _own_folder() -> Path | None:
    folder = os.environ.get(FOLDER_VARIABLE)
    if not folder:
        return None
    if not Path(folder).is_dir():
        raise RecordingError(f"{FOLDER_VARIABLE} names {folder}, which is no folder")
    return Path(folder)


def _downloaded(recording: PublicRecording) -> bytes:
    """What its source answers, one byte more than expected at most, so that no answer fills the memory."""
    expected = recording.bytes + 1
    try:
        with urllib.request.build_opener(_OnlyHttps()).open(recording.url, timeout=TIMEOUT_S) as answer:
            content: bytes = answer.read(expected)
    except (urllib.error.URLError, http.client.HTTPException, TimeoutError, ConnectionError) as error:
        raise RecordingError(
            f"{recording.file}: cannot be fetched from {recording.url}: {error}; or name a folder that holds it in "
            f"{FOLDER_VARIABLE}"
        ) from error
    if recording.member is None:
        return content
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as files, files.open(recording.member) as stream:
            return stream.read(expected)
    except (zipfile.BadZipFile, KeyError, RuntimeError) as error:  # RuntimeError: encrypted, or an unknown packing
        raise RecordingError(f"{recording.url}: not a zip archive that holds {recording.member}: {error}") from error


def _check(content: bytes, recording: PublicRecording, where: str) -> None:
    digest = hashlib.sha256(content).hexdigest()
    if digest != recording.sha256:
        size = f"{len(content)}" if len(content) <= recording.bytes else f"more than {recording.bytes}"
        raise RecordingError(
            f"{where}: not {recording.file}: {size} bytes with SHA-256 {digest[:12]}..., expected {recording.bytes} "
            f"with {recording.sha256[:12]}... (from {recording.credit})"
        )
