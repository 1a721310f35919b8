"""Numbers that many modules need.

This module imports nothing: `import mazebench` registers an environment for each size and must load no library.
"""

BENCHMARK_SIZES = (13, 15, 17, 19, 21)  # cells on a side of the mazes of the paper's protocol

# The version of the benchmarks and of what an episode is. Gymnasium's ids end with it. docs/guarantees.md says when it
# increases.
TASK_VERSION = 1

ON_TIME = (1.25, 2)  # an episode is on time if it takes at most so many times the oracle's steps

EPISODES_PER_DISTANCE = 5  # of an evaluation, in each maze
FROZEN_PER_MAZE = 5  # episodes of a track

SLIDER_RADIUS = 0.15  # m, of the body of the paper's protocol and of the tracks

STATE_SIZE = 12  # numbers of a state, of any body
X, Y, YAW, FORWARD_VELOCITY, LEFT_VELOCITY, YAW_RATE = 0, 1, 5, 6, 7, 11  # indices in a state, see docs/task.md

ACTIONS = ("forward", "backward", "strafe_left", "strafe_right", "look_left", "look_right")
NUM_ACTIONS = len(ACTIONS)
# The kinds of actions. Discrete ones: their names. Continuous ones: their components, each from -1 to 1.
DISCRETE = {"six": ACTIONS, "four": ("forward", "backward", "look_left", "look_right")}
VELOCITIES = {"velocity": ("forward", "left", "turn"), "diff": ("forward", "turn")}
PHYSICS_TIMESTEP = 0.008  # s; at 16 ms a body at top speed sinks 5 cm into a wall
STEPS_PER_ACTION = 20  # an action repeat of 10 frames, two physics steps each
STEP_TIME = PHYSICS_TIMESTEP * STEPS_PER_ACTION  # s, of an agent step

MAX_PIXELS = 1280  # a side of a picture
RENDERING = {"render_modes": ["rgb_array"], "render_fps": 1 / STEP_TIME}  # of the environments, in Gymnasium's words
