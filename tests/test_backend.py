"""A value of MUJOCO_GL that is misspelt, or names a missing backend, matters only where something is rendered."""

from __future__ import annotations

import ctypes.util

import pytest
from processes import run_python

MISSING = [name for name, library in (("egl", "EGL"), ("osmesa", "OSMesa")) if not ctypes.util.find_library(library)]
WRONG = ["elg", *MISSING[:1]]
NO_RENDERING = (
    "generate --size 5 --format txt,mjcf",
    "eval --agent planner --split train --distances 1 --episodes-per-distance 1 --sensors egocentric",
    "render --view egocentric --sensors egocentric --out seen.png",
    "render --view map --out map.png",
    "list",
)
RENDERING = ("render --out x.png", "render --out x.png --view egocentric")
COMMANDS = """
import sys, mazebench.cli
for words in {lines}:
    sys.argv = ["mazebench", *words.split()]
    try:
        mazebench.cli.main()
    except SystemExit as ended:
        assert ended.code == {status}, words
"""


@pytest.mark.parametrize("backend", WRONG[-1:])
def test_commands_that_render_nothing_work(backend, tmp_path):
    program = COMMANDS.format(lines=NO_RENDERING, status=0)
    result = run_python("-c", program, variables={"MUJOCO_GL": backend}, cwd=tmp_path)
    assert "rendering context" not in result.stderr


@pytest.mark.parametrize("backend", ["elg", "off"])
def test_commands_that_render_say_in_one_line_what_is_wrong(backend, tmp_path):
    program = COMMANDS.format(lines=RENDERING, status=2)
    result = run_python("-c", program, variables={"MUJOCO_GL": backend}, cwd=tmp_path)
    line = f"mazebench: can't open a rendering context, MUJOCO_GL={backend}: "
    assert sum(each.startswith(line) for each in result.stderr.splitlines()) == len(RENDERING)
    assert "Traceback" not in result.stderr
    assert not any(f"set MUJOCO_GL={name}" in result.stderr for name in MISSING)


def test_every_environment_is_refused_with_the_same_line(tmp_path):
    program = """
import gymnasium, mazebench
for make in (
    lambda: gymnasium.make("mazebench/Local-13-v1"),
    lambda: gymnasium.make("mazebench/LocalGoal-13-v1"),
    lambda: mazebench.make_vec("local", 2),
    lambda: mazebench.load("local"),
    lambda: mazebench.evaluate("planner"),
):
    try:
        make()
    except mazebench.InputError as error:
        assert error.__suppress_context__  # one traceback, if nobody catches it
        print(error)
"""
    said = run_python("-c", program, variables={"MUJOCO_GL": "elg"}, cwd=tmp_path).stdout.splitlines()
    assert said == said[:1] * 5
    assert said[0].startswith("can't open a rendering context, MUJOCO_GL=elg: ")


@pytest.mark.parametrize(
    ("variables", "cause"),
    [
        ({"MUJOCO_GL": "egl", "PYOPENGL_PLATFORM": "glx"}, "PYOPENGL_PLATFORM=glx names another backend"),
        ({"MUJOCO_GL": "osmesa", "PYOPENGL_PLATFORM": "egl"}, "PYOPENGL_PLATFORM=egl names another backend"),
        ({"MUJOCO_GL": "egl", "MUJOCO_EGL_DEVICE_ID": "x"}, "MUJOCO_EGL_DEVICE_ID as a number, found 'x'"),
        ({"MUJOCO_GL": "glfw", "DISPLAY": "", "WAYLAND_DISPLAY": ""}, "MUJOCO_GL=glfw"),
    ],
    ids=str,
)
def test_all_pictures_fail_as_the_first_did_with_the_cause(variables, cause):
    program = """
import mazebench
def render_dm_env():
    env = mazebench.load("local")
    env.reset()
    env.physics.render()
for _ in range(2):
    for render in (mazebench.make("local", render_mode="rgb_array").render, render_dm_env):
        try:
            render()
        except mazebench.InputError as error:
            print(error)
"""
    lines = run_python("-c", program, variables=variables).stdout.splitlines()
    assert lines == lines[:1] * 4
    assert cause in lines[0]
