"""Trains Stable-Baselines3's DQN with hindsight on the goal-conditioned environment, and saves the policy.

python docs/examples/sb3_her.py --steps 100000 --out her.zip
python docs/examples/sb3_her.py --tracks --distance 20 --steps 400000 --out her.zip
"""

import argparse

import gymnasium
from sb3_her_agent import GoalFeatures
from stable_baselines3 import DQN, HerReplayBuffer

import mazebench  # noqa: F401  (registers the ids)


class EndingHerReplayBuffer(HerReplayBuffer):
    """Ends a relabelled episode where its new goal is reached; the original keeps the end of the old goal."""

    def _get_virtual_samples(self, *arguments, **options):
        samples = super()._get_virtual_samples(*arguments, **options)
        achieved, desired = (samples.next_observations[key] for key in ("achieved_goal", "desired_goal"))
        return samples._replace(dones=(achieved == desired).all(dim=1, keepdim=True).float())


parser = argparse.ArgumentParser()
parser.add_argument("--steps", type=int, default=100_000)
parser.add_argument("--distance", type=int, default=3, help="cells from start to goal, at most")
parser.add_argument("--tracks", action="store_true", help="right maps of the tracks' size and known kinds, and a lidar")
parser.add_argument("--seed", type=int, default=0)
parser.add_argument("--out", default="her.zip")
arguments = parser.parse_args()

options = {"distances": range(1, arguments.distance + 1), "time_limit": max(100, 10 * arguments.distance)}
if arguments.tracks:
    options |= {"size": 31, "context_size": 31, "kinds": ("dfs", "house", "rooms"), "fresh": True}
    options |= {"sensors": "lidar", "lidar_noise": "turtlebot3"}
model = DQN(
    "MultiInputPolicy",
    gymnasium.make("mazebench/LocalGoal-13-v1", **options),
    replay_buffer_class=EndingHerReplayBuffer,
    replay_buffer_kwargs={"n_sampled_goal": 4, "goal_selection_strategy": "future"},
    learning_starts=2 * options["time_limit"],  # hindsight needs an episode that has ended
    learning_rate=5e-4,
    batch_size=64,
    policy_kwargs={"net_arch": [256], "features_extractor_class": GoalFeatures},
    buffer_size=min(arguments.steps, 200_000),
    gamma=0.95,
    target_update_interval=500,
    exploration_fraction=0.3,
    seed=arguments.seed,
    device="cpu",
    verbose=1,
)
model.learn(arguments.steps, log_interval=100)
model.policy.save(arguments.out)
agent = "LidarHerAgent" if arguments.tracks else "HerAgent"
print(f"saved {arguments.out}, which sb3_her_agent:{agent} plays")
