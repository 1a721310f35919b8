"""The belief planner: how it weighs the network against the rule, when it asks it, and what it reaches untrained."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from mazebench_agents.belief_planner import BeliefPlanner, agent
from mazebench_agents.belief_planner.agent import Belief, _mixture
from mazebench_agents.robot.robot import Robot, believed_by_rule

from mazebench.agent import Inputs, Interface
from mazebench.evaluation.chunk import run_trials
from mazebench.maps.benchmark import load_mazes
from mazebench.tasks.build import make_spec
from mazebench.tasks.context import build_context
from mazebench.tasks.trials import draw_trials

INTERFACE = Interface("local", 13, 13)


def first_inputs(new_episode: bool = True) -> Inputs:
    """A body at rest in the middle of the start of a train maze, which is shown as it is."""
    maze = load_mazes(13, "train")[0]
    start, goal = maze.free_cells[0], maze.free_cells[-1]
    state = np.zeros((1, 12), dtype=np.float32)
    state[0, :2] = start[1] + 0.5, 12.5 - start[0]
    context = build_context(maze.walls, start, goal, 13)[None]
    flag = np.array([new_episode])
    return Inputs({"state": state, "context": context}, flag, flag, np.zeros(1, dtype=np.int64))


class TestMixture:
    @pytest.fixture
    def memory(self):
        return Robot(INTERFACE).observe(None, first_inputs(), 0)

    def belief(self, memory, advantage: float) -> Belief:
        walls, goal = np.full((13, 13), 0.25), np.full((13, 13), 1 / 169)
        return Belief(walls, goal, believed_by_rule(memory)[0], memory.occupancy.is_seen(), memory.prior, advantage)

    def test_a_network_that_predicted_as_well_as_the_rule_counts_half(self, memory):
        walls, _ = _mixture(self.belief(memory, 0.0), memory, *believed_by_rule(memory))
        by_rule = believed_by_rule(memory)[0]
        is_seen = memory.occupancy.is_seen()
        np.testing.assert_allclose(walls[~is_seen], (by_rule[~is_seen] + 0.25) / 2)
        np.testing.assert_array_equal(walls[is_seen], by_rule[is_seen])

    @pytest.mark.parametrize("advantage", [-1e6, -20.0])
    def test_a_network_that_predicted_worse_counts_nothing(self, memory, advantage):
        rule = believed_by_rule(memory)
        for mixed, by_rule in zip(_mixture(self.belief(memory, advantage), memory, *rule), rule, strict=True):
            np.testing.assert_allclose(mixed, by_rule, atol=1e-6)

    def test_the_goal_is_in_no_cell_that_was_searched(self, memory):
        _, goal = _mixture(self.belief(memory, 1e6), memory, *believed_by_rule(memory))
        assert goal[memory.cell] == 0
        assert goal.sum() > 0.9


class TestRevision:
    def test_the_network_is_asked_at_once_on_a_new_leg_and_then_after_some_steps_that_told_more(self, monkeypatch):
        asked = []
        believe = agent.believe
        monkeypatch.setattr(agent, "believe", lambda *given: asked.append(1) or believe(*given))
        planner = BeliefPlanner(BeliefPlanner.default_config, 13, interface=INTERFACE)
        state, inputs = planner.initial_state(1), first_inputs()
        _, state = planner.act(inputs, state)
        assert len(asked) == 1
        still = inputs._replace(new_episode=np.array([False]), new_context=np.array([False]))
        for _ in range(10):
            _, state = planner.act(still, state)
        assert 1 <= len(asked) <= 2  # what the body meets becomes certain once; nothing more is told
        _, state = planner.act(still._replace(new_context=np.array([True])), state)
        assert state.beliefs[0].waited == 0

    def test_the_advantage_is_what_the_network_gave_to_what_came_true(self):
        planner = BeliefPlanner(BeliefPlanner.default_config, 13, interface=INTERFACE)
        memory = Robot(INTERFACE).observe(None, first_inputs(), 0)
        belief = planner._revised(None, memory, believed_by_rule(memory)[0], True)
        cell = (6, 6)
        belief.walls[cell], belief.by_rule[cell], belief.waited = 0.8, 0.2, 10
        memory.occupancy.evidence[cell] = 8.0
        revised = planner._revised(belief, memory, believed_by_rule(memory)[0], False)
        assert revised.advantage == pytest.approx(np.log(0.8 / 0.2))


@pytest.mark.parametrize(("options", "least"), [({}, 0.95), ({"map_flip": 0.1}, 0.85), ({"sensors": ("lidar",)}, 0.95)])
def test_untrained_it_reaches_goals_as_the_rule_does(options, least):
    spec = make_spec(maps=load_mazes(13, "train")[:6], distances=(4, 8), **options)
    interface = dataclasses.replace(INTERFACE, sensors=spec.sensors)
    planner = BeliefPlanner(BeliefPlanner.default_config, 13, interface=interface)
    played = run_trials(planner, spec, list(enumerate(draw_trials(spec, 2))), 64)
    assert np.mean([outcome.success for outcomes in played for outcome in outcomes]) >= least
