"""An agent that breaks its contract: one line that names it and says what it did."""

from __future__ import annotations

import re
import sys

import numpy as np
import pytest
from acting import inputs_of
from run_folders import RECORDED, files_of, records_of

from mazebench.agent import Agent
from mazebench.errors import InputError
from mazebench.evaluation.checked_agent import AgentError, CheckedAgent
from mazebench.evaluation.evaluate import evaluate


def evaluate_at_hand(name, out, **running):
    return evaluate(f"contract_at_hand:{name}", out=out, distances=(1,), episodes_per_distance=1, **running)


AGENTS = """
import os
import numpy as np
from mazebench.agent import Agent


class Good(Agent):
    def act(self, inputs, state, explore=False):
        return self.answer(len(inputs.seed)), state

    def answer(self, batch_size):
        return np.zeros(batch_size, dtype=np.uint8)


class TooHigh(Good):
    def answer(self, batch_size):
        return np.full(batch_size, 6)


class Divides(Good):
    def answer(self, batch_size):
        return 1 // 0  # line 22


class NoSeed(Good):
    @classmethod
    def build(cls, interface):
        return cls()




class InLibrary(Good):
    def answer(self, batch_size):
        import json

        return json.loads("{")  # line 37





class Stops(Good):
    def answer(self, batch_size):
        return next(iter([]))


class Exits(Good):
    def answer(self, batch_size):
        raise GeneratorExit


class Mute(Good):
    def answer(self, batch_size):
        class Fault(Exception):
            def __str__(self):
                raise RuntimeError("no text")

        raise Fault


class Strict(Good):
    def __init__(self):
        np.seterr(all="raise")


class Lost(Good):
    def __init__(self):
        os.chdir("/")


class Builds(Good):
    @classmethod
    def build(cls, interface, **given):
        return None


class Wanders(Good):
    def answer(self, batch_size):
        os.chdir("/")
        return super().answer(batch_size)


class Forks(Good):
    def answer(self, batch_size):
        if (child := os.fork()) == 0:
            raise SystemExit
        os.waitpid(child, 0)
        return super().answer(batch_size)


class ForksOn(Good):
    def answer(self, batch_size):
        if child := os.fork():
            os.waitpid(child, 0)
        return super().answer(batch_size)


class Late(Good):
    def initial_state(self, batch_size):
        return 0

    def act(self, inputs, state, explore=False):
        assert state < 120
        return np.full(len(inputs.seed), 4), state + 1
"""


@pytest.fixture(autouse=True)
def _agents_at_hand(tmp_path, monkeypatch):
    (tmp_path / "contract_at_hand.py").write_text(AGENTS)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "contract_at_hand", raising=False)


BROKEN = [
    ("TooHigh", "expected actions from 0 to 5 from act(), found 6"),
    ("Divides", "act() raised ZeroDivisionError: integer division or modulo by zero (contract_at_hand.py:22)"),
    ("NoSeed", "build() raised TypeError: NoSeed.build() got an unexpected keyword argument 'seed'"),
    ("Stops", "act() raised StopIteration (contract_at_hand.py:"),
    ("Exits", "act() raised GeneratorExit (contract_at_hand.py:"),
    ("Mute", "act() raised Fault (contract_at_hand.py:"),
    ("Builds", "expected an Agent from build(), found NoneType"),
    ("InLibrary", "act() raised JSONDecodeError: Expecting property name enclosed in double quotes"),
]


class TestEvaluation:
    @pytest.mark.parametrize(("name", "said"), BROKEN, ids=[name for name, _ in BROKEN])
    def test_an_agent_that_breaks_its_contract_is_named_in_one_line(self, tmp_path, name, said):
        with pytest.raises(AgentError) as caught:
            evaluate_at_hand(name, tmp_path / "out")
        assert str(caught.value).startswith(f"agent 'contract_at_hand:{name}': {said}")
        assert "\n" not in str(caught.value)

    def test_where_a_library_raised_the_agents_line_is_named(self, tmp_path):
        with pytest.raises(AgentError, match=r"\(contract_at_hand\.py:37\)$"):
            evaluate_at_hand("InLibrary", tmp_path / "out")

    @pytest.mark.parametrize("name", ["Strict", "Wanders", "Lost", "Forks", "ForksOn"])
    def test_what_an_agent_does_to_its_process_changes_no_result(self, tmp_path, monkeypatch, name):
        monkeypatch.chdir(tmp_path)
        evaluate_at_hand("Good", "good")
        evaluate_at_hand(name, "out")
        good, found = ([each | {"agent": ""} for each in records_of(tmp_path / out)] for out in ("good", "out"))
        assert found == good
        assert set(files_of(tmp_path / "out")) == RECORDED

    @pytest.mark.parametrize(
        ("declared", "value", "said"),
        [
            ("needs_truth", 1, "expected needs_truth as True or False, found 1"),
            ("learns", "yes", "expected learns as True or False, found 'yes'"),
            ("plays_actions", (), r"expected plays_actions as a tuple of six, .*, found \(\)"),
            ("plays_actions", "velocity", "expected plays_actions as a tuple of six, .*, found 'velocity'"),
            ("needs_sensors", "lidar", "expected needs_sensors as a tuple of .*, lidar, found 'lidar'"),
            ("needs_shown", ("walls",), r"expected needs_shown as a tuple of map, goal, found \('walls',\)"),
        ],
    )
    def test_a_declaration_that_can_not_be_met_is_refused_before_a_step(self, declared, value, said):
        with pytest.raises(InputError, match=f"{said}$"):
            evaluate(type("Declares", (Agent,), {declared: value}))

    def test_a_folder_without_episodes_can_be_used_again(self, tmp_path):
        with pytest.raises(AgentError):
            evaluate_at_hand("Divides", tmp_path / "out", record=True)
        assert evaluate_at_hand("Good", tmp_path / "out", record=False).episodes == 20
        assert not (tmp_path / "out" / "trajectories.npz").exists()


def test_the_command_says_what_is_kept_and_shows_a_traceback_if_asked(command):
    # With one environment at a time, so that some episodes end before the agent breaks.
    words = ["eval", "--distances", "1", "--episodes-per-distance", "1", "--num-envs", "1", "--out", "run"]
    words += ["--agent", "contract_at_hand:Late"]
    _, _, plain = command(*words)
    status, _, loud = command(*words, "--resume", "--traceback")
    *_, line = plain.splitlines()
    said = r"mazebench: agent 'contract_at_hand:Late': act\(\) raised AssertionError \(contract_at_hand.py:\d+\)"
    assert re.fullmatch(said + "; 1 of 20 episodes are kept in run", line)
    assert status == 1
    assert "Traceback" not in plain
    assert "assert state < 120" in loud
    assert loud.splitlines()[-1] == line.replace("1 of 20", "2 of 20")


class TestCheckedAgent:
    def test_actions_in_a_list_become_an_array(self):
        class Still(Agent):
            def initial_state(self, batch_size):
                return batch_size

            def act(self, inputs, state, explore=False):
                return [0] * len(inputs.seed), state + 1

        agent = CheckedAgent("still", Still(), "six")
        actions, state = agent.act(inputs_of({}, np.ones(2, dtype=bool)), agent.initial_state(2))
        assert (actions.tolist(), state) == ([0, 0], 3)
