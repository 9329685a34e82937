"""End a command by a signal: at once, with its children, and with the exit code that says so."""

import contextlib
import multiprocessing
import os
import signal
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import NoReturn

CHILDREN_S = 0.8
"""Child processes that still live so long after a signal are ended."""
ALL_S = 2.0
"""And so is the command itself, should a library not let go of it."""

_ENDING = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]


class Stopped(BaseException):
    """The process was asked to end; no Exception, as KeyboardInterrupt is none."""

    def __init__(self, number: int) -> None:
        self.number = number
        super().__init__(signal.Signals(number).name)


@contextmanager
def stopping() -> Iterator[None]:
    """Within the block TERM and HUP raise `Stopped` in the main thread, as INT raises its own.

    A thread sees to it that neither children nor a library in the middle of a long call keep the
    process: Python can raise nothing before that call returns. A signal that is ignored, as HUP is
    under nohup, stays so. Outside the main thread nothing is changed.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    ours = [number for number in _ENDING if signal.getsignal(number) is signal.SIG_DFL]
    receiver, sender = socket.socketpair()
    sender.setblocking(False)
    earlier = signal.set_wakeup_fd(sender.fileno(), warn_on_full_buffer=False)
    for number in ours:
        signal.signal(number, _stop)
    done = threading.Event()
    threading.Thread(target=_last_resort, args=(receiver, done), daemon=True).start()
    try:
        yield
    finally:
        done.set()
        signal.set_wakeup_fd(earlier)
        sender.close()
        for number in ours:
            signal.signal(number, signal.SIG_DFL)


def _stop(number: int, _frame: FrameType | None) -> NoReturn:
    raise Stopped(number)


def _last_resort(receiver: socket.socket, done: threading.Event) -> None:
    """Wait for a signal's number, then for the process to end of itself, then end it."""
    ends = {*_ENDING, signal.SIGINT}
    number = 0
    with receiver:
        while number not in ends or signal.getsignal(number) is signal.SIG_IGN:
            got = receiver.recv(1)
            if not got:
                return  # the block has ended
            number = got[0]
    if done.wait(CHILDREN_S):
        return
    for child in multiprocessing.active_children():
        with contextlib.suppress(Exception):
            child.kill()
    if not done.wait(ALL_S - CHILDREN_S):
        os._exit(128 + number)
