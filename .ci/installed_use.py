"""Uses an installed mazebench as README.md says, and looks at what its commands left in this folder."""

import importlib
import json
import pathlib
import re
import sys
from importlib import metadata

import gymnasium
import numpy as np

import mazebench

for name in ("mazebench", "mazebench_agents", "mazebench_assets"):
    file = importlib.import_module(name).__file__
    assert pathlib.Path(file).is_relative_to(sys.prefix), f"{name} was imported from {file}, outside {sys.prefix}"
assert metadata.version("mazebench-mujoco") == mazebench.__version__

for folder, agent, episodes in (("planner", "planner", 1500), ("agent", sys.argv[1], 40)):
    summary = json.loads(pathlib.Path(folder, "summary.json").read_text(encoding="utf-8"))
    assert (summary["agent"], summary["overall"]["n"]) == (agent, episodes), summary["overall"]
    print(f"{agent}: success rate {summary['overall']['success_rate']:.2f} in {episodes} episodes")

readme = metadata.metadata("mazebench-mujoco").get_payload()
blocks = re.findall(r"```python\n(.*?)```", readme, re.DOTALL)
assert blocks, "README.md shows environments"
names: dict[str, object] = {}
for block in blocks:
    exec(compile(block, "README.md", "exec"), names)

# The three ways, one episode.
state = mazebench.load("local", size=13, seed=3).reset().observation["state"]
np.testing.assert_array_equal(gymnasium.make("mazebench/Local-13-v1").reset(seed=3)[0]["state"], state)
np.testing.assert_array_equal(mazebench.make_vec("local", 1, size=13).reset(seed=3)[0]["state"], [state])
