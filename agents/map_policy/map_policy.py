"""The map policy: one network reads map, picture, pose and velocity, and chooses the action.

docs/agents/map_policy.md describes the network and its training.
"""

from __future__ import annotations

import dataclasses
import pathlib
from importlib import resources
from typing import Self

import numpy as np
import torch

from mazebench.agent import Agent, Inputs, Interface
from mazebench.constants import FORWARD_VELOCITY, LEFT_VELOCITY, NUM_ACTIONS, YAW, X, Y
from mazebench.errors import UnplayableError
from mazebench.tasks.context import GLOBAL_MAP, GOAL
from mazebench.world.looks import Camera

from ..common.actor import acting
from ..common.checkpoint import load_checkpoint, load_into
from ..common.layers import in_batches
from .network import MapNetwork

NAME = "map-policy"
_TEMPERATURE = 0.25  # of the choice of actions, so that it does not stay where two of them undo each other
# Maps and states are read as many at once, always, since PyTorch rounds differently at another batch size.
_MAPS_AT_ONCE = 8
_STATES_AT_ONCE = 32


@dataclasses.dataclass
class _Robot:
    """Reading and noise of one environment."""

    noise: np.random.Generator  # of its choice of actions
    features: torch.Tensor = dataclasses.field(init=False)  # [C + 1, L, L], what was read of the map


class MapPolicy(Agent):
    """Reads the map once a leg, and acts by what it read around the observed pose, the picture and its velocity."""

    needs_sensors = ("egocentric",)
    needs_shown = ("map", "goal")

    def __init__(self, network: MapNetwork, cell_size: float):
        """Acts by a network, in mazes with cells of `cell_size` (m)."""
        self._network, self._cell_size = network, cell_size

    @classmethod
    def build(cls, interface: Interface, *, seed: int = 0, checkpoint: pathlib.Path | None = None) -> Self:
        """Returns the agent of a checkpoint, by default of the one that ships."""
        interface.require_sensor("egocentric", NAME)
        if interface.camera != Camera():
            raise UnplayableError(f"agent {NAME!r}: expected the default camera, {Camera()}, found {interface.camera}")
        if interface.context_size != interface.size:
            expected = f"expected maps with a pixel per cell, found {interface.context_size} pixels"
            raise UnplayableError(f"agent {NAME!r}: {expected} for {interface.size} cells")
        path, network = checkpoint or cls.default_checkpoint(), MapNetwork()
        load_into(path, network, load_checkpoint(path, NAME)[0])
        return cls(network, interface.cell_size)

    @classmethod
    def context_size(cls, size: int) -> int:
        """Returns N: the map at full resolution."""
        return size

    @classmethod
    def default_checkpoint(cls) -> pathlib.Path:
        """Returns the checkpoint that ships."""
        return pathlib.Path(str(resources.files("mazebench_assets.checkpoints") / f"{NAME}.safetensors"))

    def initial_state(self, batch_size: int) -> list[_Robot | None]:
        """Returns no robots yet: one is made where an episode begins."""
        return [None] * batch_size

    @acting
    def act(
        self, inputs: Inputs, state: list[_Robot | None], explore: bool = False
    ) -> tuple[np.ndarray, list[_Robot | None]]:
        """Returns actions `[B]`, drawn by the policy's probabilities at a low temperature."""
        slots = list(range(len(state))) if inputs.active is None else np.flatnonzero(inputs.active).tolist()
        for slot in slots:
            if inputs.new_episode[slot]:
                state[slot] = _Robot(np.random.default_rng(int(inputs.seed[slot])))
        actions = np.zeros(len(state), dtype=np.int64)
        if not slots:
            return actions, state

        # What is new on maps.
        new = [slot for slot in slots if inputs.new_context[slot]]
        if new:
            maps = torch.from_numpy(inputs.observation["context"][new][:, [GLOBAL_MAP, GOAL]])
            for slot, features in zip(new, in_batches(self._network.read, _MAPS_AT_ONCE, maps), strict=True):
                state[slot].features = features  # type: ignore[union-attr]

        # Each state is on a map of its own.
        robots = [state[slot] for slot in slots]
        observed = inputs.observation["state"][slots]
        pose = observed[:, None, [X, Y, YAW]] / np.array([self._cell_size, self._cell_size, 1])
        logits = in_batches(
            self._network,
            _STATES_AT_ONCE,
            torch.stack([robot.features for robot in robots]),  # type: ignore[union-attr]
            torch.from_numpy(pose.astype(np.float32)),
            torch.from_numpy(observed[:, None, [FORWARD_VELOCITY, LEFT_VELOCITY]].astype(np.float32)),
            torch.from_numpy(inputs.observation["egocentric"][slots])[:, None],
        )[:, 0].numpy()
        noise = np.stack([robot.noise.gumbel(size=NUM_ACTIONS) for robot in robots])  # type: ignore[union-attr]
        actions[slots] = (logits + _TEMPERATURE * noise).argmax(axis=1)
        return actions, state
