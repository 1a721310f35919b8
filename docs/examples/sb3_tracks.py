"""Trains Stable-Baselines3's PPO on a track, at all of its levels, or on a task, and saves the policy.

python docs/examples/sb3_tracks.py --steps 400000 --out ppo.zip
"""

import argparse

import gymnasium
import numpy as np
from sb3_agent import MapFeatures, MapPPOAgent, PPOAgent, RecurrentPPOAgent
from stable_baselines3.common.vec_env import VecEnv, VecMonitor, VecNormalize

import mazebench  # noqa: F401  (registers the ids)


class MazeVecEnv(VecEnv):
    """A vector environment of mazebench with the interface of Stable-Baselines3."""

    def __init__(self, envs):
        self.envs = envs
        super().__init__(envs.num_envs, envs.single_observation_space, envs.single_action_space)

    def reset(self):
        observations, _ = self.envs.reset(seed=self._seeds)  # of `seed`, or None for each environment
        self._reset_seeds()
        return observations

    def step_async(self, actions):
        self.actions = actions

    def step_wait(self):
        observations, rewards, terminated, truncated, info = self.envs.step(self.actions)
        infos = [{} for _ in range(self.num_envs)]
        for slot in np.flatnonzero(terminated | truncated):
            # The time limit is no property of the world, so PPO goes on from the last observation there.
            infos[slot]["terminal_observation"] = info["final_obs"][slot]
            infos[slot]["TimeLimit.truncated"] = bool(truncated[slot])
            infos[slot]["is_success"] = bool(terminated[slot])  # which PPO prints as success_rate
        return observations, rewards, terminated | truncated, infos

    def close(self):
        self.envs.close()

    # The environments are one object, so all of them have its attributes.
    def get_attr(self, attr_name, indices=None):
        return [getattr(self.envs, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name, value, indices=None):
        setattr(self.envs, attr_name, value)

    def env_method(self, method_name, *arguments, indices=None, **options):
        return [getattr(self.envs, method_name)(*arguments, **options) for _ in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class, indices=None):
        return [False for _ in self._get_indices(indices)]


parser = argparse.ArgumentParser()
parser.add_argument("--track", default="mazebench/Rebuilt-v1", help="Gymnasium id of a track or a task")
parser.add_argument("--level", type=int, nargs="+", default=[1, 2, 3], help="of a track; episodes draw one")
parser.add_argument("--distances", type=int, nargs=2, default=[1, 6], help="cells from start to goal, from and to")
parser.add_argument("--kinds", nargs="*", default=[], help="of a new maze in each episode, instead of the train mazes")
parser.add_argument("--recurrent", action="store_true", help="a policy with an LSTM, by sb3-contrib")
parser.add_argument("--steps", type=int, default=400_000)
parser.add_argument("--num-envs", type=int, default=64)
parser.add_argument("--seed", type=int, default=0)
parser.add_argument("--out", default="ppo.zip")
arguments = parser.parse_args()

nearest, farthest = arguments.distances
options = {"distances": range(nearest, farthest + 1)}
if "level" in gymnasium.spec(arguments.track).kwargs:
    options["level"] = arguments.level
if arguments.kinds:
    options |= {"kinds": arguments.kinds, "fresh": True}
envs = gymnasium.make_vec(arguments.track, num_envs=arguments.num_envs, **options)
for name, space in envs.single_observation_space.spaces.items():
    print(f"{name}: {list(space.shape)}")

agent = RecurrentPPOAgent if arguments.recurrent else PPOAgent
if "lidar" not in envs.single_observation_space.spaces:
    if arguments.recurrent:
        parser.error("expected a track with --recurrent, found a task without a lidar")
    agent = MapPPOAgent
model = agent.algorithm(
    "MultiInputLstmPolicy" if arguments.recurrent else "MultiInputPolicy",
    VecNormalize(VecMonitor(MazeVecEnv(envs)), norm_obs=False, gamma=0.99),  # rewards of an order of 1
    n_steps=128,
    batch_size=1024,
    n_epochs=4,
    learning_rate=5e-4,
    gamma=0.99,
    ent_coef=0.01,
    policy_kwargs={"net_arch": [256], "features_extractor_class": MapFeatures},
    seed=arguments.seed,
    device="cpu",
    verbose=1,
)
model.learn(arguments.steps)
model.save(arguments.out)
print(f"saved {arguments.out}, which sb3_agent:{agent.__name__} plays")
