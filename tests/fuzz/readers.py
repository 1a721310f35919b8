"""Feeds readers of files from outside what a coverage-guided fuzzer makes up: `make fuzz`, or

    python tests/fuzz/readers.py READER [CORPUS] [-max_total_time=SECONDS] [more options of libFuzzer]

READER is text, image, records, summary, trajectories or checkpoint; CORPUS is a folder that keeps what was found to
reach new code. It needs atheris (`pip install atheris`), which the package does not. It ends with the input that made a
reader raise anything but an InputError, or take more than 2 GiB or 20 seconds.
"""

from __future__ import annotations

import contextlib
import io
import os
import pathlib
import sys
import tempfile
import zipfile
from collections.abc import Callable

import atheris
import numpy as np

with atheris.instrument_imports(include=["mazebench", "mazebench_agents", "json", "zipfile"]):
    from mazebench_agents.checkpoint import load_checkpoint

    from mazebench.errors import InputError
    from mazebench.evaluation.results import load_result
    from mazebench.evaluation.trajectories import FORMAT, load_trajectories
    from mazebench.maps.image import draw_maze, read_image_maze, write_image
    from mazebench.maps.maze import Maze
    from mazebench.maps.text import format_maze, read_text_maze
    from mazebench.records import EPISODES, SUMMARY, repair_and_read_lines, write_json
    from mazebench.report.reading import read_result

LIMITS = ("-timeout=20", "-rss_limit_mb=2048", "-max_len=20000")
RECORD = (
    b'{"agent":"a","task":"local","size":13,"split":"eval","episode":0,"maze":"m","start":[1,1],"goal":[1,3],"distance":2,'
    b'"success":true,"steps":7,"path_length":1.5,"shortest_path":1.5,"spl":1.0,"spl_grid":1.0,"seed":1,"map_flip":0.0,'
    b'"map_warp":0.0,"position_noise":0.0}\n'
)
ROW = {"n": 1, "success_rate": 1.0, "spl": 1.0, "spl_grid": 1.0}
ROW |= {f"{key}_ci95": [1.0, 1.0] for key in ("success_rate", "spl", "spl_grid")}
RESULT = {
    "agent": "a",
    "task": "local",
    "size": 13,
    "split": "eval",
    "benchmark": "v1",
    "episodes": 1,
    "perturbation": {"map_flip": 0.0, "map_warp": 0.0, "position_noise": 0.0},
    "provenance": {"options": {"landmark_distance": 5, "seed": 0}},
    "overall": ROW,
    "by_distance": {"2": ROW},
}


def maze() -> Maze:
    return Maze(np.pad(np.zeros((3, 3), dtype=bool), 1, constant_values=True))


def text(folder: pathlib.Path) -> tuple[bytes, pathlib.Path, Callable[[], object]]:
    return format_maze(maze()).encode(), folder / "a.txt", lambda: read_text_maze(folder / "a.txt")


def image(folder: pathlib.Path) -> tuple[bytes, pathlib.Path, Callable[[], object]]:
    write_image(draw_maze(maze(), 4), folder / "a.png")
    return (folder / "a.png").read_bytes(), folder / "a.png", lambda: read_image_maze(folder / "a.png")


def records(folder: pathlib.Path) -> tuple[bytes, pathlib.Path, Callable[[], object]]:
    write_json(folder / SUMMARY, RESULT)

    def read() -> None:
        for reader in (load_result, lambda folder: read_result(folder, bool)):
            with contextlib.suppress(InputError):
                reader(folder)
        repair_and_read_lines(folder / EPISODES, "episode")

    return RECORD, folder / EPISODES, read


def summary(folder: pathlib.Path) -> tuple[bytes, pathlib.Path, Callable[[], object]]:
    write_json(folder / SUMMARY, RESULT)
    (folder / EPISODES).write_bytes(RECORD)
    content = (folder / SUMMARY).read_bytes()

    def read() -> None:
        with contextlib.suppress(InputError):
            load_result(folder)
        read_result(folder, bool)

    return content, folder / SUMMARY, read


def trajectories(folder: pathlib.Path) -> tuple[bytes, pathlib.Path, Callable[[], object]]:
    arrays = {"length": np.array([2], "<i4"), "pose": np.zeros((2, 3), "<f2"), "shown": np.zeros((1, 22), "u1")}
    arrays |= {"num_landmarks": np.array([1], "<i4"), "landmark": np.array([9], "<i4"), "format": np.array(FORMAT)}
    content = io.BytesIO()
    np.savez(content, **arrays)
    assert zipfile.is_zipfile(content)
    return content.getvalue(), folder / "a.npz", lambda: load_trajectories(folder / "a.npz", 1)


def checkpoint(folder: pathlib.Path) -> tuple[bytes, pathlib.Path, Callable[[], object]]:
    import torch
    from mazebench_agents.checkpoint import save_checkpoint

    save_checkpoint(folder / "a", {"w": torch.zeros(2, 3)}, {"agent": "mah", "config": {}, "context_size": 13})
    return (folder / "a").read_bytes(), folder / "a", lambda: load_checkpoint(folder / "a", "mah")


READERS = {maker.__name__: maker for maker in (text, image, records, summary, trajectories, checkpoint)}


def main() -> None:
    if len(sys.argv) < 2 or sys.argv[1] not in READERS:
        sys.exit(f"expected one of {', '.join(READERS)}")
    with tempfile.TemporaryDirectory() as name:
        if child := os.fork():  # libFuzzer ends its process at once, and would leave the folder
            sys.exit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
        folder = pathlib.Path(name)
        (folder / "seeds").mkdir()
        content, path, read = READERS[sys.argv[1]](folder)
        (folder / "seeds" / "good").write_bytes(content)
        path.write_bytes(content)
        read()  # what is whole must be read

        def test_one_input(data: bytes) -> None:
            path.write_bytes(data)
            try:
                read()
            except InputError as error:
                if not str(error).isprintable():
                    raise RuntimeError("a message of more than one line") from error

        corpus = [argument for argument in sys.argv[2:] if not argument.startswith("-")]
        options = [argument for argument in sys.argv[2:] if argument.startswith("-")]
        # libFuzzer puts what it finds into the first folder.
        atheris.Setup([sys.argv[0], *LIMITS, *options, *corpus, str(folder / "seeds")], test_one_input)
        atheris.Fuzz()


if __name__ == "__main__":
    main()
