"""Observes through a camera: a policy on pictures in many environments, and what they saw as a picture.

python docs/examples/pixels.py --out pixels.png
"""

import argparse

import cv2
import numpy as np
import torch
from torch import nn

import mazebench

parser = argparse.ArgumentParser()
parser.add_argument("--num-envs", type=int, default=4)
parser.add_argument("--steps", type=int, default=10)
parser.add_argument("--out", default="pixels.png")
arguments = parser.parse_args()

pictures = {"sensors": ["egocentric", "depth"], "look": "varied", "camera_size": 84}
envs = mazebench.make_vec("local", arguments.num_envs, size=13, **pictures)
policy = nn.Sequential(
    nn.Conv2d(3, 16, 8, stride=4), nn.ReLU(), nn.Conv2d(16, 32, 4, stride=2), nn.ReLU(), nn.Flatten(), nn.LazyLinear(6)
)
observations, infos = envs.reset(seed=0)
for _ in range(arguments.steps):
    seen = torch.as_tensor(observations["egocentric"]).permute(0, 3, 1, 2) / 255  # [B, 3, 84, 84]
    with torch.no_grad():
        actions = torch.distributions.Categorical(logits=policy(seen)).sample().numpy()
    observations, rewards, terminated, truncated, infos = envs.step(actions)
depths = np.repeat(observations["depth"][..., None] * 25.5, 3, axis=-1).astype(np.uint8)  # white at 10 m
rows = [np.concatenate(list(seen), axis=1) for seen in (observations["egocentric"], depths)]
cv2.imwrite(arguments.out, cv2.cvtColor(np.concatenate(rows), cv2.COLOR_RGB2BGR))
print(f"{arguments.out}: what {arguments.num_envs} environments saw last: colours, and how far away things are")
envs.close()
