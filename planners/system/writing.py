# SPDX-License-Identifier: GPL-3.0-or-later
"""Files out: written whole or not at all, and known before the work whether they can be."""

from __future__ import annotations

import errno
import gzip
import os
import stat
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from os import PathLike
from pathlib import Path

from planners.system.errors import UsageError
from planners.system.signals import postponed_signals

#: Characters of a file's name that its temporary file repeats: with what is added, at most 90
#: bytes, which every file system takes.
_REPEATED = 16


def why_unwritable(path: str | Path, *, makes_folder: bool = False) -> str | None:
    """Why no file can be written there, as far as that is known without writing; None if it can.

    ``makes_folder``: its folder is made where it is missing.
    """
    text = os.fspath(path)
    if not text:
        return "its name is empty"
    try:
        with suppress(FileNotFoundError, NotADirectoryError):
            return _why_not_replaced(text, os.stat(text).st_mode)
        return _why_not_made(text, makes_folder)
    except FileNotFoundError:  # relative to no folder
        return "the working directory has been removed"
    except OSError as error:
        return error.strerror


def is_device(path: str | Path) -> bool:
    """Whether this is a device or a pipe: written to, and never replaced."""
    try:
        return not stat.S_ISREG(os.stat(path).st_mode)  # asked once: it may go at any moment
    except (OSError, ValueError):
        return False


def remove_file(path: str | Path | None) -> None:
    """Remove a file; nothing for None, for what is missing, and for a device or a pipe."""
    if path is not None and os.path.isfile(path):
        Path(os.path.realpath(path)).unlink(missing_ok=True)


def write_atomically(path: str | Path, data: bytes, *, outdated: str | Path | None = None) -> None:
    """Write beside, flush to the disk, then rename: a file is whole or as it was before.

    Signals wait until that is done; devices and pipes apart, which may block.  ``outdated`` is a
    file that belongs to what ``path`` held before.  It is removed just before ``path`` is replaced,
    so that it never stands beside the new one, and kept if the writing fails.  Raises `UsageError`
    for a file that cannot be written, and `BrokenPipeError` for a pipe whose reader has gone.
    """
    _write({path: data}, outdated)


def _write(files: Mapping[str | Path, bytes], outdated: str | Path | None = None) -> None:
    """Write files as `write_atomically` does, all of them before the first one is renamed."""
    path: str | Path = ""
    try:
        for path in files:
            if reason := why_unwritable(path):
                raise _cannot(path, reason)
        for path in (devices := [*filter(is_device, files)]):
            remove_file(outdated)
            Path(path).write_bytes(files[path])
        targets = {path: Path(os.path.realpath(path)) for path in files if path not in devices}
        with postponed_signals(), ExitStack() as written:
            ready = {}
            for path, target in targets.items():
                ready[path] = written.enter_context(_written_beside(target, files[path]))
            written.enter_context(_set_aside(outdated))
            for path, beside in ready.items():
                os.replace(beside, targets[path])
    except BrokenPipeError:
        raise
    except OSError as error:
        raise _cannot(path, error.strerror or str(error)) from None


def write_compressed(
    path: str | Path, data: bytes, level: int = 9, *, outdated: str | Path | None = None
) -> None:
    """Write like `write_atomically`; compressed for a name that ends in ``.gz``."""
    if str(path).endswith(".gz"):
        data = gzip.compress(data, compresslevel=level, mtime=0)
    write_atomically(path, data, outdated=outdated)


def made_folder(path: str | PathLike[str], mode: int = 0o777) -> Path:
    """A folder, which is made if it is missing; raises `UsageError` if it cannot be."""
    try:
        os.makedirs(path, mode, exist_ok=True)  # of an empty name it is none: Path means "."
    except OSError as error:
        raise UsageError(
            f"the folder {path} cannot be made: {error.strerror}",
            remedy="Name a folder in one that you may write to.",
        ) from None
    return Path(path)


def write_texts(folder: str | Path, texts: Mapping[str, str]) -> None:
    """Write text files, by their names, into a folder: all or, raising `UsageError`, none."""
    place = made_folder(folder)
    _write({place / name: text.encode() for name, text in texts.items()})


