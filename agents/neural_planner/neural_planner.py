"""The neural planner: senses written by hand, a plan over costs that are learned, and a learned policy that drives.

docs/agents/neural_planner.md describes the network and both ways to train it.
"""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Iterable
from typing import ClassVar, Self

import numpy as np
import torch
from torch.nn import functional

from mazebench.agent import Inputs, Interface, Report
from mazebench.constants import NUM_ACTIONS, YAW_RATE
from mazebench.tasks.task import Task

from ..common.actor import acting
from ..common.layers import in_batches
from ..common.rollouts import RolloutLearner, Rows
from ..imitation import ImitatingAgent, ImitationLearner
from ..robot.change_belief import ChangeBelief, reads_maps_of
from ..robot.change_network import ChangeNetwork, load
from ..robot.map_reading import map_reader
from ..robot.motion import Motion, moved_in_the_open
from ..robot.rays import ranges_to
from ..robot.senses import Memory, Senses, range_sensor, report
from .network import NUM_RANGES, REACH, Plan, PlannerNetwork, Situation, grid_bytes, motion_features
from .neural_planner_config import NeuralPlannerConfig
from .reward_learner import Choice, RewardLearner

# Grids and states are computed as many at once, always, since PyTorch rounds differently at another batch size.
_GRIDS_AT_ONCE = 8
_STATES_AT_ONCE = 32
_WALL = 0.5  # probability from which a cell is a wall for these ranges


@dataclasses.dataclass
class Robot:
    """The knowledge of one environment."""

    memory: Memory
    noise: np.random.Generator  # of its choice of actions
    grid: np.ndarray = dataclasses.field(init=False)  # [4, L, L] uint8, of the last plan
    plan: Plan = dataclasses.field(init=False)  # of [L, L] each
    age: int = 0  # steps of the leg
    actions: tuple[int, int] = (-1, -1)  # the last one, and the one before
    changes: ChangeBelief | None = None  # of what its map has wrong, if it has any such belief

    @property
    def prior(self) -> np.ndarray:
        """The probability of a wall by the map, `[L, L]` float."""
        believed = None if self.changes is None else self.changes.prior
        return self.memory.prior if believed is None else believed

    def estimate(self) -> tuple[np.ndarray, np.ndarray]:
        """Returns what `Memory.estimate` does, by its prior."""
        return self.memory.estimate(None if self.changes is None else self.changes.prior)


@dataclasses.dataclass
class ActorState:
    """The state of acting in B environments."""

    robots: list[Robot | None]
    choice: Choice | None = None  # of the last step, while exploring


