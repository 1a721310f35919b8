"""The belief planner: it plans shortest paths over its belief of the maze, where the shown map is the prior.

docs/agents/belief-planner.md says what of it is learned and what is written by hand.
"""

from __future__ import annotations

import dataclasses
import pathlib
from typing import Any, ClassVar, Self

import numpy as np
import torch

from mazebench.agent import Inputs, Interface, Observation
from mazebench.maps.maze import cell_to_point, point_to_cell

from ..common.actor import NetworkAgent, one_torch_thread
from ..common.bounds import bounded
from ..common.layers import in_batches, state_features
from ..muzero.network import CONTEXTS_AT_ONCE, NUM_ACTIONS, STATES_AT_ONCE, with_codes
from .belief import GOAL, NUM_PLANES, WALL, probabilities
from .config import BeliefPlannerConfig
from .displacement import Displacement, turned
from .evidence import FAILED, NUM_EVIDENCE, PASSED, SENSED, Readings, place
from .framing import framed
from .learner import BeliefPlannerLearner
from .network import REACH, BeliefPlannerNetwork, Code, distance_at
from .scan_match import find_pose, is_odometry

_AWAY = 3.0  # cells from where a goal was brought nearer, at which it is brought nearer again
_ROUNDING = 1e-3  # m, of positions as float32
_PATIENCE = 6  # steps between two revisions on a leg, at least
_SURPRISING = 0.1  # how much evidence must change where it contradicts the belief, before the belief is revised


@dataclasses.dataclass
class ActorState:
    """The state of acting in B environments."""

    code: Code | None  # of B contexts; None before the first step
    displacement: Displacement
    turn: np.ndarray  # [B] float32, rad, from the observed pose's frame to the map's; 0 unless it is odometry
    anchor: np.ndarray  # [B, 2] float32, the position where the episode began
    shown: np.ndarray  # [B, 2, M, M] float32, the map, and the mark of the leg's goal
    evidence: np.ndarray  # [B, 3, M, M] float32
    weighed: np.ndarray  # [B, 3, M, M] float32, the evidence when the belief was last revised
    belief: np.ndarray  # [B, 2, M, M] float32
    revised_at: np.ndarray  # [B, 2] float32, the position when the belief was last revised
    waited: np.ndarray  # [B] int, the steps since then
    is_far: np.ndarray  # [B] bool, whether the goal had to be brought nearer then
    wished: np.ndarray  # [B, 2] float32, the velocity on the map after this step without obstacles; 0 at first


