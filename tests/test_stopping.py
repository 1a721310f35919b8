"""Signals that end a command, also where what they raise is lost; tests/test_reliability.py has whole commands."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys

import pytest

from mazebench import stopping


def how_to_go_on() -> tuple[str, ...]:
    return ("2 of 3 are kept; go on", "--out", "--resume")


def compile_something(number: int, kind: type[BaseException]) -> None:
    """Fails as a compiler does that loses the exception of a signal."""
    with contextlib.suppress(kind):
        signal.raise_signal(number)
    raise RuntimeError("no compiled object yet")


@pytest.fixture
def _heeded(monkeypatch):
    monkeypatch.setattr("sys.argv", ["/else/where/mazebench", "eval", "--out", "my run"])
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored where tests run in the background
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("_heeded")
@pytest.mark.parametrize(
    ("number", "kind", "status", "word"),
    [
        (signal.SIGINT, KeyboardInterrupt, 130, "interrupted"),
        (signal.SIGTERM, stopping.Terminated, 143, "terminated"),
    ],
)
class TestSignal:
    def test_a_signal_ends_the_command_with_one_line(self, number, kind, status, word, capsys):
        with pytest.raises(SystemExit) as ended, stopping.listening(), stopping.stoppable(how_to_go_on):
            signal.raise_signal(number)
        assert ended.value.code == status
        line = f"mazebench: {word}; 2 of 3 are kept; go on with: mazebench eval --out 'my run' --resume\n"
        assert capsys.readouterr().err == line

    def test_a_lost_exception_is_raised_again_by_the_next_check(self, number, kind, status, word):
        with stopping.listening():
            with pytest.raises(kind):
                signal.raise_signal(number)
            with pytest.raises(kind):
                stopping.check()
        stopping.check()

    def test_a_failure_that_a_lost_exception_caused_ends_the_command_alike(self, number, kind, status, word):
        with pytest.raises(SystemExit) as ended, stopping.listening(), stopping.stoppable(how_to_go_on):
            compile_something(number, kind)
        assert ended.value.code == status


def test_interrupts_that_are_ignored_from_the_start_stay_ignored():
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with stopping.listening(), stopping.stoppable(how_to_go_on):
            os.kill(os.getpid(), signal.SIGINT)
    finally:
        signal.signal(signal.SIGINT, before)


def test_an_interrupt_while_modules_are_imported_prints_nothing(tmp_path):
    (tmp_path / "typer.py").write_text(
        "import signal\nsignal.raise_signal(signal.SIGINT)\n"
    )  # imported for the command
    run = subprocess.run(
        [sys.executable, "-m", "mazebench", "list"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # which the background ignores
    )
    assert (run.returncode, run.stdout, run.stderr) == (-signal.SIGINT, "", "")