class NeuralPlanner(ImitatingAgent):
    """Plans on what its senses tell, every few steps, and acts by a policy that reads the plan."""

    name: ClassVar[str] = "neural-planner"
    shipped_size = 31
    default_config: ClassVar[NeuralPlannerConfig] = NeuralPlannerConfig()
    learns_several_tasks = True
    senses_class: ClassVar[type[Senses]] = Senses
    believes: ClassVar[bool] = False  # whether a network tells it where its map is probably wrong
    read_sensors = staticmethod(range_sensor)
    map_reader = staticmethod(map_reader)
    config: NeuralPlannerConfig
    network: PlannerNetwork
    _senses: Senses
    _cell_size: float  # m
    _changes: ChangeNetwork | None

    @classmethod
    def make_network(cls, config: NeuralPlannerConfig, context_size: int) -> PlannerNetwork:
        """Returns a new network, which plans on grids of any size."""
        return PlannerNetwork(config.channels, config.hidden, config.ways)

    @staticmethod
    def learner_class(agent: NeuralPlanner, task: Task, seed: int) -> RolloutLearner:
        """Returns the learner that the config's teacher teaches."""
        return ImitationLearner(agent, task, seed) if agent.config.teacher == "oracle" else RewardLearner(agent, seed)

    def for_interface(self, interface: Interface) -> Self:
        """Returns an agent with the same network, whose senses are those in the environments of an interface."""
        agent = copy.copy(self)
        agent._senses, agent._cell_size = self.senses_class(interface, self.name), interface.cell_size
        agent._changes = load() if self.believes and reads_maps_of(interface) else None
        return agent

    def rate(self, parameter: str) -> float:
        """Returns that of the config for the costs of cells."""
        return self.config.cost_rate if parameter.startswith("costs.") else 1.0

    def explore_from(self, seed: int) -> None:
        """Begins a new stream of exploration."""
        self._rng = np.random.default_rng([seed, 0])

    def initial_state(self, batch_size: int) -> ActorState:
        """Returns no robots yet: one is made where an episode begins."""
        return ActorState([None] * batch_size)

    @acting
    def act(self, inputs: Inputs, state: ActorState, explore: bool = False) -> tuple[np.ndarray, ActorState]:
        """Returns actions `[B]`, drawn by the policy's probabilities at a low temperature."""
        # What the robots observe; they plan in their first step of a leg, and every few steps after it.
        slots = list(range(len(state.robots))) if inputs.active is None else np.flatnonzero(inputs.active).tolist()
        inputs, robots = self._senses.look(inputs), []
        for slot in slots:
            robot = state.robots[slot]
            memory = self._senses.observe(robot.memory if robot else None, inputs, slot)
            if robot is None or robot.memory is not memory:  # an episode begins
                robot = state.robots[slot] = Robot(memory, np.random.default_rng(int(inputs.seed[slot])))
                robot.changes = None if self._changes is None else ChangeBelief(self._changes)
            if inputs.new_context[slot]:
                robot.age = 0  # the next leg has another goal
            if robot.changes is not None:
                robot.changes.update(memory, bool(inputs.new_context[slot]))
            robots.append(robot)
        self._plan([robot for robot in robots if robot.age % self.config.plan_steps == 0])

        # Actions by the policy, at temperature 1 for PPO.
        situation = self._situation(robots, inputs.observation["state"][slots])
        logits, value = self._read(robots, situation)
        exploring = explore and self.config.teacher == "reward"
        temperature = 1.0 if exploring else self.config.temperature
        noise = [(self._rng if explore else robot.noise).gumbel(size=NUM_ACTIONS) for robot in robots]
        chosen = (logits + temperature * np.array(noise).reshape(logits.shape)).argmax(axis=1)

        # The robots remember their actions, and where these should bring the body if no wall is in the way.
        actions = np.zeros(len(state.robots), dtype=np.int64)
        for robot, slot, action in zip(robots, slots, chosen.tolist(), strict=True):
            body = robot.memory.body
            vx, vy = (self._cell_size * speed for speed in body.velocity())
            x, y, _, _ = moved_in_the_open(Motion.of(body.model), vx, vy, body.yaw, action)
            robot.memory.command(action, (body.x + x / self._cell_size, body.y + y / self._cell_size))
            robot.actions, robot.age = (action, robot.actions[0]), robot.age + 1
            actions[slot] = action

        if explore:
            log_probability = logits - np.log(np.exp(logits - logits.max(1, keepdims=True)).sum(1, keepdims=True))
            log_probability -= logits.max(1, keepdims=True)
            taken = np.take_along_axis(log_probability, chosen[:, None], axis=1)[:, 0]
            state.choice = Choice([robot.grid for robot in robots], situation, taken, value)
        return actions, state

    def report(self, state: ActorState) -> Report:
        """Returns where the robots are on the maps, by the likeliest way in which these may lie."""
        return report(robot.memory if robot else None for robot in state.robots)

    def notes(self, state: ActorState) -> Choice | None:  # type: ignore[override]
        """Returns the last choice."""
        return state.choice

    def read(self, rows: Rows) -> tuple[torch.Tensor, dict[str, torch.Tensor]]:
        """Returns log probabilities `[R, 6]` of actions in rows, and scalars to log by name."""
        log_probabilities, _, scalars = self.evaluated(rows)
        return log_probabilities, scalars

    def evaluated(self, rows: Rows) -> tuple[torch.Tensor, torch.Tensor, dict[str, torch.Tensor]]:
        """Returns log probabilities `[R, 6]` and values `[R]` of rows, and scalars to log by name."""
        plan = self.network.plan(rows.shared)
        logits, value = self.network(plan, rows.group, Situation(*rows.parts))
        log_probabilities, wall = functional.log_softmax(logits, dim=1), plan.wall > 0.5
        entropy = -(log_probabilities.exp() * log_probabilities).sum(dim=1).mean()
        costs = {"wall_cost": plan.cost[wall].mean(), "free_cost": plan.cost[~wall].mean()}
        return log_probabilities, value, {"entropy": entropy, **costs}

    def _plan(self, robots: list[Robot]) -> None:
        """Plans for robots, those whose grids have one size at once."""
        for robot in robots:
            memory = robot.memory
            walls, goal = robot.estimate()
            robot.grid = grid_bytes(robot.prior, walls, memory.evidence, goal)
        for same in _of_one_size(robots):
            grids = torch.from_numpy(np.stack([robots[index].grid for index in same]))
            plan = in_batches(self.network.plan, _GRIDS_AT_ONCE, grids)
            for row, index in enumerate(same):
                robots[index].plan = Plan(*(part[row] for part in plan))

    def _situation(self, robots: list[Robot], observed: np.ndarray) -> Situation:
        """Returns the states of robots, whose observed ones `[K, 12]` tell how fast they turn."""
        bodies = [robot.memory.body for robot in robots]
        pose = np.array([(body.x, body.y, body.yaw) for body in bodies]).reshape(-1, 3)
        velocity = np.array([(body.forward, body.left) for body in bodies]).reshape(-1, 2)
        ranges = [
            ranges_to(robot.estimate()[0] > _WALL, *where, NUM_RANGES, REACH)
            for robot, where in zip(robots, pose.tolist(), strict=True)
        ]
        actions = np.array([robot.actions for robot in robots]).reshape(-1, 2)
        return Situation(
            torch.from_numpy(pose.astype(np.float32)),
            torch.from_numpy(np.array(ranges, dtype=np.float32).reshape(-1, NUM_RANGES)),
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
        plan, situation = Plan(*inputs[:3]), Situation(*inputs[3:])
        logits, value = self.network(plan, torch.arange(len(plan.way)), situation)
        return torch.cat([logits, value[:, None]], dim=1)


def _of_one_size(robots: list[Robot]) -> Iterable[list[int]]:
    """Returns the indices of robots, those whose grids have one size together."""
    by_size: dict[int, list[int]] = {}
    for index, robot in enumerate(robots):
        by_size.setdefault(robot.grid.shape[-1], []).append(index)
    return by_size.values()
