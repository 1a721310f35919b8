"""An agent that breaks its contract: one line that names it and says what it did."""

from __future__ import annotations

import dataclasses
import pathlib
import re
import subprocess
import sys

import numpy as np
import pytest

from mazebench.errors import InputError, RunError
from mazebench.evaluation.contract import AgentError, CheckedAgent, calling
from mazebench.evaluation.harness import EvalOptions, evaluate

OPTIONS = EvalOptions("contract_at_hand:Good", distances=(1,), episodes_per_distance=1)
AGENTS = """
import numpy as np


class Good:
    @classmethod
    def build(cls, interface, *, seed=0, checkpoint=None):
        return cls()

    def initial_state(self, batch_size):
        return None

    def act(self, observation, is_first, state, explore=False):
        return self.answer(len(is_first)), state

    def answer(self, batch_size):
        return np.zeros(batch_size, dtype=np.uint8)


class FewActions(Good):
    def answer(self, batch_size):
        return np.zeros(3, dtype=int)


class Floats(Good):
    def answer(self, batch_size):
        return np.zeros(batch_size)


class Ragged(Good):
    def answer(self, batch_size):
        return [[0], [0, 0]]


class TooHigh(Good):
    def answer(self, batch_size):
        return np.full(batch_size, 6)


class Divides(Good):
    def answer(self, batch_size):
        return 1 // 0  # line 42


class OnlyActions(Good):
    def act(self, observation, is_first, state, explore=False):
        return np.zeros(len(is_first), dtype=int)


class NoSeed(Good):
    @classmethod
    def build(cls, interface):
        return cls()


class NoState(Good):
    def initial_state(self, batch_size):
        raise KeyError


class Lost(Good):
    def seed_episodes(self, seeds, mask):
        raise RuntimeError("two\\nlines")


class Vague(Good):
    @staticmethod
    def context_size(size):
        return "large"


class InLibrary(Good):
    def answer(self, batch_size):
        import json

        return json.loads("{")  # line 76


class Exits(Good):
    def answer(self, batch_size):
        raise SystemExit(3)


class Late(Good):
    def initial_state(self, batch_size):
        return 0

    def act(self, observation, is_first, state, explore=False):
        assert state < 120
        return np.full(len(is_first), 4), state + 1
"""


@pytest.fixture(autouse=True)
def _agents_at_hand(tmp_path, monkeypatch):
    (tmp_path / "contract_at_hand.py").write_text(AGENTS)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "contract_at_hand", raising=False)


BROKEN = [
    ("FewActions", "expected act() to return 20 actions, one an environment, found shape (3,)"),
    ("Floats", "expected act() to return integer actions, found float64"),
    ("Ragged", "act() raised ValueError: setting an array element with a sequence"),
    ("TooHigh", "expected act() to return actions from 0 to 5, found 6"),
    ("Divides", "act() raised ZeroDivisionError: integer division or modulo by zero (contract_at_hand.py:42)"),
    ("OnlyActions", "expected act() to return (actions, state), found an array of shape (20,)"),
    ("NoSeed", "build() raised TypeError: NoSeed.build() got an unexpected keyword argument 'seed'"),
    ("NoState", "initial_state() raised KeyError (contract_at_hand.py:"),
    ("Lost", "seed_episodes() raised RuntimeError: two lines (contract_at_hand.py:"),
    ("InLibrary", "act() raised JSONDecodeError: Expecting property name enclosed in double quotes"),
    ("Exits", "act() raised SystemExit: 3 (contract_at_hand.py:"),
    ("Vague", "context_size() raised ValueError: invalid literal for int()"),
]


