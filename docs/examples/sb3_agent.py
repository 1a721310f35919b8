"""The policy that sb3_tracks.py saved, as an agent of mazebench."""

import numpy as np
import torch
from mazebench_agents.integrations.distance_field import DistanceField
from sb3_contrib import RecurrentPPO
from stable_baselines3 import PPO

import mazebench


class PPOAgent(mazebench.Agent):
    """Draws its actions from the policy's distribution, with a random stream for each episode."""

    needs_sensors = ("lidar",)
    algorithm = PPO

    @classmethod
    def build(cls, interface, *, seed=0, checkpoint=None):
        if checkpoint is None:
            raise mazebench.InputError("expected --checkpoint, the file that sb3_tracks.py saved, found none")
        return cls(cls.algorithm.load(checkpoint, device="cpu").policy, interface)

    def __init__(self, policy, interface):
        self.policy = policy
        self.pixel = interface.cell_size * interface.size / interface.context_size  # m, of the map
        self.prepare(interface)

    def prepare(self, interface):
        # Positions in metres belong to one size of mazes.
        self.side = self.policy.observation_space["context"].shape[-1]  # M of the contexts that it was trained on
        if self.side not in (interface.size, interface.context_size):
            raise mazebench.UnplayableError(f"expected mazes of {self.side} cells a side, found {interface.size}")

    def initial_state(self, batch_size):
        streams = [None] * batch_size  # of random numbers, one for each environment
        return streams, DistanceField(batch_size, pixel=self.pixel), self.initial_memory(batch_size)

    def act(self, inputs, state, explore=False):
        streams, field, memory = state
        for slot in np.flatnonzero(inputs.new_episode):
            streams[slot] = np.random.default_rng(inputs.seed[slot])
        with torch.no_grad():
            observation = self.observe(inputs, field)
            distribution, memory = self.distribution(observation, memory, torch.as_tensor(inputs.new_episode))
        shares = distribution.distribution.probs.double().numpy()
        actions = np.array([rng.choice(6, p=p / p.sum()) for rng, p in zip(streams, shares, strict=True)])
        return actions, (streams, field, memory)

    def observe(self, inputs, field):
        batch, planes, side, _ = inputs.observation["context"].shape
        shape = (batch, planes, self.side, side // self.side, self.side, side // self.side)
        context = inputs.observation["context"].reshape(shape).mean(axis=(3, 5))  # of the side that it was trained on
        return {name: torch.as_tensor(values) for name, values in (inputs.observation | {"context": context}).items()}

    def initial_memory(self, batch_size):
        return None  # the policy has no memory

    def distribution(self, observation, memory, new_episode):
        return self.policy.get_distribution(observation), memory


class MapPPOAgent(PPOAgent):
    """The same without a lidar."""

    needs_sensors = ()


class RecurrentPPOAgent(PPOAgent):
    """The same with an LSTM, whose state is the agent's memory."""

    algorithm = RecurrentPPO

    def initial_memory(self, batch_size):
        lstm = self.policy.lstm_actor
        return tuple(torch.zeros(lstm.num_layers, batch_size, lstm.hidden_size) for _ in range(2))

    def distribution(self, observation, memory, new_episode):
        return self.policy.get_distribution(observation, memory, new_episode.float())


class FieldPPOAgent(PPOAgent):
    """The same by the features of `DistanceField`, on maps of any size."""

    def prepare(self, interface):
        pass

    def observe(self, inputs, field):
        field.read(inputs.observation["context"], inputs.new_context)
        return torch.as_tensor(field.features(inputs.observation))


class FieldRecurrentPPOAgent(RecurrentPPOAgent):
    """By these features, with an LSTM."""

    prepare, observe = FieldPPOAgent.prepare, FieldPPOAgent.observe
