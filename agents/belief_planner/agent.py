"""The belief planner: the navigator's robot, which plans over what a network believes of walls and goal.

docs/agents/belief-planner.md says what of it is learned and what is written by hand.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from mazebench.agent import Inputs, Interface

from ..common.actor import NetworkAgent, acting
from ..common.overrides import override
from ..robot.robot import Memory, Robot, believed_by_rule
from .config import BeliefPlannerConfig
from .learner import BeliefPlannerLearner
from .network import BeliefNetwork, View, believe

_PATIENCE = 3  # steps between two revisions of a belief on a leg, at least
_LEAST = 0.05  # probability of what came true, at least, so that no cell decides alone


@dataclasses.dataclass
class Belief:
    """What the network believed in one environment when it was asked last, and what the rule did."""

    walls: np.ndarray  # [L, L] float, the probability of a wall by the network
    goal: np.ndarray  # [L, L] float, that of the goal
    by_rule: np.ndarray  # [L, L] float, the probability of a wall by the rule
    is_seen: np.ndarray  # [L, L] bool, the cells that were seen then
    prior: np.ndarray  # [L, L] float, by the map
    advantage: float  # the network's log score in this episode, less that of the rule
    waited: int = 0  # steps since then


@dataclasses.dataclass
class ActorState:
    """The state of acting in B environments; None where no episode has begun."""

    memories: list[Memory | None]
    beliefs: list[Belief | None]


class BeliefPlanner(NetworkAgent):
    """Drives the robot along the paths that are best by its belief, which is learned."""

    name: ClassVar[str] = "belief-planner"
    default_config: ClassVar[BeliefPlannerConfig] = BeliefPlannerConfig()
    learner_class: ClassVar[type[BeliefPlannerLearner]] = BeliefPlannerLearner
    shipped_size = 21
    config: BeliefPlannerConfig
    network: BeliefNetwork

    def __init__(
        self,
        config: BeliefPlannerConfig,
        context_size: int,
        seed: int = 0,
        device: str = "cpu",
        *,
        interface: Interface | None = None,
    ):
        super().__init__(config, context_size, seed, device, interface=interface)
        self._robot = Robot(self.interface)

    @classmethod
    def make_network(cls, config: BeliefPlannerConfig, context_size: int) -> BeliefNetwork:
        """Returns a new network, which serves contexts of any size."""
        return BeliefNetwork(config)

    @classmethod
    def task_options(cls, overrides: Mapping[str, str] | None = None) -> dict[str, Any]:
        """Returns no options: what is learned does not depend on the task."""
        override(cls.default_config, overrides or {})
        return {}

    def initial_state(self, batch_size: int) -> ActorState:
        """Returns no memories yet: one is made where an episode begins."""
        return ActorState([None] * batch_size, [None] * batch_size)

    @acting
    def act(self, inputs: Inputs, state: ActorState, explore: bool = False) -> tuple[np.ndarray, ActorState]:
        """Returns actions `[B]`, for one environment after the other.

        Exploring, it goes by the rule, which takes less time: nothing is learned from what it does in training.
        """
        actions = np.zeros(len(state.memories), dtype=np.int64)
        for slot, memory in enumerate(state.memories):
            if inputs.active is not None and not inputs.active[slot]:
                continue
            state.memories[slot] = known = self._robot.observe(memory, inputs, slot)
            if inputs.new_episode[slot]:
                state.beliefs[slot] = None
            believed = by_rule = believed_by_rule(known)
            if not explore:
                belief = self._revised(state.beliefs[slot], known, by_rule[0], bool(inputs.new_context[slot]))
                state.beliefs[slot] = belief
                believed = _mixture(belief, known, *by_rule)
            actions[slot] = self._robot.command(known, *believed)
        return actions, state

    def _revised(self, belief: Belief | None, memory: Memory, by_rule: np.ndarray, is_new_leg: bool) -> Belief:
        """Returns the belief after what was just sensed: a new one on a new leg, or where some steps told more.

        `by_rule` `[L, L]` is the probability of a wall by the rule.
        """
        is_seen = memory.occupancy.is_seen()
        advantage = 0.0
        if belief is not None:
            belief.waited += 1
            came = is_seen & ~belief.is_seen
            is_due = belief.waited >= _PATIENCE and (came.any() or memory.prior is not belief.prior)
            if not (is_new_leg or is_due):
                return belief
            is_wall = memory.occupancy.evidence[came] > 0
            scores = [_log_score(walls[came], is_wall) for walls in (belief.walls, belief.by_rule)]
            advantage = belief.advantage + scores[0] - scores[1]
        view = View(memory.prior, memory.occupancy.evidence, memory.goal, memory.searched)
        walls, goal = believe(self.network, view)
        return Belief(walls, goal, by_rule, is_seen, memory.prior, advantage)


def _mixture(
    belief: Belief, memory: Memory, by_rule: np.ndarray, goal_by_rule: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Returns the probabilities of a wall and of the goal, `[L, L]` each, by the network and the rule together.

    Both predicted each cell before it was seen. Their weights are the probabilities that they gave to what came true,
    as in Bayesian model averaging. Where a cell was seen, the rule tells what it is.
    """
    is_seen = memory.occupancy.is_seen()
    share = 1 / (1 + math.exp(-max(belief.advantage, -50.0)))
    walls = np.where(is_seen, by_rule, share * belief.walls + (1 - share) * by_rule)
    goal = share * belief.goal * ~(memory.searched | (is_seen & (by_rule > 0.5))) + (1 - share) * goal_by_rule
    return walls, goal


def _log_score(walls: np.ndarray, is_wall: np.ndarray) -> float:
    """Returns the log of the probability that was given to what came true; `walls` `[K]` are those of a wall."""
    return float(np.log(np.maximum(np.where(is_wall, walls, 1 - walls), _LEAST)).sum())