class TestEvaluation:
    def test_summary_when_agent_keeps_its_contract(self, tmp_path):
        assert evaluate(OPTIONS, tmp_path / "out")["episodes"] == 20

    @pytest.mark.parametrize(("name", "said"), BROKEN, ids=[name for name, _ in BROKEN])
    def test_message_when_agent_breaks_it(self, tmp_path, name, said):
        options = dataclasses.replace(OPTIONS, agent=f"contract_at_hand:{name}")
        with pytest.raises(AgentError) as caught:
            evaluate(options, tmp_path / "out")
        assert str(caught.value).startswith(f"agent 'contract_at_hand:{name}': {said}")
        assert "\n" not in str(caught.value)

    def test_place_when_a_library_raised(self, tmp_path):
        options = dataclasses.replace(OPTIONS, agent="contract_at_hand:InLibrary")
        with pytest.raises(AgentError, match=r"\(contract_at_hand\.py:76\)$"):
            evaluate(options, tmp_path / "out")

    def test_message_when_it_breaks_in_a_worker(self, tmp_path):
        options = dataclasses.replace(OPTIONS, agent="contract_at_hand:Divides")
        with pytest.raises(AgentError, match=r"^agent 'contract_at_hand:Divides': act\(\) raised ZeroDivisionError"):
            evaluate(options, tmp_path / "out", workers=2)

    def test_folder_when_no_episode_ended_and_the_agent_is_mended(self, tmp_path):
        options = dataclasses.replace(OPTIONS, agent="contract_at_hand:Divides")
        for record in (True, False):
            with pytest.raises(AgentError):
                evaluate(options, tmp_path / "out", record=record)
        assert evaluate(OPTIONS, tmp_path / "out")["episodes"] == 20
        assert not (tmp_path / "out" / "trajectories.npz").exists()

    def test_folder_when_the_agents_file_was_changed(self, tmp_path):
        evaluate(OPTIONS, tmp_path / "out")
        (tmp_path / "contract_at_hand.py").write_text(AGENTS + "# mended\n")
        with pytest.raises(
            InputError, match="holds another run: its agent's file was changed since; name another fold"
        ):
            evaluate(OPTIONS, tmp_path / "out", resume=True)


class TestCommand:
    """With one environment at a time, so that some episodes end before the agent breaks."""

    WORDS = ("eval", "--distances", "1", "--episodes-per-distance", "1", "--num-envs", "1", "--agent")

    def run(self, folder: pathlib.Path, *words: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "mazebench", *self.WORDS, *words]
        return subprocess.run(command, cwd=folder, capture_output=True, text=True)

    def test_line_when_some_episodes_had_ended(self, tmp_path):
        words = ("contract_at_hand:Late", "--out", "run")
        plain, loud = self.run(tmp_path, *words), self.run(tmp_path, *words, "--resume", "--traceback")
        assert (plain.returncode, loud.returncode) == (1, 1)
        *_, line = plain.stderr.splitlines()
        said = r"mazebench: agent 'contract_at_hand:Late': act\(\) raised AssertionError \(contract_at_hand.py:\d+\)"
        assert re.fullmatch(said + "; 1 of 20 episodes are kept in run", line)
        assert "Traceback" not in plain.stderr
        assert "assert state < 120" in loud.stderr
        assert loud.stderr.splitlines()[-1] == line.replace("1 of 20", "2 of 20")


class TestCalling:
    @pytest.mark.parametrize("error", [InputError("no such file"), RunError("lost")])
    def test_error_when_it_is_said_well_already(self, error):
        with pytest.raises(type(error)) as caught, calling("mine", "build"):
            raise error
        assert caught.value is error

    def test_interrupt_when_it_comes_within(self):
        with pytest.raises(KeyboardInterrupt), calling("mine", "act"):
            raise KeyboardInterrupt


class TestCheckedAgent:
    def test_agent_when_it_draws_nothing(self):
        class Still:
            def initial_state(self, batch_size):
                return batch_size

            def act(self, observation, is_first, state):
                return [0] * len(is_first), state + 1

        agent = CheckedAgent("still", Still(), 6)
        agent.seed_episodes(np.zeros(2, dtype=int), np.ones(2, dtype=bool))
        actions, state = agent.act({}, np.ones(2, dtype=bool), agent.initial_state(2))
        assert (actions.tolist(), state) == ([0, 0], 3)
