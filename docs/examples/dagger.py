"""Imitates the oracle on the track building: drives, and learns the oracle's labels on its drives (DAgger).

python docs/examples/dagger.py --out student     (two minutes on one core)

DAgger is by Ross et al. (2011). The network need not learn to plan: it reads how far the places around the body are
from the goal, by a breadth-first search on the shown map. It learns to drive.
"""

import argparse
import copy
import dataclasses

import torch
from mazebench_agents.common.actor import acting
from mazebench_agents.common.rollouts import Seen
from mazebench_agents.imitation import ImitatingAgent, ImitationConfig
from mazebench_agents.integrations.distance_field import DistanceField
from torch import nn

import mazebench

POINTS, SPACING = 9, 0.5  # a grid around the body: points on a side, m between them
NUM_RAYS = 32


@dataclasses.dataclass(frozen=True, kw_only=True)
class StudentConfig(ImitationConfig):
    """Learns from all rollouts, in 60 batches of some 640 steps after each."""

    num_envs: int = 32
    rollout_steps: int = 40
    total_steps: int = 60_000
    kept_rollouts: int = 1000
    epochs: int = 30
    minibatches: int = 2
    learning_rate: float = 1e-3
    max_gradient_norm: float = 10.0


class Student(ImitatingAgent):
    """Does what the network takes for the oracle's action."""

    name = "student"
    needs_sensors = ("lidar",)
    default_config = StudentConfig()

    @classmethod
    def make_network(cls, config, context_size):
        num_features = DistanceField(1, POINTS).num_features(NUM_RAYS)
        return nn.Sequential(nn.Linear(num_features, 256), nn.ReLU(), nn.Linear(256, 256), nn.ReLU(), nn.Linear(256, 6))

    @classmethod
    def default_checkpoint(cls):
        return None

    @classmethod
    def build(cls, interface, *, seed=0, checkpoint=None):
        if checkpoint is None:
            raise mazebench.InputError("expected --checkpoint, a folder that dagger.py wrote, found none")
        return super().build(interface, seed=seed, checkpoint=checkpoint)

    def for_interface(self, interface):
        student = copy.copy(self)
        student.pixel = interface.cell_size * interface.size / interface.context_size  # m, of the map
        return student

    def initial_state(self, batch_size):
        return DistanceField(batch_size, POINTS, SPACING, self.pixel), None

    @acting
    def act(self, inputs, state, explore=False):
        field, _ = state
        field.read(inputs.observation["context"], inputs.new_context)
        features = field.features(inputs.observation)
        return self.network(torch.as_tensor(features)).argmax(dim=1).numpy(), (field, features)

    def notes(self, state):
        return Seen(list(state[1]))  # each step's features are its own


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--steps", type=int, default=60_000, help="agent steps of the training")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", default="student", help="the folder of the run")
    parser.add_argument("--distances", type=int, nargs="+", help="cells from start to goal in the evaluation")
    arguments = parser.parse_args()
    mazebench.train(
        "dagger:Student",
        "building",
        kinds=("dfs", "house", "rooms"),
        fresh=True,
        distances=range(15, 41),
        first_distance=0,
        env_steps=arguments.steps,
        seed=arguments.seed,
        out=arguments.out,
        eval_mazes=1,
        overrides={"total_steps": arguments.steps},
    )
    task = mazebench.Task.of("building", split="dev", distances=arguments.distances)
    found = mazebench.evaluate("dagger:Student", task, checkpoint=arguments.out)
    print(f"saved {arguments.out}; success rate on dev {found.overall.success_rate:.3f}, {found.episodes} episodes")
