"""Worker processes: what is kept and named when they fail. test_determinism.py compares their bytes."""

from __future__ import annotations

import re

import pytest
from faults import descendants, num_bytes, start, wait_for_ends, wait_until, workers_of
from faults import nothing_left as nothing_left  # a fixture
from run_folders import IMPORTS, records_of

from mazebench.errors import RunError
from mazebench.evaluation.evaluate import evaluate

# 160 episodes, two chunks for one worker.
FEW = {"distances": (1, 2, 3, 4), "episodes_per_distance": 2, "time_limit": 9}
# `Mortal` kills its process in its second chunk, the first time that it comes to one.
AGENTS = """
import os, pathlib, signal

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
"""


@pytest.fixture
def _agents_at_hand(tmp_path, monkeypatch):
    (tmp_path / "pool_at_hand.py").write_text(IMPORTS + AGENTS)
    monkeypatch.syspath_prepend(tmp_path)


@pytest.mark.usefixtures("_agents_at_hand")
def test_a_killed_worker_is_named_and_what_ended_is_kept(tmp_path):
    out = tmp_path / "out"
    with pytest.raises(RunError, match=r"^a worker process ended abruptly; go on with --resume$"):
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


@pytest.mark.usefixtures("nothing_left")
def test_workers_end_when_their_parent_is_killed(tmp_path):
    process = start("eval", "--agent", "random", "--distances", "1-6", "--workers", "2", "--out", tmp_path / "run")
    wait_until(lambda: num_bytes(tmp_path) > 10_000, process)  # Python itself complains of a parent that dies earlier
    children = descendants(process.pid)
    assert len(workers_of(process)) == 2
    process.kill()
    wait_for_ends(children)
    assert "Traceback" not in process.communicate()[1]
