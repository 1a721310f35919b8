"""Trains TorchRL's PPO on many environments at once, of a task or a track.

python docs/examples/torchrl_ppo.py --steps 300000
python docs/examples/torchrl_ppo.py --steps 300000 --id mazebench/Rebuilt-v1 --reward progress
"""

import argparse

import gymnasium
import torch
from tensordict.nn import TensorDictModule
from torch.distributions import Categorical
from torchrl.collectors import Collector
from torchrl.envs import CatTensors, Compose, FlattenObservation, GymWrapper, TransformedEnv
from torchrl.modules import MLP, ProbabilisticActor, ValueOperator
from torchrl.objectives import ClipPPOLoss
from torchrl.objectives.value import GAE

import mazebench  # noqa: F401  (registers the ids)

parser = argparse.ArgumentParser()
parser.add_argument("--id", default="mazebench/Local-13-v1", help="Gymnasium id of a task or a track")
parser.add_argument("--reward", default="sparse", help="or progress, which also rewards a shorter way to the goal")
parser.add_argument("--steps", type=int, default=300_000, help="in all environments together")
parser.add_argument("--num-envs", type=int, default=64)
parser.add_argument("--rollout", type=int, default=64, help="steps of each environment between updates")
parser.add_argument("--epochs", type=int, default=4)
parser.add_argument("--batch-size", type=int, default=1024)
parser.add_argument("--gamma", type=float, default=0.97)
parser.add_argument("--seed", type=int, default=0)
arguments = parser.parse_args()

torch.set_num_threads(1)
torch.manual_seed(arguments.seed)
# TorchRL resets ended episodes itself, with a mask.
options = {"distances": [1, 2], "reward": arguments.reward, "autoreset_mode": "Disabled"}
envs = gymnasium.make_vec(arguments.id, num_envs=arguments.num_envs, **options)
# One vector of 12 + 4 M M numbers: the state, which TorchRL calls "observation", then the planes of the context. On a
# track, the 32 readings of the lidar follow.
parts = ["observation", "context", *(["lidar"] if envs.task.options.track else [])]
env = TransformedEnv(
    GymWrapper(envs, categorical_action_encoding=True),
    Compose(FlattenObservation(-3, -1, ["context"]), CatTensors(parts, "inputs", sort=False)),
)
env.set_seed(arguments.seed)

num_actions = int(envs.single_action_space.n)
network = {"depth": 2, "num_cells": 256, "activation_class": torch.nn.Tanh}
actor = ProbabilisticActor(
    TensorDictModule(MLP(out_features=num_actions, **network), ["inputs"], ["logits"]),
    in_keys=["logits"],
    distribution_class=Categorical,
    return_log_prob=True,
)
critic = ValueOperator(MLP(out_features=1, **network), in_keys=["inputs"])
with torch.no_grad():
    critic(actor(env.reset()))  # makes the layers, whose inputs are counted at the first call
advantage = GAE(gamma=arguments.gamma, lmbda=0.95, value_network=critic)
loss_of = ClipPPOLoss(actor, critic, entropy_coeff=0.01, normalize_advantage=True)
optimizer = torch.optim.Adam(loss_of.parameters(), lr=5e-4)

num_steps = arguments.num_envs * arguments.rollout
counts = {"frames_per_batch": num_steps, "total_frames": arguments.steps}
collector = Collector(env, actor, **counts, auto_register_policy_transforms=False)
updates, steps, rate = 0, 0, "no episode has ended"
for rollout in collector:  # [num_envs, rollout]
    steps += rollout.numel()
    ended = rollout["next", "done"]
    if ended.any():
        rate = f"success rate {rollout['next', 'terminated'][ended].float().mean():.2f}"
    print(f"{steps} steps: {rate}", flush=True)
    rollout["next", "reward"] *= 0.1  # values of an order of 1
    for _ in range(arguments.epochs):
        with torch.no_grad():
            advantage(rollout)
        for batch in rollout.reshape(-1)[torch.randperm(rollout.numel())].split(arguments.batch_size):
            losses = loss_of(batch)
            optimizer.zero_grad()
            sum(value for name, value in losses.items() if name.startswith("loss_")).backward()
            torch.nn.utils.clip_grad_norm_(loss_of.parameters(), 0.5)
            optimizer.step()
            updates += 1
print(f"{updates} updates; {rate} in the last {arguments.rollout} steps of each environment")
collector.shutdown()
