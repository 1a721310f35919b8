"""Worker processes: what is kept and named when they fail. test_determinism.py compares their bytes."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading

import pytest
from faults import descendants, num_bytes, start, wait_for_ends, wait_until, workers_of
from faults import nothing_left as nothing_left  # a fixture
from run_folders import IMPORTS, records_of

from mazebench import stopping
from mazebench.errors import RunError
from mazebench.evaluation.evaluate import evaluate

# 160 episodes, two chunks for one worker.
FEW = {"distances": (1, 2, 3, 4), "episodes_per_distance": 2, "time_limit": 9}
# `Mortal` kills its process in its second chunk, the first time that it comes to one.
AGENTS = """
import os, pathlib, signal, time
from mazebench.evaluation import pool

class Mortal(Agent):
    def initial_state(self, batch_size):
        with pathlib.Path(__file__).with_name("chunks").open("a") as file:
            file.write("x")
            if file.tell() == 2:
                os.kill(os.getpid(), signal.SIGKILL)

    def act(self, inputs, state, explore=False):
        return np.zeros(len(inputs.seed), dtype=int), state

class Failing(Agent):
    def act(self, inputs, state, explore=False):
        raise ValueError("several\\nlines")

class Late(Agent):
    "Has ended episodes after 9 steps."
    def initial_state(self, batch_size):
        return 0

    def act(self, inputs, state, explore=False):
        if state == 12:
            self.end()
        return np.full(len(inputs.seed), 4), state + 1

    def end(self):
        raise ValueError

class Stopped(Late):
    def end(self):
        pathlib.Path(__file__).with_name("reached").touch()
        while not pool._stop.is_set():
            time.sleep(0.01)
"""


@pytest.fixture
def _agents_at_hand(tmp_path, monkeypatch):
    (tmp_path / "pool_at_hand.py").write_text(IMPORTS + AGENTS)
    monkeypatch.syspath_prepend(tmp_path)


@pytest.mark.usefixtures("_agents_at_hand")
def test_a_killed_worker_is_named_and_what_ended_is_kept(tmp_path):
    out = tmp_path / "out"
    with pytest.raises(RunError, match=r"^a worker process ended abruptly; what ended is kept, go on with --resume$"):
        evaluate("pool_at_hand:Mortal", out=out, workers=1, **FEW)
    calls = []
    evaluate("pool_at_hand:Mortal", out=out, workers=1, resume=True, progress=lambda *call: calls.append(call), **FEW)
    assert calls[0] == (80, 160)
    evaluate("pool_at_hand:Mortal", out=tmp_path / "unbroken", **FEW)
    assert records_of(out) == records_of(tmp_path / "unbroken")


@pytest.mark.usefixtures("_agents_at_hand")
def test_an_agents_error_in_a_worker_is_one_line(tmp_path):
    said = re.escape("agent 'pool_at_hand:Failing': act() raised ValueError: several lines (pool_at_hand.py:")
    with pytest.raises(RunError, match=rf"^{said}\d+\)$"):
        evaluate("pool_at_hand:Failing", out=tmp_path / "out", workers=1, **FEW)


@pytest.mark.usefixtures("_agents_at_hand")
def test_a_chunk_that_fails_or_is_stopped_hands_over_what_ended(tmp_path):
    options = {"workers": 1, "num_envs": 20, **FEW}
    with pytest.raises(RunError, match="raised ValueError"):
        evaluate("pool_at_hand:Late", out=tmp_path / "failed", **options)

    def stop() -> None:
        while not (tmp_path / "reached").exists():
            threading.Event().wait(0.01)
        os.kill(os.getpid(), signal.SIGTERM)  # SIGINT is ignored in the background

    thread = threading.Thread(target=stop)
    thread.start()
    with (
        pytest.raises(SystemExit),
        stopping.listening(),
        stopping.stoppable(lambda: ("kept",), waits=True),
    ):
        evaluate("pool_at_hand:Stopped", out=tmp_path / "stopped", **options)
    thread.join()
    for name in ("failed", "stopped"):
        assert len((tmp_path / name / "journal.jsonl").read_text().split()) == 20


def test_a_script_without_a_main_guard_is_told_to_have_one(tmp_path):
    script = tmp_path / "script.py"
    script.write_text("import mazebench\nmazebench.evaluate('random', distances=(1,), workers=1)\n")
    for words, said in (([script], "under `if __name__ == '__main__':`"), (["-"], "expected the script in a file")):
        with script.open() as file:
            ended = subprocess.run([sys.executable, *words], stdin=file, capture_output=True, text=True, check=False)
        assert said in ended.stderr.splitlines()[-1]
        assert "start a new process" not in ended.stderr


@pytest.mark.usefixtures("nothing_left")
def test_workers_end_when_their_parent_is_killed(tmp_path):
    process = start("eval", "--agent", "random", "--distances", "1-6", "--workers", "2", "--out", tmp_path / "run")
    wait_until(lambda: num_bytes(tmp_path) > 10_000, process)  # Python itself complains of a parent that dies earlier
    children = descendants(process.pid)
    assert len(workers_of(process)) == 2
    process.kill()
    wait_for_ends(children)
    assert "Traceback" not in process.communicate()[1]
