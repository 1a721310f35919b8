"""Signals that end a command; tests/test_reliability.py has whole commands."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import pytest

from mazebench import stopping

NUMBERS = pytest.mark.parametrize(
    ("number", "status", "word"), [(signal.SIGINT, 130, "interrupted"), (signal.SIGTERM, 143, "terminated")]
)
SECOND = """
import signal
from mazebench import stopping
with stopping.listening(), stopping.stoppable(lambda: ("nothing",), waits=True):
    signal.raise_signal(signal.SIGTERM)
    assert stopping.is_asked()
    signal.raise_signal(signal.SIGINT)
"""
DONE = """
import signal
from mazebench import stopping
with stopping.listening(), stopping.stoppable(lambda: ("nothing",)):
    stopping.finish()
    signal.raise_signal(signal.SIGTERM)
signal.raise_signal(signal.SIGINT)
print("done")
"""


def how_to_go_on() -> tuple[str, ...]:
    return ("2 of 3 are kept; go on", "--out", "--resume")


def heed_interrupts() -> None:
    """Undoes that SIGINT is ignored where these tests run in the background."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


@NUMBERS
@pytest.mark.parametrize("waits", [False, True])
def test_a_signal_ends_the_command_with_one_line(number, status, word, waits, capsys, monkeypatch):
    monkeypatch.setattr("sys.argv", ["/else/where/mazebench", "eval", "--out", "my run"])
    reached = []

    def work() -> None:
        with stopping.listening(), stopping.stoppable(how_to_go_on, waits):
            signal.raise_signal(number)
            reached.append(number)
            stopping.check()

    before = signal.getsignal(signal.SIGINT)
    heed_interrupts()
    try:
        with pytest.raises(SystemExit) as ended:
            work()
    finally:
        signal.signal(signal.SIGINT, before)
    assert (ended.value.code, reached) == (status, [number] * waits)
    line = f"mazebench: {word}; 2 of 3 are kept; go on with: mazebench eval --out 'my run' --resume\n"
    assert capsys.readouterr().err == line
    stopping.check()


def test_a_second_signal_ends_the_process_at_once():
    run = subprocess.run(
        [sys.executable, "-c", SECOND], capture_output=True, text=True, preexec_fn=heed_interrupts, check=False
    )
    assert (run.returncode, run.stdout, run.stderr) == (-signal.SIGINT, "", "")


def test_interrupts_that_are_ignored_from_the_start_stay_ignored():
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with stopping.listening(), stopping.stoppable(how_to_go_on):
            os.kill(os.getpid(), signal.SIGINT)
    finally:
        signal.signal(signal.SIGINT, before)


def test_a_command_that_is_done_is_not_stopped_any_more():
    run = subprocess.run([sys.executable, "-c", DONE], capture_output=True, text=True, check=False)
    assert (run.returncode, run.stdout, run.stderr) == (0, "done\n", "")


@pytest.mark.parametrize("module", ["gymnasium", "typer"])  # of the package and of the command
def test_an_interrupt_while_modules_are_imported_is_one_line(module, tmp_path):
    (tmp_path / f"{module}.py").write_text("import signal\nsignal.raise_signal(signal.SIGINT)\n")
    run = subprocess.run(
        [sys.executable, "-m", "mazebench", "list"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        preexec_fn=heed_interrupts,
        check=False,
    )
    line = "mazebench: interrupted; run it again with: mazebench list\n"
    assert (run.returncode, run.stdout, run.stderr) == (130, "", line)
