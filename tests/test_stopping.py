"""Signals that end a command, also where what they raise is lost; tests/test_reliability.py has whole commands."""

from __future__ import annotations

import contextlib
import os
import signal

import pytest

from mazebench import stopping


@pytest.mark.parametrize(
    ("number", "kind", "status", "word"),
    [
        (signal.SIGINT, KeyboardInterrupt, 130, "interrupted"),
        (signal.SIGTERM, stopping.Terminated, 143, "terminated"),
    ],
)
class TestSignal:
    @pytest.fixture(autouse=True)
    def _heeded(self, monkeypatch):
        monkeypatch.setattr("sys.argv", ["/else/where/mazebench", "eval", "--out", "my run"])
        before = signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored where tests run in the background
        yield
        signal.signal(signal.SIGINT, before)

    def test_command_when_told(self, number, kind, status, word, capsys):
        with (
            pytest.raises(SystemExit) as ended,
            stopping.listening(),
            stopping.stoppable(lambda: ("2 of 3 are kept; go on", "--out", "--resume")),
        ):
            signal.raise_signal(number)
        assert ended.value.code == status
        line = f"mazebench: {word}; 2 of 3 are kept; go on with: /else/where/mazebench eval --out 'my run' --resume\n"
        assert capsys.readouterr().err == line

    def test_exception_when_a_destructor_lost_it(self, number, kind, status, word):
        with stopping.listening():
            with pytest.raises(kind):
                signal.raise_signal(number)
            with pytest.raises(kind):
                stopping.check()
        stopping.check()

    def test_command_when_it_fails_of_the_lost_exception(self, number, kind, status, word):
        def compile() -> None:
            with contextlib.suppress(kind):
                signal.raise_signal(number)
            raise RuntimeError("no compiled object yet")

        with pytest.raises(SystemExit) as ended, stopping.listening(), stopping.stoppable(lambda: ("run it again",)):
            compile()
        assert ended.value.code == status

    def test_signal_when_nobody_listens_any_more(self, number, kind, status, word):
        before = signal.getsignal(number)
        with stopping.listening():
            assert signal.getsignal(number) != before
        assert signal.getsignal(number) == before


def test_interrupt_when_it_is_ignored_from_the_start():
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with stopping.listening(), stopping.stoppable(lambda: ("run it again",)):
            os.kill(os.getpid(), signal.SIGINT)
    finally:
        signal.signal(signal.SIGINT, before)


def test_failure_when_nothing_was_told():
    with pytest.raises(RuntimeError), stopping.listening(), stopping.stoppable(lambda: ("run it again",)):
        raise RuntimeError
