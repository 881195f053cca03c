"""A Textual screen beside a node: it draws in the main thread, while the node spins in another one."""

from __future__ import annotations

import contextlib
import os
import sys
import tempfile
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

if TYPE_CHECKING:
    from textual.app import App

CLOSING_LIMIT = 1.0
"""Longest time to wait until the terminal is restored [s]."""


def is_terminal() -> bool:
    """Return whether a screen can be shown: Textual reads from standard input, and draws on standard error."""
    return sys.stdin.isatty() and sys.stderr.isatty()


class Terminal:
    """Shows a screen until the user or `close` ends it."""

    def __init__(self) -> None:
        self._app: App[Any] | None = None
        self._closed = threading.Event()

    def run(self, node: Node, app: App[Any]) -> None:
        """Show a screen in the main thread, and spin the node in another one. An error ends both."""
        self._app = app
        callbacks = SingleThreadedExecutor(context=node.context)  # that of events spins in the main thread only
        callbacks.add_node(node)
        with ThreadPoolExecutor(1) as pool:
            spinning = pool.submit(callbacks.spin)
            spinning.add_done_callback(lambda _: self.close())
            try:
                with _errors_kept():
                    app.run()
            finally:
                self._closed.set()
                callbacks.shutdown()
            spinning.result()
        if app.return_code:
            sys.exit(app.return_code)

    def close(self) -> None:
        """Close the screen, and wait until the terminal is restored; in any thread but the one of the screen."""
        if self._app is not None and not self._closed.is_set():
            self._app.exit()  # may be called in any thread
            self._closed.wait(CLOSING_LIMIT)


@contextlib.contextmanager
def _errors_kept() -> Iterator[None]:
    """Keep from the screen what others write to standard error, such as logs, and print it afterwards."""
    with tempfile.TemporaryFile() as kept:
        before, terminal = sys.__stderr__, os.dup(2)
        os.dup2(kept.fileno(), 2)
        try:
            with open(terminal, 'w', closefd=False) as vars(sys)['__stderr__']:  # where Textual draws
                yield
        finally:
            vars(sys)['__stderr__'] = before
            os.dup2(terminal, 2)
            os.close(terminal)
            kept.seek(0)
            sys.stderr.write(kept.read().decode(errors='replace'))
