"""Trains Stable-Baselines3's SAC, which needs continuous actions, on the variant whose actions are velocities.

python docs/examples/sb3_continuous.py --steps 20000
"""

import argparse

import gymnasium
from stable_baselines3 import SAC

import mazebench  # noqa: F401  (registers the ids)

parser = argparse.ArgumentParser()
parser.add_argument("--steps", type=int, default=20_000)
arguments = parser.parse_args()

env = gymnasium.make("mazebench/Local-13-v1", actions="velocity", distances=[1])
print(f"actions: {env.action_space}, forward, left and turn")
model = SAC("MultiInputPolicy", env, learning_starts=100, buffer_size=20_000, seed=0)
model.learn(arguments.steps)
observation, info = env.reset(seed=0)
action, _ = model.predict(observation, deterministic=True)
observation, reward, terminated, truncated, info = env.step(action)
print(f"{action} drove {info['path_length']:.2f} m")