class BeliefPlanner(NetworkAgent):
    """Drives by a learned policy along shortest paths over a belief of the maze, which evidence revises."""

    name: ClassVar[str] = "belief-planner"
    default_config: ClassVar[BeliefPlannerConfig] = BeliefPlannerConfig()
    learner_class: ClassVar[type[BeliefPlannerLearner]] = BeliefPlannerLearner
    learns_on_gpu = True
    config: BeliefPlannerConfig
    network: BeliefPlannerNetwork
    _size: int  # M, the side of the map that is believed in, in cells
    _points_tell: bool = True  # whether a cell of that map is a metre, so that the position tells the cell

    def __init__(self, config: BeliefPlannerConfig, context_size: int, seed: int = 0, device: str = "cpu"):
        super().__init__(config, context_size, seed, device)
        self._size = context_size

    @classmethod
    def make_network(cls, config: BeliefPlannerConfig, context_size: int) -> BeliefPlannerNetwork:
        """Returns a new network, which serves contexts of any size."""
        return BeliefPlannerNetwork(config)

    @classmethod
    def build(cls, interface: Interface, *, seed: int = 0, checkpoint: pathlib.Path | None = None) -> Self:
        """Returns the agent of a checkpoint, by default of the one that ships.

        Raises:
          InputError: if the checkpoint can't be used here.
        """
        agent = super().build(interface, seed=seed, checkpoint=checkpoint)
        agent._size = min(interface.size, interface.context_size)
        agent._points_tell = agent._size == interface.size and interface.cell_size == 1.0
        return agent

    @classmethod
    def measure(cls, seconds: float) -> dict[str, list[dict[str, Any]]]:
        """Returns tables for `mazebench bench`: of the parts of acting, and of an update."""
        from ..muzero.measure import acting_table, update_table

        shipped = cls.build(Interface("local", 13, 13, sensors=("lidar",)))
        return acting_table(seconds, shipped) | update_table(seconds, cls.build_learner)

    def initial_state(self, batch_size: int) -> ActorState:
        """Returns a state without beliefs: `act` forms one where a context is new."""

        def planes(number: int) -> np.ndarray:
            return np.zeros((batch_size, number, self._size, self._size), dtype=np.float32)

        def vectors() -> np.ndarray:
            return np.zeros((batch_size, 2), dtype=np.float32)

        maps = planes(NUM_PLANES), planes(NUM_EVIDENCE), planes(NUM_EVIDENCE), planes(NUM_PLANES)
        turn = np.zeros(batch_size, dtype=np.float32)
        waited, is_far = np.zeros(batch_size, dtype=np.int64), np.zeros(batch_size, dtype=bool)
        displacement = Displacement(batch_size)
        return ActorState(None, displacement, turn, vectors(), *maps, vectors(), waited, is_far, vectors())

    @torch.no_grad()
    @one_torch_thread()
    def act(self, inputs: Inputs, state: Any, explore: bool = False) -> tuple[np.ndarray, ActorState]:
        """Returns actions `[B]`; the belief is revised where a context is new, or where evidence contradicts it."""
        inputs = bounded(inputs)
        for row in np.flatnonzero(inputs.new_context).tolist():
            self._begin_leg(row, inputs, state)
        observed = inputs.observation["state"].copy()
        observed[:, :2] = moved = turned(state.displacement.update(observed, inputs.new_episode), state.turn)
        observed[:, 5] += state.turn
        features = state_features(torch.from_numpy(observed), torch.zeros(len(observed), 2))
        position = state.anchor + self.network.on_map(self._tensor(moved)).cpu().numpy()
        self._note(inputs, features, observed[:, 5], position, state)
        has_moved = np.abs(position - state.revised_at).sum(axis=1) > _AWAY
        state.waited += 1
        is_due = (state.waited >= _PATIENCE) & (_surprised(state) | (state.is_far & has_moved))
        active = np.ones(len(moved), dtype=bool) if inputs.active is None else inputs.active
        self._revise(np.flatnonzero((inputs.new_context | is_due) & active), position, state)
        assert state.code is not None, "new_context must be set in an environment's first step"
        action = np.where(active, self._chosen(features, state.code, explore), 0)
        taken = self._tensor(features), self._tensor(action).long()
        state.wished = in_batches(self.network.wished, STATES_AT_ONCE, *taken).cpu().numpy()
        return action, state

    def _chosen(self, features: torch.Tensor, code: Code, explore: bool) -> np.ndarray:
        """Returns actions `[B]` by the policy in states with features `[B, 9]`.

        Exploring, the first environment draws from the policy, and the last one takes its best action; those between
        draw with less and less noise.
        """
        logits = in_batches(self._policy_logits, STATES_AT_ONCE, self._tensor(features)[:, None], *code)
        scores = logits[:, 0].cpu().numpy()
        if not explore:
            return scores.argmax(axis=1)
        noise = self._noise_scale[:, None] * self._rng.gumbel(size=scores.shape)
        return self._explored((scores + noise).argmax(axis=1), NUM_ACTIONS)

    def _policy_logits(self, features: torch.Tensor, *code: torch.Tensor) -> torch.Tensor:
        """Returns logits `[K, 1, 6]` of states with features `[K, 1, 9]`, each with the parts of a code of its own."""
        latent, whole = self.network.encode(features), Code(*code)
        return self.network.predict(latent, self.network.look(latent, whole), whole).policy_logits

    def _begin_leg(self, row: int, inputs: Inputs, state: ActorState) -> None:
        """Takes in a new context, and in a new episode forgets the evidence and the anchor."""
        state.shown[row], starts = framed(inputs.observation["context"][row], self._size)
        state.evidence[row, PASSED] = 0.0
        if inputs.new_episode[row]:
            state.evidence[row], state.wished[row] = 0.0, 0.0
            pose = self._first_pose(inputs.observation, row, state.shown[row, WALL], starts)
            state.anchor[row], state.turn[row] = pose

    def _first_pose(
        self, observation: Observation, row: int, walls: np.ndarray, starts: np.ndarray
    ) -> tuple[np.ndarray, float]:
        """Returns the cell where an episode begins, and the angle (rad) from the observed pose's frame to the map's.

        An episode begins in the centre of a cell, so a position that is a cell's centre is believed. Any other one is
        noisy, or the origin of odometry. Then the marked start is believed. The lidar tells the heading of odometry
        and, if no start is marked, the cell.

        Args:
          observation: the first one of the episode in environment `row`, and others.
          walls: `[M, M]` float32, the shown map.
          starts: `[S, 2]` int, the marked starts, one or none.
        """
        observed = observation["state"][row]
        cell = point_to_cell(observed[:2], self._size)
        if self._points_tell and np.abs(cell_to_point(cell, self._size) - observed[:2]).max() < _ROUNDING:
            return cell, 0.0
        if "lidar" in observation and is_odometry(observed):
            cells = starts if len(starts) else np.argwhere(walls <= max(0.5, walls.min()))
            return find_pose(walls, observation["lidar"][row], cells, self.network.metre())
        return starts[0] if len(starts) else np.full(2, (self._size - 1) / 2), 0.0

    def _note(
        self, inputs: Inputs, features: torch.Tensor, yaw: np.ndarray, position: np.ndarray, state: ActorState
    ) -> None:
        """Adds what is observed to the evidence."""
        batch_size = len(position)
        readings = Readings(
            np.arange(batch_size),
            np.ones(batch_size, dtype=bool),
            position,
            self.network.velocity(self._tensor(features)).cpu().numpy(),
            state.wished,
            yaw,
            inputs.observation.get("lidar", np.zeros((batch_size, 0), dtype=np.float32)),
        )
        place(state.evidence, readings, self.network.metre())

    def _revise(self, rows: np.ndarray, position: np.ndarray, state: ActorState) -> None:
        """Writes beliefs and codes of the contexts at `rows`."""
        if not len(rows):
            return
        arrays = state.shown[rows], state.evidence[rows], state.anchor[rows], position[rows]
        believed, code = self._believed(*(self._tensor(array) for array in arrays))
        state.belief[rows], state.weighed[rows], state.waited[rows] = believed.cpu().numpy(), state.evidence[rows], 0
        farthest = distance_at(self._tensor(position[rows]), code.distance).amax(dim=-1)
        state.revised_at[rows], state.is_far[rows] = position[rows], (farthest > REACH).cpu().numpy()
        state.code = with_codes(state.code, len(state.waited), torch.from_numpy(rows).to(believed.device), code)

    def _believed(
        self, shown: torch.Tensor, evidence: torch.Tensor, anchor: torch.Tensor, position: torch.Tensor
    ) -> tuple[torch.Tensor, Any]:
        """Returns beliefs `[K, 2, M, M]` and codes of K contexts."""
        belief = self.network.belief

        def believe(shown: torch.Tensor, evidence: torch.Tensor) -> torch.Tensor:
            return probabilities(belief(shown, evidence), evidence)

        believed = in_batches(believe, CONTEXTS_AT_ONCE, shown, evidence)
        return believed, in_batches(self.network.hypermodel, CONTEXTS_AT_ONCE, believed, anchor, position)

    def _tensor(self, array: np.ndarray | torch.Tensor) -> torch.Tensor:
        return torch.as_tensor(array).to(self.network.support.device)


def _surprised(state: ActorState) -> np.ndarray:
    """Returns `[B]` bool: where evidence that came since the belief was revised contradicts it."""
    came = state.evidence - state.weighed
    contradicts = np.abs(came[:, SENSED]) * np.abs((state.evidence[:, SENSED] > 0) - state.belief[:, WALL])
    missed = came[:, PASSED] * state.belief[:, GOAL]
    stopped = came[:, FAILED] * (1 - state.belief[:, WALL])
    return np.maximum(np.maximum(contradicts, missed), stopped).max(axis=(1, 2)) > _SURPRISING
