"""The names of a task in results: its words, the setting by which results are grouped, and the order of tables."""

from __future__ import annotations

from typing import Any

from mazebench.maps.real_buildings import PREFIX, building_of, is_real
from mazebench.options import fields_of
from mazebench.tasks.sensors import CHOICES_OF_SENSORS, NOISE_OF_SENSORS, SENSORS
from mazebench.tasks.task_options import ENDS, TaskOptions
from mazebench.tasks.tracks import LEVELS, TRACKS
from mazebench.world.bodies import SLIDER

# Options that an agent may choose, or is not told, while the same is played.
_OF_AGENTS = ("actions", "sensors", *CHOICES_OF_SENSORS, "hide", "exact_pose", "context_size")


def setting_of(options: TaskOptions) -> TaskOptions:
    """Returns the options without distances and what an agent chooses or is not told, by which results are grouped."""
    left = [*_OF_AGENTS, "distances", "time_limit"]
    left += [] if options.is_hierarchical else ["landmark_distance"]
    left += [] if options.mazes is None else ["split"]
    bare: dict[str, Any] = {name: fields_of(TaskOptions)[name].default for name in left}
    if options.is_frozen_building:  # all buildings of a setting
        setting = PREFIX + building_of(options.mazes).setting
        shown = {None: None, options.mazes: setting}.get(options.shown, f"{PREFIX}older")
        bare |= {"mazes": setting, "shown": shown, "split": options.split, "size": None, "cell_size": None}
    noisy = tuple(NOISE_OF_SENSORS[name] for name in options.noise if name in NOISE_OF_SENSORS)
    return options.replace(**bare | {"sensors": noisy})


def title_of(options: TaskOptions) -> str:
    """Returns the task, of a track its level, and of several goals their number: "rebuilt 2", "rebuilt 2, 3 goals"."""
    goals = f", {options.num_goals} goals" if options.num_goals > 1 else ""
    return (options.task if options.track is None else f"{options.task} {_levels(options)}") + goals


def described(options: TaskOptions) -> str:
    """Returns all that is played in words: "local, 13 × 13, custom mazes, cells of 0.5 m"."""
    parts = [options.task] if options.track is None else [options.task, f"level {_levels(options)}"]
    parts += [f"{options.num_goals} goals"] * (options.num_goals > 1)
    parts += [f"{options.size} × {options.size}"] * (options.size is not None)
    if is_real(options.mazes):
        parts.append(f"real buildings ({options.mazes.removeprefix(PREFIX)})")
    if options.split_in_results != "eval":
        parts.append(f"{options.split_in_results} mazes")
    parts += own_in_words(options)
    if options.is_hierarchical:
        parts.append(f"landmarks every {options.landmark_distance}")
    parts += [f"{name.replace('_', ' ')} {strength:g}" for name, strength in options.active_perturbations]
    return ", ".join(parts)


def own_in_words(options: TaskOptions) -> tuple[str, ...]:
    """Returns a user's choices besides the mazes: the body, the size of a cell, start and goal, noise on the senses."""
    body = () if options.body == SLIDER.name else (f"body {options.driven_body.name}",)
    scale = () if options.cell_size in (None, 1) else (f"cells of {options.cell_size:g} m",)
    shown = () if options.shown in (None, options.mazes) else ("an older map shown",)
    ends = (f"{name} {end}" for name in ENDS if (end := getattr(options, name)) is not None)
    return (*body, *scale, *shown, *ends, *noise_in_words(options))


def noise_in_words(options: TaskOptions) -> tuple[str, ...]:
    """Returns the noise on the senses that a user set, in words."""
    return tuple(f"{name.replace('_', ' ')} {value}" for name, value in options.noise.items())


def sensors_in_words(options: TaskOptions) -> str:
    """Returns the sensors, and what an agent changed of them: "lidar, egocentric (fov 170, look varied)"."""
    words, changed = ", ".join(options.sensors), options.changed()
    theirs = {name for sensor in options.sensors for name in fields_of(SENSORS[sensor].options)}
    values = [
        f"{name.rpartition('_')[2]} {changed[name]}".removesuffix(".0")
        for name in CHOICES_OF_SENSORS
        if name in changed and name in theirs
    ]
    return f"{words} ({', '.join(values)})" if values else words


def order(options: TaskOptions) -> tuple[Any, ...]:
    """Returns the key by which tables sort options."""
    landmarks = options.landmark_distance if options.is_hierarchical else 0
    of_mazes = str(options.mazes or ""), str(options.shown or ""), options.kinds, options.num_mazes or 0
    of_track = list(TRACKS).index(options.track) if options.track else -1, options.level or (), options.num_goals
    kind = options.track is not None, options.is_hierarchical, options.size or 0, options.split_in_results
    return *kind, landmarks, options.active_perturbations, *of_mazes, *of_track, own_in_words(options)


def _levels(options: TaskOptions) -> str:
    return ",".join(map(str, options.level or LEVELS[:1]))
