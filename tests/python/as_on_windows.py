"""Python as it is on Windows, as far as another system can be: what CPython lacks there is taken away, then CODE runs.

usage: as_on_windows.py CODE [ARGUMENT …]      (CODE finds the arguments in sys.argv)

What is written in C and Rust stays this system's. Modules of others are loaded before: they look at the system too.
"""

from __future__ import annotations

import importlib
import os
import signal
import socket
import socketserver
import sys
from types import ModuleType

_OF_OTHERS = """
asyncio click click.testing concurrent.futures ctypes getpass logging.handlers mimetypes multiprocessing platform
random rich.console rich.live rich.progress rich.status rich.table secrets select selectors serial
serial.tools.list_ports shutil ssl subprocess tempfile threading uuid zipfile
"""

_NO_MODULES = ["curses", "fcntl", "grp", "posix", "pty", "pwd", "readline", "resource", "syslog", "termios", "tty"]

_NO_NAMES: dict[ModuleType, str] = {
    os: "chown fchmod fork forkpty getegid geteuid getgid getloadavg getpgid getpgrp getsid getuid killpg mkfifo nice "
    "openpty posix_fadvise posix_spawn pread pwrite register_at_fork sched_getaffinity setsid sysconf tcgetpgrp "
    "tcsetpgrp ttyname uname wait waitpid WEXITSTATUS WIFEXITED WIFSIGNALED WNOHANG WTERMSIG",
    signal: "SIGALRM SIGCHLD SIGCONT SIGHUP SIGKILL SIGPIPE SIGQUIT SIGSTOP SIGTSTP SIGUSR1 SIGUSR2 SIGWINCH alarm "
    "pause pthread_kill pthread_sigmask setitimer siginterrupt sigpending sigtimedwait sigwait sigwaitinfo",
    socket: "AF_UNIX CMSG_LEN SCM_RIGHTS SO_PEERCRED recv_fds send_fds sethostname",
    socketserver: "ForkingMixIn UnixDatagramServer UnixStreamServer",
}


def _socketpair() -> tuple[socket.socket, socket.socket]:
    """As CPython makes one there."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        one = socket.create_connection(server.getsockname())
        return one, server.accept()[0]


def take_away() -> None:
    """Makes this interpreter one of Windows for whatever is imported from now on."""
    for name in _OF_OTHERS.split():
        importlib.import_module(name)
    for name in _NO_MODULES:
        # What is None there cannot be imported.
        sys.modules[name] = None  # type: ignore[assignment]
    for module, names in _NO_NAMES.items():
        for name in names.split():
            if hasattr(module, name):
                delattr(module, name)
    socket.socketpair = _socketpair  # type: ignore[assignment]
    sys.platform = "win32"


if __name__ == "__main__":
    del sys.argv[0]
    take_away()
    exec(compile(sys.argv[0], "<as on Windows>", "exec"), {"__name__": "__main__"})
