"""Plays episodes of a dm_env environment, as any agent written for dm_env would.

python docs/examples/dm_env_loop.py --episodes 5
"""

import argparse

import numpy as np

import mazebench

parser = argparse.ArgumentParser()
parser.add_argument("--episodes", type=int, default=5)
arguments = parser.parse_args()

environment = mazebench.load("local", size=13, seed=0)
actions, rng = environment.action_spec(), np.random.default_rng(0)
for episode in range(arguments.episodes):
    time_step, episode_return = environment.reset(), 0.0
    while not time_step.last():
        state, context = time_step.observation["state"], time_step.observation["context"]
        time_step = environment.step(rng.integers(actions.num_values))  # your agent's choice, of state and context
        episode_return += time_step.reward
    # Discount 0 is the goal; 1 is the time limit, where a learner bootstraps.
    ending = "goal" if time_step.discount == 0 else "time limit"
    print(f"episode {episode}: return {episode_return:.0f}, {ending} after {environment.task.path_length:.2f} m")
