"""Records a Minari data set of the planner's episodes, and reads it back.

python docs/examples/minari_dataset.py --episodes 100     (in ~/.minari, or where MINARI_DATASETS_PATH says)
"""

import argparse

import gymnasium
import minari
import numpy as np

import mazebench  # noqa: F401  (registers the ids)
from mazebench.agent import Inputs, Interface
from mazebench.agent_loading import load_agent_class

parser = argparse.ArgumentParser()
parser.add_argument("--episodes", type=int, default=100)
parser.add_argument("--dataset", default="mazebench/local-13-planner-v0")
arguments = parser.parse_args()
if arguments.dataset in minari.list_local_datasets():
    parser.error(
        f"{arguments.dataset} is there already; name another --dataset, or `minari delete {arguments.dataset}`"
    )

env = minari.DataCollector(gymnasium.make("mazebench/Local-13-v1"))
planner = load_agent_class("planner").build(Interface("local", 13, 13))
state = planner.initial_state(1)
for episode in range(arguments.episodes):
    observation, info = env.reset(seed=episode)
    new_episode, terminated, truncated = True, False, False
    while not (terminated or truncated):
        batch = {key: value[None] for key, value in observation.items()}  # agents act in a batch of environments
        inputs = Inputs(batch, np.array([new_episode]), np.array([info["is_first"]]), np.array([episode]))
        actions, state = planner.act(inputs, state)
        observation, _, terminated, truncated, info = env.step(int(actions[0]))
        new_episode = False
env.create_dataset(
    arguments.dataset,
    eval_env="mazebench/Local-13-v1",
    algorithm_name="planner",
    description="Local navigation in the 20 train mazes of 13 x 13, pairs 1 to 5 cells apart, driven by the planner.",
)
env.close()

dataset = minari.load_dataset(arguments.dataset)
returns = [episode.rewards.sum() for episode in dataset.iterate_episodes()]
print(f"{dataset.total_episodes} episodes, {dataset.total_steps} steps, mean return {np.mean(returns):.1f}")
dataset.recover_environment().reset(seed=0)
