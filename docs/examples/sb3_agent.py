"""The policy that sb3_tracks.py saved, as an agent of mazebench."""

import cv2
import numpy as np
import torch
from stable_baselines3 import PPO

import mazebench


class PPOAgent(mazebench.Agent):
    """Draws its actions from the policy's distribution, with a random stream for each episode."""

    needs_sensors = ("lidar",)

    @classmethod
    def build(cls, interface, *, seed=0, checkpoint=None):
        if checkpoint is None:
            raise mazebench.InputError("expected --checkpoint, the file that sb3_tracks.py saved, found none")
        return cls(PPO.load(checkpoint, device="cpu").policy)

    def __init__(self, policy):
        self.policy = policy
        self.side = policy.observation_space["context"].shape[-1]  # M of the contexts that it was trained on

    def initial_state(self, batch_size):
        return [None] * batch_size  # a random stream for each environment

    def act(self, inputs, state, explore=False):
        for slot in np.flatnonzero(inputs.new_episode):
            state[slot] = np.random.default_rng(inputs.seed[slot])
        observation = dict(inputs.observation)
        if observation["context"].shape[-1] != self.side:
            observation["context"] = np.stack([self.resized(planes) for planes in observation["context"]])
        with torch.no_grad():
            observation = {name: torch.as_tensor(values) for name, values in observation.items()}
            shares = self.policy.get_distribution(observation).distribution.probs.double().numpy()
        return np.array([rng.choice(6, p=p / p.sum()) for rng, p in zip(state, shares, strict=True)]), state

    def resized(self, planes):
        """Returns `[4, side, side]`: the planes of a context with another number of cells."""
        return np.stack([cv2.resize(plane, (self.side, self.side), interpolation=cv2.INTER_AREA) for plane in planes])
