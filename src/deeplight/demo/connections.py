"""What keeps a server alive among strangers: a cap on connections, and an end to each."""

import contextlib
import socket
import threading
import time


class Connections:
    """The open connections, each with the time by which its next step must be done.

    A peer that sends a byte now and then never trips a socket's own timeout; its deadline it does.

    Args:
        most: connections at once; more are closed as they come.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._deadlines: dict[socket.socket, float] = {}
        self._lock = threading.Lock()

    def open(self, connection: socket.socket, seconds: float) -> bool:
        """Take a connection in; False if there are too many."""
        with self._lock:
            if len(self._deadlines) >= self._most:
                return False
            self._deadlines[connection] = time.monotonic() + seconds
            return True

    def extend(self, connection: socket.socket, seconds: float) -> None:
        """Give an open connection so long from now on."""
        with self._lock:
            if connection in self._deadlines:
                self._deadlines[connection] = time.monotonic() + seconds

    def close(self, connection: socket.socket) -> None:
        """Forget a connection."""
        with self._lock:
            self._deadlines.pop(connection, None)

    def end_late_ones(self) -> None:
        """Cut the connections whose time is over; their threads see the end of the stream."""
        now = time.monotonic()
        with self._lock:
            late = [one for one, deadline in self._deadlines.items() if deadline < now]
        for connection in late:
            with contextlib.suppress(OSError):
                connection.shutdown(socket.SHUT_RDWR)
