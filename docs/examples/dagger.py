"""Imitates the oracle on the track building: clones its drives, then has its own labelled (DAgger, Ross et al. 2011).

python docs/examples/dagger.py --out student.pt     (a minute and a half on one core)

The network need not learn to plan: it reads how far the places around the body are from the goal, by a breadth-first
search on the shown map. It learns to drive.
"""

import argparse

import numpy as np
import torch
from mazebench_agents import expert
from mazebench_agents.integrations.distance_field import DistanceField
from torch import nn

import mazebench

POINTS, SPACING = 9, 0.5  # a grid around the body: points on a side, m between them
NUM_RAYS = 32
NUM_ENVS, STEPS_PER_ROUND, UPDATES_PER_ROUND, BATCH_SIZE = 32, 40, 60, 512


def make_network():
    num_features = DistanceField(1, POINTS).num_features(NUM_RAYS)
    return nn.Sequential(nn.Linear(num_features, 256), nn.ReLU(), nn.Linear(256, 256), nn.ReLU(), nn.Linear(256, 6))


class Student(mazebench.Agent):
    """Does what the network takes for the expert's action."""

    needs_sensors = ("lidar",)
    learns = True

    @classmethod
    def build(cls, interface, *, seed=0, checkpoint=None):
        if checkpoint is None:
            raise mazebench.InputError("expected --checkpoint, a file that dagger.py wrote, found none")
        student = cls()
        student.pixel = interface.cell_size * interface.size / interface.context_size  # m, of the map
        student.network = make_network()
        student.network.load_state_dict(torch.load(checkpoint, weights_only=True))
        return student

    def initial_state(self, batch_size):
        return DistanceField(batch_size, POINTS, SPACING, self.pixel)

    def act(self, inputs, field, explore=False):
        field.read(inputs.observation["context"], inputs.new_context)
        with torch.no_grad():
            return self.network(torch.as_tensor(field.features(inputs.observation))).argmax(dim=1).numpy(), field


def train(num_steps, seed):
    """Returns a network that learned from the expert's labels of `num_steps` steps."""
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    network = make_network()
    optimizer = torch.optim.Adam(network.parameters(), 1e-3)
    envs = mazebench.make_vec("building", NUM_ENVS, kinds=("dfs", "house", "rooms"), fresh=True)
    field = DistanceField(NUM_ENVS, POINTS, SPACING)
    observation, info = envs.reset(seed=seed)
    rows, labels, reached = [], [], []
    num_rounds = max(2, num_steps // (STEPS_PER_ROUND * NUM_ENVS))
    for number in range(num_rounds):
        # Collect: the expert drives and is cloned; then the student drives, and the expert says what it would do.
        expert_drives = number < num_rounds / 5
        for _ in range(STEPS_PER_ROUND):
            field.read(observation["context"], info["is_first"])
            rows.append(torch.as_tensor(field.features(observation)))
            labels.append(torch.as_tensor(expert.labels(envs)))
            with torch.no_grad():
                actions = labels[-1] if expert_drives else network(rows[-1]).argmax(dim=1)
            observation, _, terminated, truncated, info = envs.step(actions.numpy())
            reached += terminated[terminated | truncated].tolist()
        # Learn from all rounds.
        all_rows, all_labels = torch.cat(rows), torch.cat(labels)
        for _ in range(UPDATES_PER_ROUND):
            batch = torch.as_tensor(rng.integers(len(all_rows), size=BATCH_SIZE))
            loss = nn.functional.cross_entropy(network(all_rows[batch]), all_labels[batch])
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
        if number % 5 == 4:
            print(f"{len(all_rows):,} labels; {sum(reached)} of the last {len(reached)} goals were reached")
            reached.clear()
    envs.close()
    return network


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--steps", type=int, default=60_000, help="agent steps of the training")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", default="student.pt")
    parser.add_argument("--distances", type=int, nargs="+", help="cells from start to goal in the evaluation")
    arguments = parser.parse_args()
    torch.save(train(arguments.steps, arguments.seed).state_dict(), arguments.out)
    task = mazebench.Task.of("building", split="dev", distances=arguments.distances)
    found = mazebench.evaluate(Student, task, checkpoint=arguments.out)
    print(f"saved {arguments.out}; success rate on dev {found.overall.success_rate:.3f}, {found.episodes} episodes")
