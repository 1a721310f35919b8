"""An agent that breaks its contract: one line that names it and says what it did."""

from __future__ import annotations

import dataclasses

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
"""


@pytest.fixture(autouse=True)
def _agents_at_hand(tmp_path, monkeypatch):
    (tmp_path / "contract_at_hand.py").write_text(AGENTS)
    monkeypatch.syspath_prepend(tmp_path)


BROKEN = [
    ("FewActions", "expected act() to return 20 actions, one an environment, found shape (3,)"),
    ("Floats", "expected act() to return integer actions, found float64"),
    ("Ragged", "act() raised ValueError: setting an array element with a sequence"),
    ("TooHigh", "expected act() to return actions from 0 to 5, found 6"),
    ("Divides", "act() raised ZeroDivisionError: integer division or modulo by zero (contract_at_hand.py:42)"),
    ("OnlyActions", "expected act() to return (actions, state), found array([0, 0"),
    ("NoSeed", "build() raised TypeError: NoSeed.build() got an unexpected keyword argument 'seed'"),
    ("NoState", "initial_state() raised KeyError (contract_at_hand.py:"),
    ("Lost", "seed_episodes() raised RuntimeError: two lines (contract_at_hand.py:"),
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

    def test_message_when_it_breaks_in_a_worker(self, tmp_path):
        options = dataclasses.replace(OPTIONS, agent="contract_at_hand:Divides")
        with pytest.raises(RunError, match=r"^agent 'contract_at_hand:Divides': act\(\) raised ZeroDivisionError"):
            evaluate(options, tmp_path / "out", workers=2)


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
