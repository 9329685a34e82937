"""Signals and a dead parent end a command and its workers within two seconds."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from deeplight.io.atomic import replacing
from patience import patient

pytestmark = pytest.mark.skipif(not Path("/proc").exists(), reason="reads /proc")

COMMAND = """
import sys, time
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from deeplight.cli.main import run_command
from deeplight.jobs import Engine, run

@dataclass
class Args:
    folder: Path
    busy: bool = False

def work(job):
    folder, number = job
    from deeplight.io.atomic import replacing
    with replacing(folder / f"{number}.txt") as temporary:
        temporary.write_text("whole")
        if number > 1:
            (folder / f"started{number}").touch()
            time.sleep(60)

def main(args):
    if args.busy:  # a library that does not let go of the main thread: no handler can run
        import hashlib
        (args.folder / "started2").touch()
        hashlib.pbkdf2_hmac("sha256", b"x", b"y", 200_000_000)
    for done in run([(args.folder, n) for n in range(6)], work, Engine(workers=2)):
        print(done.job[1], flush=True)

if __name__ == "__main__":
    module = ModuleType("verb")
    module.Args, module.run = Args, main
    sys.exit(run_command("verb", module, sys.argv[1:]))
"""


def _ignoring_nothing() -> None:
    for number in (signal.SIGHUP, signal.SIGINT):
        signal.signal(number, signal.SIG_DFL)


def begun(folder: Path, *more: str) -> subprocess.Popen[str]:
    """The command, two of its six jobs done and two in the middle."""
    script = folder / "script.py"
    script.write_text(COMMAND)
    command = [sys.executable, str(script), "--folder", str(folder), *more]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    # A command respects what is ignored from birth: a hang-up under nohup, INT in a shell's "&".
    child = subprocess.Popen(
        command,
        env=environment,
        stdout=-1,
        stderr=-1,
        text=True,
        preexec_fn=_ignoring_nothing,
    )
    most = time.monotonic() + patient(60)
    while len(list(folder.glob("started*"))) < (1 if more else 2) and time.monotonic() < most:
        time.sleep(0.05)
    return child


def living(folder: Path) -> list[str]:
    """Processes that were started for the folder: their command lines or their parents' say so."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            words = (process / "environ").read_bytes() + (process / "cmdline").read_bytes()
            state = (process / "stat").read_text().rpartition(")")[2].split()[0]
        except (OSError, PermissionError):
            continue
        if os.fsencode(folder) in words and state not in "ZX":
            found.append(process.name)
    return found


@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP", "SIGINT", "SIGKILL"])
def test_a_signal_ends_the_command_and_its_workers(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MARK", str(tmp_path))
    number = signal.Signals[name]
    with begun(tmp_path) as child:
        assert len(living(tmp_path)) >= 3
        child.send_signal(number)
        sent = time.monotonic()
        child.wait(patient(20))
        while living(tmp_path) and time.monotonic() < sent + patient(10):
            time.sleep(0.05)
        took = time.monotonic() - sent
        _, said = child.communicate()
    assert took < patient(5)  # two seconds on an idle machine
    assert child.returncode == (-number if name == "SIGKILL" else 128 + number)
    assert name == "SIGKILL" or len(said.strip().splitlines()) == 1, said
    results = {path.name for path in tmp_path.glob("[0-9]*.txt")}
    assert results == {"0.txt", "1.txt"}
    assert (tmp_path / "0.txt").read_text() == "whole"
    with replacing(tmp_path / "next.txt") as temporary:  # the next run tidies up
        temporary.write_text("whole")
    assert {path.name for path in tmp_path.glob("*.txt")} == {*results, "next.txt"}


def test_a_library_that_holds_the_main_thread_is_not_waited_for(tmp_path: Path) -> None:
    with begun(tmp_path, "--busy") as child:
        child.send_signal(signal.SIGTERM)
        assert child.wait(patient(30)) == 128 + signal.SIGTERM


def test_an_ignored_hangup_stays_ignored(tmp_path: Path) -> None:
    script = (
        "import os, signal\n"
        "from deeplight.cli.stopping import stopping\n"
        "signal.signal(signal.SIGHUP, signal.SIG_IGN)\n"
        "with stopping():\n    os.kill(os.getpid(), signal.SIGHUP)\n"
        "assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL\n"
    )
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run([sys.executable, "-c", script], env=environment, check=False)
    assert done.returncode == 0
