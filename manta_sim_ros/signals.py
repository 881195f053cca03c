"""The signals that end a process: SIGINT (Ctrl-C), SIGTERM and SIGHUP (the terminal was closed).

Python runs the handlers of signals in the main thread, between two instructions of Python. A call of compiled code
delays them by seconds, and may catch the exception of a handler. Here, a thread of its own hears the signals.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable

ENDING = tuple(
    each for each in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    if each != signal.SIGHUP or signal.getsignal(each) != signal.SIG_IGN)  # `nohup` ignores it
"""The signals that end this process."""

_action: Callable[[], object] | None = None
_listens = False


def on_ending(action: Callable[[], object] | None) -> None:
    """Call `action` in a thread of its own when a signal comes that ends the process, in place of the last one.

    None stands for no action; then the caller sets handlers of its own. The main thread must call this.
    """
    global _action, _listens
    _action = action
    if not _listens:
        _listens = True
        reads, writes = os.pipe()
        os.set_blocking(writes, False)
        threading.Thread(target=_listen, args=(reads,), name='signals', daemon=True).start()
        signal.set_wakeup_fd(writes, warn_on_full_buffer=False)
        for ending in ENDING:
            signal.signal(ending, lambda signum, frame: None)  # without one, the signal does not reach the pipe


def ignore_endings() -> None:
    """Ignore these signals from now on: the process is ending."""
    for ending in ENDING:
        signal.signal(ending, signal.SIG_IGN)


def _listen(reads: int) -> None:
    while True:
        number, = os.read(reads, 1)
        if number in ENDING and _action is not None:
            _action()
