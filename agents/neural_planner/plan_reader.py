"""Policies that read a plan: how they act in many environments at once, and what they keep for their learner."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from typing import Any, ClassVar

import numpy as np
import torch

from mazebench.agent import Inputs
from mazebench.constants import NUM_ACTIONS, YAW_RATE

from ..common.actor import NetworkAgent, acting
from ..common.layers import in_batches
from ..robot.body import Body
from .network import Choice, Situation, motion_features
from .neural_planner_config import NeuralPlannerConfig
from .planner_learner import PlannerLearner

# Grids and states are computed as many at once, always, since PyTorch rounds differently at another batch size.
_GRIDS_AT_ONCE = 8
_STATES_AT_ONCE = 32


@dataclasses.dataclass
class Robot:
    """The knowledge of one environment."""

    noise: np.random.Generator  # of its choice of actions
    memory: Any = None  # what the agent knows of the episode
    grid: np.ndarray = dataclasses.field(init=False)  # [..., L, L] uint8, of the last plan
    plan: Sequence[torch.Tensor] = ()  # of this grid
    age: int = 0  # steps of the leg
    actions: tuple[int, int] = (-1, -1)  # the last one, and the one before


@dataclasses.dataclass
class ActorState:
    """The state of acting in B environments."""

    robots: list[Robot | None]
    choice: Choice | None = None  # of the last step, while exploring


class PlanReader(NetworkAgent):
    """Plans on grids every few steps, and acts by a policy that reads the plan; a subclass says what it senses."""

    shipped_size = 31
    learner_class: ClassVar[type[PlannerLearner]] = PlannerLearner
    learns_several_tasks = True
    config: NeuralPlannerConfig
    _cell_size: float  # m

    @classmethod
    def task_options(cls, overrides: Any = None) -> dict[str, Any]:
        """Returns one goal an episode."""
        return {"num_goals": 1}

    def look(self, inputs: Inputs) -> Inputs:
        """Returns inputs with what is sensed in all environments at once."""
        return inputs

    def observe(self, memory: Any, inputs: Inputs, slot: int) -> Any:
        """Returns what is known of the episode in environment `slot` after an observation."""
        raise NotImplementedError

    def bodies(self, robots: list[Robot], observed: np.ndarray) -> list[Body]:
        """Returns the bodies of robots that observe the states `[K, 12]`."""
        raise NotImplementedError

    def grid(self, memory: Any) -> np.ndarray:
        """Returns what is planned on, `[..., L, L]` uint8."""
        raise NotImplementedError

    def sights(self, robots: list[Robot], bodies: list[Body], inputs: Inputs, slots: list[int]) -> np.ndarray:
        """Returns what the robots sense around their bodies, `[K, ...]`."""
        raise NotImplementedError

    def command(self, memory: Any, action: int) -> None:
        """Remembers the action that follows."""

    def explore_from(self, seed: int) -> None:
        """Begins a new stream of exploration."""
        self._rng, self._stream = np.random.default_rng([seed, 0]), seed

    def initial_state(self, batch_size: int) -> ActorState:
        """Returns no robots yet: one is made where an episode begins."""
        return ActorState([None] * batch_size)

    @acting
    def act(self, inputs: Inputs, state: ActorState, explore: bool = False) -> tuple[np.ndarray, ActorState]:
        """Returns actions `[B]`, drawn by the policy's probabilities at a low temperature."""
        # What the robots observe; they plan in their first step of a leg, and every few steps after it.
        slots = list(range(len(state.robots))) if inputs.active is None else np.flatnonzero(inputs.active).tolist()
        inputs, robots = self.look(inputs), []
        for slot in slots:
            robot = state.robots[slot]
            if robot is None or inputs.new_episode[slot]:
                robot = state.robots[slot] = Robot(np.random.default_rng(int(inputs.seed[slot])))
            robot.memory = self.observe(robot.memory, inputs, slot)
            if inputs.new_context[slot]:
                robot.age = 0  # the next leg has another goal
            robots.append(robot)
        self._plan([robot for robot in robots if robot.age % self.config.plan_steps == 0])

        # Actions by the policy, at temperature 1 for PPO.
        situation = self._situation(robots, inputs, slots)
        logits, value = self._read(robots, situation)
        exploring = explore and self.config.teacher == "reward"
        temperature = 1.0 if exploring else self.config.temperature
        noise = [(self._rng if explore else robot.noise).gumbel(size=NUM_ACTIONS) for robot in robots]
        chosen = (logits + temperature * np.array(noise).reshape(logits.shape)).argmax(axis=1)
        actions = np.zeros(len(state.robots), dtype=np.int64)
        for robot, slot, action in zip(robots, slots, chosen.tolist(), strict=True):
            self.command(robot.memory, action)
            robot.actions, robot.age = (action, robot.actions[0]), robot.age + 1
            actions[slot] = action

        if explore:
            log_probability = logits - np.log(np.exp(logits - logits.max(1, keepdims=True)).sum(1, keepdims=True))
            log_probability -= logits.max(1, keepdims=True)
            taken = np.take_along_axis(log_probability, chosen[:, None], axis=1)[:, 0]
            state.choice = Choice(self._stream, [robot.grid for robot in robots], situation, taken, value)
        return actions, state

    def notes(self, state: ActorState) -> Choice | None:
        """Returns the last choice."""
        return state.choice

    def _plan(self, robots: list[Robot]) -> None:
        """Plans for robots, those whose grids have one size at once."""
        for robot in robots:
            robot.grid = self.grid(robot.memory)
        for same in _of_one_size(robots):
            grids = torch.from_numpy(np.stack([robots[index].grid for index in same]))
            plan = in_batches(self.network.plan, _GRIDS_AT_ONCE, grids)
            for row, index in enumerate(same):
                robots[index].plan = [part[row] for part in plan]

    def _situation(self, robots: list[Robot], inputs: Inputs, slots: list[int]) -> Situation:
        """Returns the states of robots."""
        observed = inputs.observation["state"][slots]
        bodies = self.bodies(robots, observed)
        pose = np.array([(body.x, body.y, body.yaw) for body in bodies]).reshape(-1, 3)
        velocity = np.array([(body.forward, body.left) for body in bodies]).reshape(-1, 2)
        actions = np.array([robot.actions for robot in robots]).reshape(-1, 2)
        return Situation(
            torch.from_numpy(pose.astype(np.float32)),
            torch.from_numpy(self.sights(robots, bodies, inputs, slots)),
            torch.from_numpy(motion_features(np.column_stack([velocity, observed[:, YAW_RATE]]), actions)),
        )

    def _read(self, robots: list[Robot], situation: Situation) -> tuple[np.ndarray, np.ndarray]:
        """Returns logits `[K, 6]` and values `[K]` of the states of robots."""
        logits, value = np.zeros((len(robots), NUM_ACTIONS), np.float32), np.zeros(len(robots), np.float32)
        for same in _of_one_size(robots):
            plan = (torch.stack(parts) for parts in zip(*(robots[index].plan for index in same), strict=True))
            rows = (part[same] for part in situation)
            read = in_batches(self._act, _STATES_AT_ONCE, *plan, *rows)
            logits[same], value[same] = read[:, :-1].numpy(), read[:, -1].numpy()
        return logits, value

    def _act(self, *inputs: torch.Tensor) -> torch.Tensor:
        """Returns logits and value `[K, 7]` of states, each on a plan of its own."""
        *parts, pose, sight, motion = inputs
        plan = self.network.plan_class(*parts)
        logits, value = self.network(plan, torch.arange(len(pose)), Situation(pose, sight, motion))
        return torch.cat([logits, value[:, None]], dim=1)


def _of_one_size(robots: list[Robot]) -> Iterable[list[int]]:
    """Returns the indices of robots, those whose grids have one size together."""
    by_size: dict[int, list[int]] = {}
    for index, robot in enumerate(robots):
        by_size.setdefault(robot.grid.shape[-1], []).append(index)
    return by_size.values()
