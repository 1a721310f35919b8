"""The map policy: one network reads map, picture, pose and velocity, and chooses the action.

docs/agents/map_policy.md describes the network and its training.
"""

from __future__ import annotations

import copy
import dataclasses
import pathlib
from importlib import resources
from typing import Any, ClassVar, Self

import numpy as np
import torch
from torch.nn import functional

from mazebench.agent import Inputs, Interface
from mazebench.constants import FORWARD_VELOCITY, LEFT_VELOCITY, NUM_ACTIONS, YAW, X, Y
from mazebench.errors import UnplayableError
from mazebench.tasks.context import GLOBAL_MAP, GOAL
from mazebench.world.looks import Camera

from ..common.actor import acting
from ..common.checkpoint import load_checkpoint, require_body
from ..common.layers import in_batches
from ..common.rollouts import Rows, Seen
from ..imitation import ImitatingAgent
from .cloning import CloningLearner
from .map_policy_config import MapPolicyConfig
from .network import MapNetwork

_TEMPERATURE = 0.25  # of the choice of actions, so that it does not stay where two of them undo each other
# Maps and states are read as many at once, always, since PyTorch rounds differently at another batch size.
_MAPS_AT_ONCE = 8
_STATES_AT_ONCE = 32


@dataclasses.dataclass
class _Robot:
    """Reading and noise of one environment."""

    noise: np.random.Generator  # of its choice of actions
    map: np.ndarray = dataclasses.field(init=False)  # [2, L, L] float32, walls and goal
    features: torch.Tensor = dataclasses.field(init=False)  # [C + 1, L, L], what was read of the map


@dataclasses.dataclass
class _ActorState:
    """The state of acting in B environments."""

    robots: list[_Robot | None]
    seen: Seen | None = None  # in the last step, while exploring


class MapPolicy(ImitatingAgent):
    """Reads the map once a leg, and acts by what it read around the observed pose, the picture and its velocity."""

    name: ClassVar[str] = "map-policy"
    needs_sensors = ("egocentric",)
    needs_shown = ("map", "goal")
    default_config: ClassVar[MapPolicyConfig] = MapPolicyConfig()
    learner_class: ClassVar[type[CloningLearner]] = CloningLearner
    network: MapNetwork
    _cell_size: float  # m

    @classmethod
    def make_network(cls, config: MapPolicyConfig, context_size: int) -> MapNetwork:
        """Returns a new network, which reads maps of any size."""
        return MapNetwork()

    @classmethod
    def build(cls, interface: Interface, *, seed: int = 0, checkpoint: pathlib.Path | None = None) -> Self:
        """Returns the agent of a checkpoint, by default of the one that ships, which has no config."""
        path = checkpoint or cls.default_checkpoint()
        require_body(load_checkpoint(path, cls.name)[1], cls.name, interface.body)
        agent = cls(cls.default_config, interface.context_size).for_interface(interface)
        agent.load(path)
        return agent

    def for_interface(self, interface: Interface) -> Self:
        """Returns an agent with the same network for the cells of an interface."""
        interface.require_sensor("egocentric", self.name)
        if interface.camera != Camera():
            raise UnplayableError(
                f"agent {self.name!r}: expected the default camera, {Camera()}, found {interface.camera}"
            )
        if interface.context_size != interface.size:
            expected = f"expected maps with a pixel per cell, found {interface.context_size} pixels"
            raise UnplayableError(f"agent {self.name!r}: {expected} for {interface.size} cells")
        agent = copy.copy(self)
        agent._cell_size = interface.cell_size
        return agent

    @classmethod
    def default_checkpoint(cls) -> pathlib.Path:
        """Returns the checkpoint that ships."""
        return pathlib.Path(str(resources.files("mazebench_assets.checkpoints") / f"{cls.name}.safetensors"))

    def initial_state(self, batch_size: int) -> _ActorState:
        """Returns no robots yet: one is made where an episode begins."""
        return _ActorState([None] * batch_size)

    @acting
    def act(self, inputs: Inputs, state: _ActorState, explore: bool = False) -> tuple[np.ndarray, _ActorState]:
        """Returns actions `[B]`, drawn by the policy's probabilities at a low temperature."""
        slots = list(range(len(state.robots))) if inputs.active is None else np.flatnonzero(inputs.active).tolist()
        for slot in slots:
            if inputs.new_episode[slot]:
                state.robots[slot] = _Robot(np.random.default_rng(int(inputs.seed[slot])))
        actions = np.zeros(len(state.robots), dtype=np.int64)
        if not slots:
            return actions, state
        robots: list[Any] = [state.robots[slot] for slot in slots]

        # What is new on maps.
        new = [robot for robot, slot in zip(robots, slots, strict=True) if inputs.new_context[slot]]
        if new:
            maps = inputs.observation["context"][np.array(slots)[inputs.new_context[slots]]][:, [GLOBAL_MAP, GOAL]]
            read = in_batches(self.network.read, _MAPS_AT_ONCE, torch.from_numpy(maps))
            for robot, shown, features in zip(new, maps, read, strict=True):
                robot.map, robot.features = shown, features

        # Each state is on a map of its own.
        observed = inputs.observation["state"][slots]
        pose = (observed[:, [X, Y, YAW]] / np.array([self._cell_size, self._cell_size, 1])).astype(np.float32)
        velocity = observed[:, [FORWARD_VELOCITY, LEFT_VELOCITY]].astype(np.float32)
        parts = pose, velocity, inputs.observation["egocentric"][slots]
        logits = in_batches(
            self.network,
            _STATES_AT_ONCE,
            torch.stack([robot.features for robot in robots]),
            *(torch.from_numpy(part)[:, None] for part in parts),
        )[:, 0].numpy()
        noise = np.stack([robot.noise.gumbel(size=NUM_ACTIONS) for robot in robots])
        actions[slots] = (logits + _TEMPERATURE * noise).argmax(axis=1)
        if explore:
            state.seen = Seen([robot.map for robot in robots], (pose, velocity))
        return actions, state

    def notes(self, state: _ActorState) -> Seen | None:  # type: ignore[override]
        """Returns what the network read in the last step, but for the pictures."""
        return state.seen

    def read(self, rows: Rows) -> tuple[torch.Tensor, dict[str, torch.Tensor]]:
        """Returns log probabilities `[R, 6]` of actions in rows, whose parts are poses, velocities and pictures."""
        features = self.network.read(rows.shared)[rows.group]
        logits = self.network(features, *(part[:, None] for part in rows.parts))[:, 0]
        return functional.log_softmax(logits, dim=1), {}
