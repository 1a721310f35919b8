"""Trains Stable-Baselines3's PPO on tracks, or on a task without a lidar, and saves the policy.

python docs/examples/sb3_tracks.py --out ppo.zip
"""

import argparse

import sb3_agent
from mazebench_agents.integrations.sb3 import FieldVecEnv, MapFeatures, MazeVecEnv, WayFeatures
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure
from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

import mazebench

parser = argparse.ArgumentParser()
parser.add_argument("--track", nargs="+", default=["building", "rebuilt"], help="or local, a task without a lidar")
parser.add_argument("--level", type=int, nargs="*", default=[1], help="of the tracks, one of them in each episode")
parser.add_argument("--hide", nargs="*", default=[], help="map, which then no episode shows")
parser.add_argument("--kinds", nargs="*", default=["dfs", "house", "rooms"], help="of new mazes; none: the train mazes")
parser.add_argument("--distances", type=int, nargs=2, default=[1, 40], help="cells from start to goal, from and to")
parser.add_argument("--first-distance", type=int, default=4, help="cells to the farthest goals at the beginning")
parser.add_argument("--reward", default="progress", help="or sparse, the benchmark's own")
parser.add_argument("--features", default="field", help="or map, convolutions of it; or ways, over learned costs")
parser.add_argument("--recurrent", action="store_true", help="a policy with an LSTM, by sb3-contrib, for a track")
parser.add_argument("--steps", type=int, default=1_000_000)
parser.add_argument("--num-envs", type=int, default=64)
parser.add_argument("--seed", type=int, default=0)
parser.add_argument("--log", help="a folder for progress.csv")
parser.add_argument("--out", default="ppo.zip")
arguments = parser.parse_args()
is_local, reads_field = arguments.track == ["local"], arguments.features == "field"
if is_local and (arguments.recurrent or reads_field):
    parser.error("expected a track with --recurrent and with --features field, found local")

nearest, farthest = arguments.distances


class Widening(BaseCallback):
    """Draws goals farther away after each rollout, over the first half of the training."""

    def _on_rollout_start(self):
        share = min(2 * self.num_timesteps / arguments.steps, 1)
        reach = round(arguments.first_distance + share * (farthest - arguments.first_distance))
        envs.draw_distances(range(nearest, max(reach, nearest) + 1))

    def _on_step(self):
        return True


options = {"kinds": arguments.kinds, "fresh": bool(arguments.kinds), "hide": arguments.hide}
if not is_local:
    options["level"] = tuple(arguments.level)
task = "local" if is_local else tuple(arguments.track)
options["distances"] = range(nearest, farthest + 1)
envs = mazebench.make_vec(task, arguments.num_envs, reward=arguments.reward, **options)
agent, policy, venv = sb3_agent.PPOAgent, "MultiInputPolicy", MazeVecEnv(envs)
policy_options = {"net_arch": [256, 256] if reads_field else [256]}
if is_local:
    agent = sb3_agent.MapPPOAgent
elif arguments.recurrent:
    agent, policy = sb3_agent.RecurrentPPOAgent, "MultiInputLstmPolicy"
if reads_field:
    agent, policy = sb3_agent.FieldPPOAgent, "MlpPolicy"
    if arguments.recurrent:
        agent, policy = sb3_agent.FieldRecurrentPPOAgent, "MlpLstmPolicy"
    venv = FieldVecEnv(venv)
else:
    policy_options["features_extractor_class"] = {"map": MapFeatures, "ways": WayFeatures}[arguments.features]
model = agent.algorithm(
    policy,
    VecNormalize(VecMonitor(venv), norm_obs=False, gamma=0.99),  # rewards of an order of 1
    n_steps=128,
    batch_size=1024,
    n_epochs=4,
    learning_rate=(lambda left: 1e-3 * left) if reads_field else 5e-4,  # `left`: the share of steps to come
    gamma=0.99,
    ent_coef=0.0005 if reads_field else 0.01,
    policy_kwargs=policy_options,
    seed=arguments.seed,
    device="cpu",
    verbose=1,
)
if arguments.log:
    model.set_logger(configure(arguments.log, ["csv"]))
model.learn(arguments.steps, Widening())
model.save(arguments.out)
print(f"saved {arguments.out}, which sb3_agent:{agent.__name__} plays")