def copy_folders(folders: Sequence[str | Path], target: str | Path) -> None:
    """Copy folders with all files in them into one, which is made if it is missing.

    They are copied beside, and then renamed: all of them are there, and whole, or none.  Signals
    wait until that is done.  Raises `UsageError` if one cannot be written, or is there already.
    """
    into = Path(target)
    try:
        with postponed_signals():
            into.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryDirectory(prefix=".coordlang.", dir=into) as beside:
                for folder in map(Path, folders):
                    copy = Path(beside, folder.name)
                    copy.mkdir()
                    for file in folder.iterdir():
                        _copy_file(file, copy / file.name)
                with ExitStack() as undone:
                    for folder in map(Path, folders):
                        copy, place = Path(beside, folder.name), into / folder.name
                        os.rename(copy, place)
                        undone.callback(os.rename, place, copy)
                    undone.pop_all()
    except OSError as error:
        raise _cannot(into, error.strerror or str(error)) from None


def _copy_file(source: Path, copy: Path) -> None:
    """Write a file again, to the disk."""
    with open(copy, "wb") as file:
        file.write(source.read_bytes())
        file.flush()
        os.fsync(file.fileno())


@contextmanager
def _written_beside(target: Path, data: bytes) -> Iterator[Path]:
    """Write a temporary file beside a target, to the disk; it is gone after the block.

    Its permissions are those of the target, or of any new file; until it is written only the owner
    may read it if the target exists.
    """
    beside = _beside(target)
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
    handle = os.open(beside, flags, 0o600 if target.exists() else 0o666)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
            file.flush()
            with suppress(FileNotFoundError):
                os.fchmod(handle, stat.S_IMODE(target.stat().st_mode) & 0o777)
            os.fsync(file.fileno())
        yield beside
    finally:
        beside.unlink(missing_ok=True)


@contextmanager
def _set_aside(path: str | Path | None) -> Iterator[None]:
    """Rename a file away for the block; it is gone after it, and stands there again if that fails.

    Nothing for None, for what is missing, and for a device or a pipe.
    """
    if path is None or not os.path.isfile(path):
        yield
        return
    old = Path(os.path.realpath(path))
    aside = _beside(old)
    with suppress(FileNotFoundError):  # another process has just moved it
        os.replace(old, aside)
    try:
        yield
    except OSError:
        if aside.exists():
            os.replace(aside, old)
        raise
    aside.unlink(missing_ok=True)


def _beside(target: Path) -> Path:
    """A new name in the folder of a file."""
    return target.parent / f".{target.name[:_REPEATED]}.{os.urandom(4).hex()}"


def _cannot(path: str | Path, reason: str) -> UsageError:
    return UsageError(
        f"{path} cannot be written: {reason}",
        remedy="Name a file in a folder that you may write to.",
    )


def _why_not_replaced(text: str, mode: int) -> str | None:
    """Why a file that exists is not replaced, or a device not written to; None if it can be."""
    if stat.S_ISDIR(mode):
        return os.strerror(errno.EISDIR)
    if stat.S_ISSOCK(mode):
        return os.strerror(errno.ENXIO)
    if not stat.S_ISREG(mode):
        return _denied(text, os.W_OK)
    if not mode & 0o222:  # asked of the file itself: the superuser may write to any
        return "the file is read-only"
    return _denied(text, os.W_OK) or _denied(_folder(text), os.W_OK | os.X_OK)


def _why_not_made(text: str, makes_folder: bool) -> str | None:
    """Why no new file of this name can be made, or None."""
    if os.path.basename(text) in ("", os.curdir, os.pardir):
        return "this names a folder, and there is none"
    folder = _folder(text)
    while makes_folder and not folder.exists():
        folder = folder.parent
    if folder.is_dir():
        return _denied(folder, os.W_OK | os.X_OK)
    if makes_folder:
        return f"the folder {Path(text).parent} cannot be made: {os.strerror(errno.ENOTDIR)}"
    return f"there is no folder {Path(text).parent}"


def _folder(text: str) -> Path:
    return Path(os.path.realpath(text)).parent


def _denied(path: str | Path, mode: int) -> str | None:
    # Another process may have removed it since it was seen: that denies nothing.
    allowed = os.access(path, mode) or not os.path.exists(path)
    return None if allowed else os.strerror(errno.EACCES)
