"""Trains Stable-Baselines3's PPO on a track, at all of its levels, or on a task, and saves the policy.

python docs/examples/sb3_tracks.py --steps 400000 --out ppo.zip
"""

import argparse

from mazebench_agents.integrations.sb3 import MapFeatures, MazeVecEnv, WayFeatures
from sb3_agent import MapPPOAgent, PPOAgent, RecurrentPPOAgent
from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

import mazebench

parser = argparse.ArgumentParser()
parser.add_argument("--track", default="rebuilt", help="or local, a task without a lidar")
parser.add_argument("--distances", type=int, nargs=2, default=[1, 6], help="cells from start to goal, from and to")
parser.add_argument("--kinds", nargs="*", default=[], help="of a new maze in each episode, instead of the train mazes")
parser.add_argument("--reward", default="sparse", help="or progress, which also rewards a shorter way to the goal")
parser.add_argument("--features", default="map", help="or ways: the cheapest ways over learned costs")
parser.add_argument("--level", type=int, nargs="*", default=[1, 2, 3], help="of the track, one of them in each episode")
parser.add_argument("--recurrent", action="store_true", help="a policy with an LSTM, by sb3-contrib, for a track")
parser.add_argument("--steps", type=int, default=400_000)
parser.add_argument("--num-envs", type=int, default=64)
parser.add_argument("--seed", type=int, default=0)
parser.add_argument("--out", default="ppo.zip")
arguments = parser.parse_args()
if arguments.recurrent and arguments.track == "local":
    parser.error("expected --recurrent with a track, found it with local")

agent = MapPPOAgent if arguments.track == "local" else RecurrentPPOAgent if arguments.recurrent else PPOAgent
nearest, farthest = arguments.distances
options = {"distances": range(nearest, farthest + 1), "kinds": arguments.kinds, "fresh": bool(arguments.kinds)}
if arguments.track != "local":
    options["level"] = tuple(arguments.level)
envs = MazeVecEnv(mazebench.make_vec(arguments.track, arguments.num_envs, reward=arguments.reward, **options))
features = {"map": MapFeatures, "ways": WayFeatures}[arguments.features]
model = agent.algorithm(
    "MultiInputLstmPolicy" if agent is RecurrentPPOAgent else "MultiInputPolicy",
    VecNormalize(VecMonitor(envs), norm_obs=False, gamma=0.99),  # rewards of an order of 1
    n_steps=128,
    batch_size=1024,
    n_epochs=4,
    learning_rate=5e-4,
    gamma=0.99,
    ent_coef=0.01,
    policy_kwargs={"net_arch": [256], "features_extractor_class": features},
    seed=arguments.seed,
    device="cpu",
    verbose=1,
)
model.learn(arguments.steps)
model.save(arguments.out)
print(f"saved {arguments.out}, which sb3_agent:{agent.__name__} plays")
