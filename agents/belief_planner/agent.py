"""The belief planner: it plans shortest paths over its belief of the maze, where the shown map is the prior.

docs/agents/belief-planner.md says what of it is learned and what is written by hand.
"""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np
import torch

from mazebench.agent import Inputs, Interface, Observation
from mazebench.maps.maze import cell_to_point, point_to_cell
from mazebench.world.lidar import LidarModel

from ..common.actor import NetworkAgent, acting
from ..common.layers import in_batches, state_features
from ..muzero.network import CONTEXTS_AT_ONCE, NUM_ACTIONS, STATES_AT_ONCE, with_codes
from ..robot.body import YAW, X, Y
from ..robot.odometry import Displacement, turned
from .belief import GOAL, NUM_PLANES, WALL, probabilities
from .config import BeliefPlannerConfig
from .evidence import FAILED, NUM_EVIDENCE, PASSED, SENSED, Readings, add_readings
from .framing import framed
from .learner import BeliefPlannerLearner
from .network import REACH, BeliefPlannerNetwork, Code, distance_at
from .scan_match import find_pose, is_odometry

_AWAY = 3.0  # cells from where a goal was brought nearer, at which it is brought nearer again
_ROUNDING = 1e-3  # m, of positions as float32
PATIENCE = 6  # steps between two revisions on a leg, at least
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
    needs_shown: ClassVar[tuple[str, ...]] = ("map", "goal")
    default_config: ClassVar[BeliefPlannerConfig] = BeliefPlannerConfig()
    learner_class: ClassVar[type[BeliefPlannerLearner]] = BeliefPlannerLearner
    learns_on_gpu = True
    config: BeliefPlannerConfig
    network: BeliefPlannerNetwork

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
        # M, the side of the map that is believed in, in cells.
        self._size = min(self.interface.size, self.interface.context_size)
        # Whether a cell of that map is a metre, so that the position tells the cell.
        self._points_tell = self._size == self.interface.size and self.interface.cell_size == 1.0
        self._reach = (self.interface.lidar or LidarModel()).max_range  # m

    @classmethod
    def make_network(cls, config: BeliefPlannerConfig, context_size: int) -> BeliefPlannerNetwork:
        """Returns a new network, which serves contexts of any size."""
        return BeliefPlannerNetwork(config)

    def initial_state(self, batch_size: int) -> ActorState:
        """Returns a state without beliefs: `act` forms one where a context is new."""

        def zeros(*shape: int) -> np.ndarray:
            return np.zeros((batch_size, *shape), dtype=np.float32)

        return ActorState(
            code=None,
            displacement=Displacement(batch_size),
            turn=zeros(),
            anchor=zeros(2),
            shown=zeros(NUM_PLANES, self._size, self._size),
            evidence=zeros(NUM_EVIDENCE, self._size, self._size),
            weighed=zeros(NUM_EVIDENCE, self._size, self._size),
            belief=zeros(NUM_PLANES, self._size, self._size),
            revised_at=zeros(2),
            waited=np.zeros(batch_size, dtype=np.int64),
            is_far=np.zeros(batch_size, dtype=bool),
            wished=zeros(2),
        )

    @acting
    def act(self, inputs: Inputs, state: ActorState, explore: bool = False) -> tuple[np.ndarray, ActorState]:
        """Returns actions `[B]`.

        The belief is revised where a context is new, where evidence contradicts it, and where the body has left the
        part of a large map in which the goal was brought nearer.
        """
        batch_size = len(inputs.new_context)
        active = np.ones(batch_size, dtype=bool) if inputs.active is None else inputs.active

        # A new context brings a map and a goal; a new episode forgets the evidence and tells where the body begins.
        for row in np.flatnonzero(inputs.new_context).tolist():
            self._begin_leg(row, inputs, state)

        # How far the body has moved since the episode began, in the map's frame, and so where it is on the map.
        observed = inputs.observation["state"].copy()
        moved = turned(state.displacement.update(observed, inputs.new_episode), state.turn)
        observed[:, [X, Y]] = moved
        observed[:, YAW] += state.turn
        features = self._tensor(state_features(torch.from_numpy(observed), torch.zeros(batch_size, 2)))
        position = state.anchor + self.network.on_map(self._tensor(moved)).cpu().numpy()

        # Evidence of walls and of the goal: where the body is, what has stopped it, and what the lidar sees.
        readings = Readings(
            context=np.arange(batch_size),
            on_leg=np.ones(batch_size, dtype=bool),
            position=position,
            velocity=self.network.velocity(features).cpu().numpy(),
            wished=state.wished,
            yaw=observed[:, YAW],
            ranges=inputs.observation.get("lidar", np.zeros((batch_size, 0), dtype=np.float32)),
            reach=self._reach,
        )
        add_readings(state.evidence, readings, self.network.metre())

        # A new belief, and shortest paths over it, where the context is new or, after some steps on a leg, where
        # evidence contradicts the belief, or the body is far from where the goal was brought nearer.
        state.waited += 1
        is_away = np.abs(position - state.revised_at).sum(axis=1) > _AWAY
        is_due = (state.waited >= PATIENCE) & (_surprised(state) | (state.is_far & is_away))
        rows = np.flatnonzero((inputs.new_context | is_due) & active)
        if len(rows):
            self._revise(rows, position, state)
        assert state.code is not None, "new_context must be set in an environment's first step"

        # The policy's best action along these paths. Exploring, the first environment draws from the policy, and the
        # last one takes its best action; those between draw with less and less noise.
        logits = in_batches(self._policy_logits, STATES_AT_ONCE, features[:, None], *state.code)
        scores = logits[:, 0].cpu().numpy()
        if explore:
            noise = self._noise_scale[:, None] * self._rng.gumbel(size=scores.shape)
            action = self._explored((scores + noise).argmax(axis=1), NUM_ACTIONS)
        else:
            action = scores.argmax(axis=1)
        action = np.where(active, action, 0)

        # The velocity that this action brings where nothing stops the body, to compare with that of the next step.
        wished = in_batches(self.network.wished, STATES_AT_ONCE, features, self._tensor(action).long())
        state.wished = wished.cpu().numpy()
        return action, state

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
        cell = point_to_cell(observed[[X, Y]], self._size)
        if self._points_tell and np.abs(cell_to_point(cell, self._size) - observed[[X, Y]]).max() < _ROUNDING:
            return cell, 0.0
        if "lidar" in observation and is_odometry(observed):
            cells = starts if len(starts) else np.argwhere(walls <= max(0.5, walls.min()))
            return find_pose(walls, observation["lidar"][row], cells, self.network.metre(), self._reach)
        return starts[0] if len(starts) else np.full(2, (self._size - 1) / 2), 0.0

    def _revise(self, rows: np.ndarray, position: np.ndarray, state: ActorState) -> None:
        """Writes beliefs and codes of the contexts at `rows` `[K]`, for bodies at positions `[B, 2]`."""
        shown, evidence, anchor, here = map(
            self._tensor, (state.shown[rows], state.evidence[rows], state.anchor[rows], position[rows])
        )

        def believe(shown: torch.Tensor, evidence: torch.Tensor) -> torch.Tensor:
            return probabilities(self.network.belief(shown, evidence), evidence)

        belief = in_batches(believe, CONTEXTS_AT_ONCE, shown, evidence)
        code = in_batches(self.network.hypermodel, CONTEXTS_AT_ONCE, belief, anchor, here)
        state.code = with_codes(state.code, len(state.waited), torch.from_numpy(rows).to(belief.device), code)

        state.belief[rows], state.weighed[rows] = belief.cpu().numpy(), state.evidence[rows]
        state.waited[rows], state.revised_at[rows] = 0, position[rows]
        farthest = distance_at(here, code.distance).amax(dim=-1)
        state.is_far[rows] = (farthest > REACH).cpu().numpy()

    def _tensor(self, array: np.ndarray | torch.Tensor) -> torch.Tensor:
        return torch.as_tensor(array).to(self.network.support.device)


def _surprised(state: ActorState) -> np.ndarray:
    """Returns `[B]` bool: where evidence that came since the belief was revised contradicts it."""
    came = state.evidence - state.weighed
    contradicts = np.abs(came[:, SENSED]) * np.abs((state.evidence[:, SENSED] > 0) - state.belief[:, WALL])
    missed = came[:, PASSED] * state.belief[:, GOAL]
    stopped = came[:, FAILED] * (1 - state.belief[:, WALL])
    return np.maximum(np.maximum(contradicts, missed), stopped).max(axis=(1, 2)) > _SURPRISING
