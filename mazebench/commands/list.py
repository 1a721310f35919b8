"""`mazebench list`."""

from __future__ import annotations


def list_() -> None:
    """List tasks, agents, sizes, kinds of mazes and Gymnasium ids."""
    from mazebench.agent_loading import agent_names
    from mazebench.constants import DISCRETE, TASK_VERSION, VELOCITIES
    from mazebench.maps.benchmark import MAZES_PER_SPLIT, SIZES, SPLITS
    from mazebench.maps.kinds import KINDS
    from mazebench.tasks.perturbations.flip_warp_noise import PERTURBATIONS
    from mazebench.tasks.sensors import SENSORS
    from mazebench.tasks.task_options import HIERARCHICAL, LOCAL
    from mazebench.tasks.tracks import TRACKS
    from mazebench.world.bodies import BODIES

    ids = (f"mazebench/{kind}-{SIZES[0]}-v{TASK_VERSION}" for kind in ("Local", "Hierarchical", "LocalGoal"))
    rows = {
        "agents": ", ".join(agent_names()),
        "tasks": f"{LOCAL}, {HIERARCHICAL} (version {TASK_VERSION})",
        "sizes": f"{', '.join(map(str, SIZES))} "
        f"(the paper's protocol, {MAZES_PER_SPLIT} mazes in each of {', '.join(SPLITS)})",
        "kinds": ", ".join(KINDS),
        "perturbed": ", ".join(PERTURBATIONS),
        "sensors": ", ".join(SENSORS),
        "actions": ", ".join((*DISCRETE, *VELOCITIES)),
        "bodies": ", ".join(BODIES),
        "Gymnasium": f"{', '.join(ids)} and the other sizes; mazebench/Rebuilt-v{TASK_VERSION} and the other tracks",
    }
    for name, text in rows.items():
        print(f"{name + ':':<12} {text}")
    print("\ntracks, each with levels 1 to 3 and, unless sensors are named, the lidar:")
    for name, track in TRACKS.items():
        print(f"{name + ':':<12} {track.help}")
        for number, level in enumerate(track.levels, 1):
            print(f"{'':<12} {number}: {level.meaning}")
