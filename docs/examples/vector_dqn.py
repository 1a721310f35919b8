"""A small DQN in one file, in the manner of CleanRL, on many environments at once.

python docs/examples/vector_dqn.py --steps 300000
"""

import argparse
import time

import gymnasium
import numpy as np
import torch
from torch import nn
from torch.nn import functional

import mazebench  # noqa: F401  (registers the ids)

parser = argparse.ArgumentParser()
parser.add_argument("--steps", type=int, default=300_000, help="in all environments together")
parser.add_argument("--num-envs", type=int, default=64)
parser.add_argument("--buffer-size", type=int, default=100_000)
parser.add_argument("--batch-size", type=int, default=256)
parser.add_argument("--learning-starts", type=int, default=5_000)
parser.add_argument("--learning-rate", type=float, default=3e-4)
parser.add_argument("--target-updates", type=int, default=200, help="updates between copies to the target network")
parser.add_argument("--gamma", type=float, default=0.97)
parser.add_argument("--seed", type=int, default=0)
arguments = parser.parse_args()

torch.set_num_threads(1)
torch.manual_seed(arguments.seed)
rng = np.random.default_rng(arguments.seed)


def flat(observations: dict[str, np.ndarray]) -> np.ndarray:
    """`[B, 12 + 4 M M]` float32: the state, then the planes of the context."""
    return np.concatenate([observations["state"], observations["context"].reshape(len(observations["state"]), -1)], 1)


def q_network(num_inputs: int, num_actions: int) -> nn.Module:
    return nn.Sequential(
        nn.Linear(num_inputs, 256), nn.ReLU(), nn.Linear(256, 256), nn.ReLU(), nn.Linear(256, num_actions)
    )


num_envs = arguments.num_envs
envs = gymnasium.make_vec("mazebench/Local-13-v1", num_envs=num_envs, distances=[1, 2])
observations, _ = envs.reset(seed=arguments.seed)
observed = flat(observations)
num_actions = envs.single_action_space.n
network, target = (q_network(observed.shape[1], num_actions) for _ in range(2))
target.load_state_dict(network.state_dict())
optimizer = torch.optim.Adam(network.parameters(), lr=arguments.learning_rate)

rows = arguments.buffer_size // num_envs
buffer = {
    "observed": np.zeros((rows, num_envs, observed.shape[1]), np.float32),
    "after": np.zeros((rows, num_envs, observed.shape[1]), np.float32),
    "action": np.zeros((rows, num_envs), np.int64),
    "reward": np.zeros((rows, num_envs), np.float32),
    "terminated": np.zeros((rows, num_envs), np.float32),
}
successes, updates, begin = [], 0, time.perf_counter()
for count in range(arguments.steps // num_envs):
    epsilon = max(0.05, 1 - count * num_envs / (0.5 * arguments.steps))
    with torch.no_grad():
        actions = network(torch.as_tensor(observed)).argmax(1).numpy()
    actions = np.where(rng.random(num_envs) < epsilon, rng.integers(num_actions, size=num_envs), actions)
    observations, rewards, terminated, truncated, infos = envs.step(actions)
    next_observed = flat(observations)
    after = next_observed.copy()
    # Where an episode ended, `observations` are already the next one's: its own last stands in final_obs.
    for i in np.flatnonzero(terminated | truncated):
        after[i] = flat({key: value[None] for key, value in infos["final_obs"][i].items()})[0]
        successes.append(bool(terminated[i]))
    row = count % rows
    # A truncated step is bootstrapped from, a terminated one is not.
    for key, values in zip(buffer, (observed, after, actions, rewards, terminated), strict=True):
        buffer[key][row] = values
    observed = next_observed
    if (count + 1) * num_envs < arguments.learning_starts:
        continue
    chosen = (
        rng.integers(min(count + 1, rows), size=arguments.batch_size),
        rng.integers(num_envs, size=arguments.batch_size),
    )
    batch = {key: torch.as_tensor(values[chosen]) for key, values in buffer.items()}
    with torch.no_grad():
        best = network(batch["after"]).argmax(1, keepdim=True)  # double DQN
        value = target(batch["after"]).gather(1, best)[:, 0]
        aim = batch["reward"] + arguments.gamma * (1 - batch["terminated"]) * value
    loss = functional.smooth_l1_loss(network(batch["observed"]).gather(1, batch["action"][:, None])[:, 0], aim)
    optimizer.zero_grad()
    loss.backward()
    optimizer.step()
    updates += 1
    if updates % arguments.target_updates == 0:
        target.load_state_dict(network.state_dict())
        rate = (count + 1) * num_envs / (time.perf_counter() - begin)
        print(f"{(count + 1) * num_envs} steps, {rate:.0f}/s: success rate {np.mean(successes[-500:]):.2f}", flush=True)
if updates:
    recent = successes[-500:]
    print(f"{updates} updates; success rate {np.mean(recent):.2f} in the last {len(recent)} episodes")
else:
    print(f"0 updates, because {arguments.steps} steps are less than --learning-starts {arguments.learning_starts}")
envs.close()
