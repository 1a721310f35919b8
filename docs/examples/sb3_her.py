"""Trains Stable-Baselines3's DQN with hindsight on the goal-conditioned environment, then counts its successes.

python docs/examples/sb3_her.py --steps 100000
"""

import argparse

import gymnasium
import numpy as np
from stable_baselines3 import DQN, HerReplayBuffer
from stable_baselines3.common.type_aliases import DictReplayBufferSamples

import mazebench  # noqa: F401  (registers the ids)


class EndingHerReplayBuffer(HerReplayBuffer):
    """Ends a relabelled episode where its new goal is reached; the original keeps the end of the old goal."""

    def _get_virtual_samples(self, *arguments, **options) -> DictReplayBufferSamples:
        samples = super()._get_virtual_samples(*arguments, **options)
        achieved, desired = (samples.next_observations[key] for key in ("achieved_goal", "desired_goal"))
        return samples._replace(dones=(achieved == desired).all(dim=1, keepdim=True).float())


parser = argparse.ArgumentParser()
parser.add_argument("--steps", type=int, default=100_000)
parser.add_argument("--episodes", type=int, default=50, help="of the evaluation, in mazes it was not trained in")
parser.add_argument("--seed", type=int, default=0)
arguments = parser.parse_args()

distances = [1, 2, 3]
env = gymnasium.make("mazebench/LocalGoal-13-v1", distances=distances)
model = DQN(
    "MultiInputPolicy",
    env,
    replay_buffer_class=EndingHerReplayBuffer,
    replay_buffer_kwargs={"n_sampled_goal": 4, "goal_selection_strategy": "future"},
    learning_starts=200,  # more than an episode's 100 steps: hindsight needs one that has ended
    learning_rate=5e-4,
    batch_size=256,
    policy_kwargs={"net_arch": [256, 256]},
    buffer_size=min(arguments.steps, 100_000),
    gamma=0.95,
    target_update_interval=500,
    exploration_fraction=0.3,
    seed=arguments.seed,
)
model.learn(arguments.steps)

test = gymnasium.make("mazebench/LocalGoal-13-v1", split="eval", distances=distances)
successes = []
for episode in range(arguments.episodes):
    observation, info = test.reset(seed=episode)
    terminated = truncated = False
    while not (terminated or truncated):
        action, _ = model.predict(observation, deterministic=True)
        observation, _, terminated, truncated, info = test.step(int(action))
    successes.append(info["success"])
print(
    f"success rate {np.mean(successes):.2f} in {len(successes)} episodes of unseen mazes, {distances} cells to the goal"
)
