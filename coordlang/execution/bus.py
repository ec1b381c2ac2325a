# SPDX-License-Identifier: GPL-3.0-or-later
"""What carries messages between robots: sockets in a folder of this machine, or Zenoh.

A bus delivers what it can and promises nothing: what was lost is told again (`fleet_log`).  It is
used by one thread; ``fileno`` is ready to be read when a message has come, and ``send`` says
whether a message is on its way, as far as that can be known.
"""

from __future__ import annotations

import errno
import fcntl
import os
import socket
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from queue import SimpleQueue
from typing import IO, Any
from urllib.parse import quote

from planners.system.errors import BadInput, UsageError

#: A message is not longer, in bytes.
_MOST = 1 << 17
#: Where Zenoh listens without a configuration: the first robot here, the next one at the next port.
_PORT = 7460


def opened(text: str, run: str, robot: str, robots: Sequence[str]) -> Bus:
    """The bus ``unix``, ``unix:FOLDER``, ``zenoh`` or ``zenoh:CONFIG`` of a robot in a run.

    Raises `UsageError` for another one, if it cannot be opened, or if somebody is this robot there.
    """
    kind, _, where = text.partition(":")
    if kind == "unix":
        own = Path(tempfile.gettempdir(), f"coordlang-{os.getuid()}-{run}")
        return _UnixBus(Path(where) if where else own, robot)
    if kind == "zenoh":
        return _ZenohBus(where, run, robot, robots)
    raise UsageError(f"--bus {text}: there is no such bus", remedy="Say unix:FOLDER or zenoh.")


def _quoted(robot: str) -> str:
    """A robot's name as part of a key, and as that of a file: without dots."""
    return quote(robot, safe="").replace(".", "%2E")


class _UnixBus:
    """Unix datagram sockets in a folder, one for each robot.

    Whoever comes first makes the folder, or sees that it was removed; only the user who made it may
    enter.  Who holds the lock of a robot is this robot: a process that is killed loses it.
    """

    def __init__(self, folder: Path, robot: str) -> None:
        self._folder, self._robot, self._own = folder, robot, folder / _quoted(robot)
        self._lock, self._socket = self._entered()

    def _entered(self, tries: int = 9) -> tuple[IO[str], socket.socket]:
        """The robot's lock and its socket in the folder, which may be removed meanwhile."""
        own = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        try:
            self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            if self._folder.stat().st_uid != os.getuid():
                raise PermissionError(errno.EPERM, "the folder is another user's")
            lock = os.fdopen(os.open(f"{self._own}.lock", os.O_CREAT | os.O_RDWR, 0o600))
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            self._own.unlink(missing_ok=True)
            own.bind(str(self._own))
        except BlockingIOError:
            remedy = "End that process, or name another folder with --bus unix:FOLDER."
            raise UsageError(f"{self._robot} is on this bus already", remedy=remedy) from None
        except OSError as error:  # of a path that is too long for a socket, too
            if isinstance(error, FileNotFoundError | FileExistsError) and tries > 1:
                return self._entered(tries - 1)
            what = f"--bus unix:{self._folder} cannot be opened: {error.strerror or error}"
            raise UsageError(what, remedy="Name a short path to a folder of yours.") from None
        return lock, own

    def fileno(self) -> int:
        return self._socket.fileno()

    def send(self, robot: str, data: bytes) -> bool:
        """Send a message; False where its reader has too many unread ones."""
        if not self._own.exists():  # the folder was removed
            self.close()
            self._lock, self._socket = self._entered()
        try:
            self._socket.sendto(data, str(self._folder / _quoted(robot)))
        except OSError as error:
            # Nobody is there: it will ask when it comes.
            return error.errno in (errno.ENOENT, errno.ECONNREFUSED)
        return True

    def receive(self) -> Iterator[bytes]:
        with suppress(BlockingIOError):
            while True:
                yield self._socket.recv(_MOST)

    def close(self) -> None:
        """Leave the bus; the folder stays for the others."""
        with suppress(OSError):  # a file may be where the folder was
            self._own.unlink()
        self._socket.close()
        self._lock.close()


class _ZenohBus:
    """Zenoh, robot to robot; every robot listens on 127.0.0.1 unless a configuration says else."""

    def __init__(self, config: str, run: str, robot: str, robots: Sequence[str]) -> None:
        try:
            import zenoh
        except ImportError:
            remedy = "pip install 'coordlang[fleet]'"
            raise UsageError("--bus zenoh: eclipse-zenoh is not installed", remedy=remedy) from None
        self._prefix = f"coordlang/{run}"
        self._come: SimpleQueue[bytes] = SimpleQueue()
        self._bell, self._rung = socket.socketpair(type=socket.SOCK_STREAM | socket.SOCK_NONBLOCK)
        try:
            if config:
                settings = zenoh.Config.from_file(config)
            else:
                settings = _local(zenoh, robots.index(robot), len(robots))
            self._session: Any = zenoh.open(settings)
        except zenoh.ZError as error:
            # Zenoh's messages end with a line of its source.
            what = f"--bus zenoh:{config} cannot be opened: {str(error).partition(' at /')[0]}"
            remedy = "Give zenoh:CONFIG with free ports: docs/robots.md, A bus."
            raise BadInput(what, remedy=remedy) from None
        self._session.declare_subscriber(f"{self._prefix}/{_quoted(robot)}", self._comes)

    def _comes(self, sample: Any) -> None:
        """Take a message from a thread of Zenoh's."""
        self._come.put(sample.payload.to_bytes()[:_MOST])
        with suppress(BlockingIOError):  # it has rung already
            self._rung.send(b"1")

    def fileno(self) -> int:
        return self._bell.fileno()

    def send(self, robot: str, data: bytes) -> bool:
        self._session.put(f"{self._prefix}/{_quoted(robot)}", data)
        return True

    def receive(self) -> Iterator[bytes]:
        with suppress(BlockingIOError):
            self._bell.recv(_MOST)
        while not self._come.empty():
            yield self._come.get()

    def close(self) -> None:
        self._session.close()
        self._bell.close()
        self._rung.close()


Bus = _UnixBus | _ZenohBus


def _local(zenoh: Any, number: int, robots: int) -> Any:
    """Robots of one machine, each at a port of its own, that look for nobody else."""
    config = zenoh.Config()
    ends = [f'"tcp/127.0.0.1:{_PORT + other}"' for other in range(robots)]
    config.insert_json5("mode", '"peer"')
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("listen/endpoints", f"[{ends.pop(number)}]")
    config.insert_json5("connect/endpoints", f"[{', '.join(ends)}]")
    return config
