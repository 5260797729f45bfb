"""The compiled loop over rows: kept in the user's cache, and compiled once in a process of its own.

What is kept holds machine code for this processor and no link to numba, which need not be imported to run it.
"""

import ctypes
import hashlib
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

SOURCE = Path(__file__).with_name("kernel.py")
ENTRY = "rows"
_BYTES, _INTEGER, _BYTE = ctypes.c_void_p, ctypes.c_int64, ctypes.c_uint8
_ARGUMENTS = (_BYTES, _INTEGER, _BYTE, _BYTE, _BYTES, _INTEGER, _BYTES, _INTEGER, _BYTES, _INTEGER, _BYTES, _BYTES)
_engines: list[Any] = []  # what holds the machine code that is in use


def folder() -> Path:
    """Where this user's programs keep what they can make again."""
    stated = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA")
    return (Path(stated) if stated else Path.home() / ".cache") / "counterpoise"


def loop(compiling: Callable[[], None] = lambda: None) -> Callable[..., int] | None:
    """The loop of ``kernel.rows``; None if it cannot be had here.

    Where it is not kept, or damaged, it is compiled: some seconds, in another process that gives way to all others;
    ``compiling`` is called before.
    """
    if sys.platform == "win32" or sys.byteorder != "little":
        return None  # its words begin with the lowest byte; LLVM's loader of kept code is not to be had on Windows
    try:
        path = folder() / f"{ENTRY}-{_state()}.o"
        if (kept := _kept(path)) is not None:
            return kept
        compiling()
        return _compiled(path)
    except (ImportError, PackageNotFoundError, OSError, RuntimeError, ValueError):
        return None


def _compiled(path: Path) -> Callable[..., int] | None:
    import subprocess

    path.parent.mkdir(parents=True, exist_ok=True)
    command = [sys.executable, "-m", f"{__package__}.kernel", str(path)]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, check=False)
    return _kept(path) if done.returncode == 0 else None


def _state() -> str:
    """What the machine code depends on: its source, what compiles it, and the processor."""
    from llvmlite import binding

    parts = [binding.get_default_triple(), *_processor(), *(version(name) for name in ("llvmlite", "numba"))]
    return hashlib.sha256(SOURCE.read_bytes() + "\0".join(parts).encode()).hexdigest()[:16]


def _processor() -> tuple[str, str]:
    """Name and features of this machine's processor, as LLVM calls them."""
    from llvmlite import binding

    try:
        return binding.get_host_cpu_name(), binding.get_host_cpu_features().flatten()
    except RuntimeError:  # LLVM does not know the features
        return "", ""


def _machine() -> Any:  # noqa: ANN401
    from llvmlite import binding

    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    name, features = _processor()
    return binding.Target.from_default_triple().create_target_machine(name, features, opt=3, jit=True)


def keep(path: Path, text: str) -> None:
    """Compile what numba made of the loop to machine code, and keep it with its digest."""
    from llvmlite import binding

    with suppress(AttributeError, OSError):
        os.nice(19)
    code = _machine().emit_object(binding.parse_assembly(text))
    part = path.with_name(f"{path.name}.{os.getpid()}")
    part.write_bytes(hashlib.sha256(code).digest() + code)
    part.replace(path)


def _kept(path: Path) -> Callable[..., int] | None:
    """The loop that is kept; None if there is none, or if it is damaged."""
    from llvmlite import binding

    if not path.exists():
        return None
    content = path.read_bytes()
    if hashlib.sha256(content[32:]).digest() != content[:32]:
        return None
    engine = binding.create_mcjit_compiler(binding.parse_assembly(""), _machine())
    engine.add_object_file(binding.ObjectFileRef.from_data(content[32:]))
    engine.finalize_object()
    _engines.append(engine)
    return ctypes.CFUNCTYPE(_INTEGER, *_ARGUMENTS)(engine.get_function_address(ENTRY))
