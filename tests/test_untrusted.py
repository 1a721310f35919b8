"""Files from outside: each is read, or refused in one line; nothing runs away with memory or time, or runs code."""

from __future__ import annotations

import contextlib
import json
import os
import pathlib
import shutil
import struct
import sys
import warnings
import zipfile
import zlib
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import cv2
import hypothesis
import mujoco
import numpy as np
import pytest
import torch
from hostile import (
    array_header,
    broken,
    broken_json,
    damaged,
    jpeg_of_scans,
    npz,
    pickled_npz,
    pickles,
    png,
    png_chunk,
    print_nothing,
    read_limited,
    safetensors,
    sparse,
    special_files,
)
from hypothesis import strategies as st
from made_results import make_result
from mazebench_agents.checkpoint import save_checkpoint
from mazebench_agents.dqn import MAH
from mazebench_agents.overrides import override
from mazebench_agents.replay import Replay

from mazebench import cli
from mazebench.agent import Interface
from mazebench.errors import InputError, RunError
from mazebench.evaluation.comparison import compare_folders
from mazebench.evaluation.harness import EvalOptions, evaluate
from mazebench.evaluation.results import load_result, read_suite
from mazebench.evaluation.suites import SUITES, Part, SuiteRun
from mazebench.evaluation.trajectories import JOURNAL, TRAJECTORIES, TrajectoryLog, load_trajectories
from mazebench.making import write_maze
from mazebench.maps.files import read_maze, read_mazes
from mazebench.maps.image import draw_maze, read_image_maze, write_image
from mazebench.maps.maze import Maze
from mazebench.maps.text import format_maze
from mazebench.records import parse_json
from mazebench.report import writing
from mazebench.report.reading import read_result
from mazebench.training.loop import TrainOptions, train

PLAN = "#####\n#...#\n#.#.#\n#...#\n#####\n"
INTERFACE = Interface("local", 13, 13)
RANDOM = EvalOptions("random", distances=(1,), episodes_per_distance=1)
TINY = {"channels": 2, "hidden": 4, "groups": 2, "steps": 2, "num_envs": 4, "min_rows": 100, "steps_per_update": 32}
TRAINING = TrainOptions(
    "mah",
    overrides=tuple((key, str(value)) for key, value in {**TINY, "replay_capacity": 400}.items()),
    env_steps=200,
    checkpoint_steps=200,
    eval_mazes=1,
)
# What `make check-full` runs is thousands.
few_or_many = pytest.mark.parametrize("num_examples", [40, pytest.param(1500, marks=pytest.mark.slow)])
very_few_or_many = pytest.mark.parametrize("num_examples", [12, pytest.param(300, marks=pytest.mark.slow)])


def fuzz(strategy: st.SearchStrategy[Any], check: Callable[[Any], object], num_examples: int) -> None:
    """Calls `check` with so many examples."""
    settings = hypothesis.settings(
        max_examples=num_examples,
        deadline=None,
        suppress_health_check=[hypothesis.HealthCheck.too_slow, hypothesis.HealthCheck.data_too_large],
    )
    settings(hypothesis.given(strategy)(check))()


def refusal(read: Callable[..., object], *arguments: Any) -> str | None:
    """The one line that refuses a file; None if it is read. Whatever else is raised comes out."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)  # of arithmetic that nobody checked
        try:
            read(*arguments)
        except InputError as error:
            message = str(error)
            assert message
            assert message.isprintable()
            assert len(message) < 1500
            return message
    return None


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> pathlib.Path:
    """A recorded evaluation of 20 episodes."""
    folder = tmp_path_factory.mktemp("results") / "run"
    evaluate(RANDOM, folder, record=True)
    return folder


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory) -> pathlib.Path:
    """A small agent's."""
    path = tmp_path_factory.mktemp("checkpoint") / "agent.safetensors"
    return write_checkpoint(path)


def write_checkpoint(path: pathlib.Path, **changes: Any) -> pathlib.Path:
    config = override(MAH.default_config, TINY)
    metadata = {"agent": "mah", "config": TINY, "context_size": 13, **changes}
    save_checkpoint(path, MAH(config, 13).network.state_dict(), metadata)
    return path


@pytest.fixture(scope="module")
def training(tmp_path_factory) -> pathlib.Path:
    """A training run of 200 steps, finished."""
    folder = tmp_path_factory.mktemp("training") / "run"
    train(TRAINING, folder)
    return folder


@pytest.fixture(scope="module")
def suite(tmp_path_factory) -> Iterator[pathlib.Path]:
    """A suite of one part, run by one agent."""
    SUITES["tiny"] = (Part("near", {"distances": (1,), "episodes_per_distance": 1}),)
    folder = tmp_path_factory.mktemp("suites") / "tiny"
    SuiteRun("tiny", ["random"], folder).run()
    yield folder
    del SUITES["tiny"]


@pytest.fixture
def mark(tmp_path) -> pathlib.Path:
    """What pickles would make."""
    return tmp_path / "code has run"


def copied(folder: pathlib.Path, to: pathlib.Path) -> pathlib.Path:
    shutil.rmtree(to, ignore_errors=True)
    shutil.copytree(folder, to)
    return to


def content_of(folder: pathlib.Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


class TestJson:
    @pytest.mark.parametrize(
        "text",
        [
            *("NaN", "[Infinity]", "1e999", "-1e999", "[" * 33 + "]" * 33, "[" * 100_000, '{"a":' * 50_000, "1" * 5000),
            *("", "\ufeff{}", "{'a':1}", "[1,]", "nul"),
        ],
        ids=lambda text: text[:8],
    )
    def test_text_when_it_could_not_be_written_again(self, text):
        with pytest.raises(ValueError, match=r"\w") as caught:
            parse_json(text)
        assert not isinstance(caught.value, InputError)

    def test_value_when_nested_as_deep_as_may_be(self):
        assert parse_json("[" * 32 + "1e308" + "]" * 32)
        assert parse_json(b'{"a":{"b":[1,"\\u00e4"]}}') == {"a": {"b": [1, "ä"]}}
        with pytest.raises(ValueError, match="utf-8"):
            parse_json('"ä"'.encode("latin-1"))


class TestMaps:
    @few_or_many
    def test_text_when_broken(self, tmp_path, num_examples):
        path = tmp_path / "plan.txt"

        def check(content: bytes) -> None:
            path.write_bytes(content)
            if refusal(read_maze, path) is None:
                assert read_maze(path).size >= 5

        fuzz(broken(PLAN.encode()) | broken(b"*****\r\n*P G*\r\n*****\r\n"), check, num_examples)

    @few_or_many
    @pytest.mark.parametrize("kind", ["png", "jpeg", "progressive", "bmp"])
    def test_picture_when_broken(self, tmp_path, kind, num_examples):
        maze = Maze(np.array([[letter == "#" for letter in row] for row in PLAN.split()]))
        extension = {"jpeg": ".jpg", "progressive": ".jpg"}.get(kind, f".{kind}")
        options = [cv2.IMWRITE_JPEG_PROGRESSIVE, 1] if kind == "progressive" else []
        content = cv2.imencode(extension, draw_maze(maze, 8), options)[1].tobytes()
        path = tmp_path / f"plan{extension}"

        def check(content: bytes) -> None:
            path.write_bytes(content)
            refusal(read_image_maze, path)

        fuzz(broken(content), check, num_examples)

    @few_or_many
    def test_png_when_its_header_and_chunks_are_made_up(self, tmp_path, num_examples):
        path = tmp_path / "plan.png"
        kinds = st.sampled_from([b"PLTE", b"tRNS", b"acTL", b"fcTL", b"iCCP", b"zTXt", b"IHDR", b"IDAT", b"IEND"])
        chunks = st.lists(st.tuples(kinds, st.binary(max_size=40)).map(lambda parts: png_chunk(*parts)), max_size=4)
        sizes = st.sampled_from([0, 1, 5, 40, 8192, 2**20, 2**31 - 1, 2**32 - 1])

        def check(parts: tuple[Any, ...]) -> None:
            width, height, bits, colour, rows, others = parts
            path.write_bytes(png(width, height, bits, colour, rows, *others))
            refusal(read_image_maze, path)

        colours = st.sampled_from([0, 2, 3, 4, 6, 1, 255])
        parts = st.tuples(sizes, sizes.filter(lambda height: height < 8192), st.sampled_from([1, 2, 8, 16, 3]), colours)
        whole = st.tuples(parts, st.binary(max_size=200), chunks).map(lambda parts: (*parts[0], *parts[1:]))
        fuzz(whole, check, num_examples)

    @pytest.mark.parametrize("suffix", ["txt", "png"])
    @pytest.mark.parametrize("kind", ["folder", "pipe", "device", "socket", "dangling link", "circular link", "hole"])
    def test_map_when_it_is_no_file(self, tmp_path, kind, suffix):
        (tmp_path / "maps").mkdir()
        special_files(tmp_path)[kind](tmp_path / "maps" / f"a.{suffix}")
        assert refusal(read_mazes, tmp_path / "maps")
        assert refusal(read_maze, tmp_path / "maps" / f"a.{suffix}")

    @pytest.mark.parametrize("name", ["line\nend", "\x1b[2Jclear", "half \udcff", "\u202eback"])
    def test_message_when_a_name_does_not_print(self, tmp_path, name):
        (tmp_path / f"{name}.txt").write_text("#####")
        message = refusal(read_mazes, tmp_path)
        assert message
        assert "expected a square grid" in message

    def test_memory_and_time_when_small_files_want_much(self, tmp_path):
        for number, (suffix, content) in enumerate(
            [
                ("png", png(60_000, 60_000)),
                ("png", png(8192, 8193)),
                ("png", png(40, 40, 8, 0, b"", *[png_chunk(b"zTXt", b"a\0\0" + b"x" * 1000)] * 100)),
                ("jpg", jpeg_of_scans(8192, 2000)),
                ("jpg", jpeg_of_scans(65528, 1)[:1000]),
                ("bmp", b"BM" + bytes(12) + struct.pack("<IiiHHI", 40, 2**31 - 1, 2**31 - 1, 1, 24, 0) + bytes(99)),
                ("bmp", b"BM" + bytes(12) + struct.pack("<IiiHHI", 40, 8192, -8192, 1, 32, 0) + bytes(99)),
            ]
        ):
            (tmp_path / f"{number}.{suffix}").write_bytes(content)
        paths = [*sorted(tmp_path.iterdir()), tmp_path / "hole.txt"]
        sparse(paths[-1], 10**11, PLAN.encode())
        said, megabytes = read_limited({"maps": paths})
        assert all(said["maps"])
        assert str(said["maps"][3]).endswith("expected a JPEG of at most 100 scans, found 2001")
        assert megabytes < 600

    @pytest.mark.slow
    def test_memory_when_pictures_are_as_large_as_may_be(self, tmp_path):
        row = {0: 8192, 2: 3 * 8192, 6: 8 * 8192}
        for colour, bits in ((0, 8), (2, 8), (6, 16)):
            (tmp_path / f"{colour}.png").write_bytes(
                png(8192, 8192, bits, colour, (b"\0" + b"\xff" * row[colour]) * 8192)
            )
        (tmp_path / "scans.jpg").write_bytes(jpeg_of_scans(8192, 99))
        said, megabytes = read_limited({"maps": sorted(tmp_path.iterdir())}, seconds=300)
        assert all(said["maps"])
        assert megabytes < 2000


class TestCheckpoint:
    @few_or_many
    def test_agent_when_bytes_are_broken(self, checkpoint, tmp_path, num_examples):
        content = checkpoint.read_bytes()
        header = 8 + struct.unpack("<Q", content[:8])[0]
        path = tmp_path / "agent.safetensors"

        def check(content: bytes) -> None:
            path.write_bytes(content)
            refusal(lambda: MAH.build(INTERFACE, checkpoint=path))

        # Nearly all bytes are numbers, where changes matter less.
        fuzz(
            broken(content) | damaged(content[:header]).map(lambda start: start + content[header:]), check, num_examples
        )

    @few_or_many
    def test_agent_when_header_or_metadata_are_broken(self, checkpoint, tmp_path, num_examples):
        content = checkpoint.read_bytes()
        length = struct.unpack("<Q", content[:8])[0]
        header, data = json.loads(content[8 : 8 + length]), content[8 + length :]
        key = next(iter(header["__metadata__"]))
        metadata = json.loads(header["__metadata__"][key])
        path = tmp_path / "agent.safetensors"

        def check(header: str) -> None:
            path.write_bytes(safetensors(header.encode("utf-8", "surrogatepass"), data))
            refusal(lambda: MAH.build(INTERFACE, checkpoint=path))

        inner = broken_json(metadata).map(lambda text: json.dumps({**header, "__metadata__": {key: text}}))
        fuzz(inner | broken_json(header), check, num_examples)

    @pytest.mark.parametrize(
        ("metadata", "said"),
        [
            (
                {"config": {**TINY, "channels": 1024, "hidden": 8192}},
                r"expected advantage.weight \(6, 8192\), found \(6, 4\)",
            ),
            ({"config": {**TINY, "channels": 10**30}}, "expected config key 'channels' from 1 to 1024"),
            ({"config": {**TINY, "hidden": "4.5"}}, "config key 'hidden': expected int"),
            ({"context_size": 10**9}, "found context_size 1000000000"),
            ({"context_size": 13.5}, r"found context_size 13\.5"),
        ],
    )
    def test_agent_when_config_wants_much(self, tmp_path, metadata, said):
        path = write_checkpoint(tmp_path / "agent.safetensors", **metadata)
        with pytest.raises(InputError, match=said):
            MAH.build(INTERFACE, checkpoint=path)

    @pytest.mark.parametrize("value", [float("nan"), float("inf")])
    def test_agent_when_a_weight_is_no_number(self, tmp_path, value):
        path = tmp_path / "agent.safetensors"
        network = MAH.build(INTERFACE, checkpoint=write_checkpoint(path)).network
        with torch.no_grad():
            network.value.bias[0] = value
        save_checkpoint(path, network.state_dict(), {"agent": "mah", "config": TINY, "context_size": 13})
        with pytest.raises(InputError, match=r"expected finite numbers in value\.bias, found others"):
            MAH.build(INTERFACE, checkpoint=path)

    @pytest.mark.parametrize(
        "kind", ["missing", "folder", "pipe", "device", "socket", "dangling link", "circular link", "empty", "link"]
    )
    def test_checkpoint_when_it_is_no_file(self, tmp_path, kind):
        path = tmp_path / "agent.safetensors"
        special_files(tmp_path)[kind](path)
        assert refusal(lambda: MAH.build(INTERFACE, checkpoint=path))
        options = EvalOptions("mah", distances=(1,), checkpoint=str(path))
        assert refusal(evaluate, options, tmp_path / "out") or kind == "folder"

    def test_memory_when_headers_lie(self, tmp_path):
        tensor = {"dtype": "F32", "shape": [1], "data_offsets": [0, 4]}
        for number, content in enumerate(
            [
                safetensors(b"{}", length=2**62),
                safetensors(b"{" + b" " * 2**21),
                safetensors({"a": {**tensor, "shape": [2**40]}}, bytes(4)),
                safetensors({"a": {**tensor, "shape": [2**63, 2**63]}}, bytes(4)),
                safetensors({"a": {**tensor, "shape": [0, 2**62, 2**62], "data_offsets": [0, 0]}}),
                safetensors({"a": tensor, "b": tensor}, bytes(4)),
                safetensors({"a": tensor, "b": {**tensor, "data_offsets": [2, 6]}}, bytes(6)),
                safetensors({"a": {**tensor, "data_offsets": [2**40, 2**40 + 4]}}, bytes(4)),
                safetensors({"a": {**tensor, "dtype": "F4", "shape": [8]}}, bytes(4)),
                safetensors(b'{"a":' + b"[" * 100_000),
                safetensors({"__metadata__": {"mazebench-agent-1": "[" * 100_000}}),
                safetensors(
                    {"__metadata__": {"mazebench-agent-1": '{"agent":"mah","context_size":1e999,"config":{}}'}}
                ),
                safetensors({f"t{n}": {**tensor, "shape": [0], "data_offsets": [0, 0]} for n in range(15_000)}),
            ]
        ):
            (tmp_path / f"{number:02d}").write_bytes(content)
        paths = [*sorted(tmp_path.iterdir()), tmp_path / "hole"]
        sparse(paths[-1], 10**11, struct.pack("<Q", 100) + b"{" + b" " * 99)
        replays = archives_that_unpack_to_much(tmp_path / "archives", ("state", "cell", "maze", "goal"))
        said, megabytes = read_limited({"checkpoint": paths, "replay": replays})
        assert all(said["checkpoint"] + said["replay"])
        assert megabytes < 600


class TestTraining:
    FILES = ("agent.safetensors", "training.safetensors", "random.json", "replay.npz", "counters.json")

    def checkpoint_of(self, folder: pathlib.Path) -> pathlib.Path:
        return max((folder / "checkpoints").iterdir())

    def resume(self, folder: pathlib.Path) -> None:
        train(TRAINING, folder, resume=True)

    def test_run_when_whole(self, training, tmp_path):
        assert refusal(self.resume, copied(training, tmp_path / "run")) is None

    @very_few_or_many
    @pytest.mark.parametrize("name", FILES)
    def test_run_when_a_file_is_broken(self, training, tmp_path, name, num_examples):
        content = (self.checkpoint_of(training) / name).read_bytes()
        run = copied(training, tmp_path / "run")
        path = self.checkpoint_of(run) / name

        def check(content: bytes) -> None:
            path.write_bytes(content)
            refusal(self.resume, run)

        strategy = broken(content)
        if name.endswith(".json"):
            strategy |= broken_json(json.loads(content)).map(lambda text: text.encode("utf-8", "surrogatepass"))
        if name.endswith(".safetensors"):
            length = 8 + struct.unpack("<Q", content[:8])[0]
            header = json.loads(content[8:length])
            strategy |= broken_json(header).map(
                lambda text: safetensors(text.encode("utf-8", "surrogatepass"), content[length:])
            )
        fuzz(strategy, check, num_examples)

    @very_few_or_many
    def test_run_when_config_or_metrics_are_broken(self, training, tmp_path, num_examples):
        run = copied(training, tmp_path / "run")
        config, metrics = (json.loads((run / name).read_text()) for name in ("config.json", "metrics.jsonl"))

        def check(parts: tuple[str, str]) -> None:
            name, text = parts
            copied(training, run)
            (run / name).write_bytes(text.encode("utf-8", "surrogatepass"))
            refusal(self.resume, run)

        names = st.sampled_from(["config.json", "metrics.jsonl"])
        values = {"config.json": config, "metrics.jsonl": metrics}
        texts = names.flatmap(
            lambda name: st.tuples(st.just(name), broken_json(values[name]).map(lambda text: text + "\n"))
        )
        fuzz(texts, check, num_examples)

    @pytest.mark.parametrize(
        ("name", "change", "said"),
        [
            ("maze", lambda array: array + 20, "expected the replay of these 20 mazes, found another"),
            ("cell", lambda array: array + 169, "expected the replay of these 20 mazes, found another"),
            ("action", lambda array: array + 100, "expected the replay of these 20 mazes, found another"),
            ("action", lambda array: array - 100, "expected action from -1 to inf, found others"),
            ("state", lambda array: array * np.float32("nan"), "expected finite numbers in state, found others"),
            ("state", lambda array: array.astype(np.float64), "an array of float64"),
            ("state", lambda array: array[:, :3], r"expected state of shape \(4, 5\d, 12\), found \(4, 3, 12\)"),
            ("next", lambda array: array - 1000, "expected cell of shape|expected state of shape"),
            ("next", lambda array: array + 2**62, "expected state of shape"),
            ("priorities", lambda array: array - 1e3, "expected priorities from 0 to"),
            ("largest_priority", lambda array: array * np.inf, "expected finite numbers in largest_priority"),
            ("current", lambda array: array[:2], r"expected current of shape \(4,\), found \(2,\)"),
        ],
    )
    def test_replay_when_an_array_is_wrong(self, training, tmp_path, name, change, said):
        run = copied(training, tmp_path / "run")
        path = self.checkpoint_of(run) / "replay.npz"
        with np.load(path) as content:
            arrays = {key: content[key] for key in content.files}
        np.savez(path, **{**arrays, name: change(arrays[name])})
        with pytest.raises(InputError, match=rf"replay\.npz: .*({said})"):
            self.resume(run)

    @pytest.mark.parametrize(
        "name", ["config.json", "metrics.jsonl", "metrics.jsonl.tmp", "counters.json", "replay.npz"]
    )
    @pytest.mark.parametrize("kind", ["folder", "pipe", "device", "link", "circular link"])
    def test_run_when_something_else_stands_for_a_file(self, training, tmp_path, name, kind):
        run = copied(training, tmp_path / "run")
        path = (self.checkpoint_of(run) if name in self.FILES else run) / name
        path.unlink(missing_ok=True)
        special_files(tmp_path)[kind](path)
        with contextlib.suppress(OSError):  # which the command line says in one line, too
            assert refusal(self.resume, run) or kind == "circular link"  # which leads nowhere: as if nothing were there
        assert (tmp_path / "victim").read_text() == "mine\n"

    def test_folders_when_they_only_look_like_checkpoints(self, training, tmp_path):
        run = copied(training, tmp_path / "run")
        for year in ("2023", "2024"):
            (run / "checkpoints" / year).mkdir()
            (run / "checkpoints" / year / "photograph").touch()
        options = TrainOptions(**{**vars(TRAINING), "env_steps": 400})
        train(options, run, resume=True)
        assert {"2023", "2024"} <= {path.name for path in (run / "checkpoints").iterdir()}

    @pytest.mark.parametrize(
        "value", ["1e99", "1" * 5000, "nan", "inf", "", "[1]", "0x10", "\x1b[2J"], ids=lambda value: value[:5]
    )
    @pytest.mark.parametrize("key", ["hidden", "learning_rate", "num_envs", "replay_capacity", "symmetries"])
    def test_option_when_its_value_is_absurd(self, tmp_path, key, value):
        options = TrainOptions("mah", overrides=((key, value),), env_steps=0)
        assert refusal(train, options, tmp_path / "run") or (key, value) == ("learning_rate", "1e99")


def archives_that_unpack_to_much(folder: pathlib.Path, names: Sequence[str]) -> list[pathlib.Path]:
    """Small files that hold, or claim to hold, arrays of 400 MB to many GB, or thousands of members."""
    folder.mkdir()
    npz(folder / "0", {f"{name}.npy": array_header((2**27,), "u1") + bytes(2**27) for name in names[:3]})
    npz(folder / "1", {f"{name}.npy": array_header((2**40, 16)) for name in names})
    npz(folder / "2", {f"{number}": b"" for number in range(5_000)})
    npz(folder / "3", {f"{name}.npy": b"" for name in names}, zipfile.ZIP_LZMA)
    npz(folder / "4", {"format.npy": array_header((2**28,), "<U1") + bytes(2**20)})
    sparse(folder / "5", 10**11, b"PK\3\4")
    return sorted(folder.iterdir())


def read_as_all_do(folder: pathlib.Path) -> None:
    """Reads a folder of results as `compare` and as `report` do; both must refuse it, or neither."""
    messages = [refusal(load_result, folder), refusal(read_result, folder, print_nothing)]
    if messages[0] is None:
        compare_folders(folder, folder)


class TestResults:
    @few_or_many
    def test_summary_when_broken(self, run, tmp_path, num_examples):
        folder = copied(run, tmp_path / "run")
        summary = json.loads((run / "summary.json").read_text())

        def check(text: str) -> None:
            (folder / "summary.json").write_bytes(text.encode("utf-8", "surrogatepass"))
            read_as_all_do(folder)

        fuzz(broken_json(summary), check, num_examples)

    @few_or_many
    def test_records_when_broken(self, run, tmp_path, num_examples):
        folder = copied(run, tmp_path / "run")
        content = (run / "episodes.jsonl").read_bytes()
        lines = content.splitlines(keepends=True)

        def check(content: bytes) -> None:
            (folder / "episodes.jsonl").write_bytes(content)
            read_as_all_do(folder)

        first = broken_json(json.loads(lines[0])).map(lambda text: text.encode("utf-8", "surrogatepass") + b"\n")
        fuzz(broken(content) | first.map(lambda line: line + b"".join(lines[1:])), check, num_examples)

    @few_or_many
    def test_trajectories_when_an_archive_is_broken(self, run, tmp_path, num_examples):
        content = (run / TRAJECTORIES).read_bytes()
        path = tmp_path / TRAJECTORIES

        def check(content: bytes) -> None:
            path.write_bytes(content)
            refusal(load_trajectories, path, 20)

        fuzz(broken(content) | damaged(content[-600:]).map(lambda end: content[:-600] + end), check, num_examples)

    @few_or_many
    def test_array_when_its_header_is_made_up(self, run, tmp_path, num_examples):
        path = tmp_path / TRAJECTORIES
        with zipfile.ZipFile(run / TRAJECTORIES) as archive:
            members = {name: archive.read(name) for name in archive.namelist()}
        texts = st.sampled_from(
            [
                "-" * 9000 + "1",
                "(" * 900,
                "1+" * 400 + "1j",
                "{'descr': '<f2', 'fortran_order': False, 'shape': (-1, 3)}",
                "{'descr': '|O', 'fortran_order': False, 'shape': (2, 3)}",
                "{'descr': [('a', '<f2')] * 3, 'fortran_order': False, 'shape': ()}",
                "{'descr': 'V2147483647', 'fortran_order': False, 'shape': (2147483647,)}",
                "{'descr': '<f2', 'fortran_order': False, 'shape': (True, None)}",
                "__import__('os').system('true')",
            ]
        ) | st.text(max_size=200)

        def check(text: str) -> None:
            header = text.encode("utf-8", "surrogatepass")
            content = b"\x93NUMPY\1\0" + struct.pack("<H", len(header)) + header + bytes(60)
            npz(path, {**members, "pose.npy": content})
            assert refusal(load_trajectories, path, 20)

        fuzz(texts, check, num_examples)

    @pytest.mark.parametrize("name", ["summary.json", "episodes.jsonl", TRAJECTORIES])
    @pytest.mark.parametrize(
        "kind", ["missing", "folder", "pipe", "device", "socket", "dangling link", "circular link", "hole", "empty"]
    )
    def test_result_when_something_else_stands_for_a_file(self, run, tmp_path, name, kind):
        folder = copied(run, tmp_path / "run")
        (folder / name).unlink()
        special_files(tmp_path)[kind](folder / name)
        lines: list[str] = []
        with contextlib.suppress(InputError):
            read_result(folder, lines.append)
            assert name == TRAJECTORIES
            assert lines or kind in ("missing", "dangling link", "circular link")
        if name != TRAJECTORIES:
            assert refusal(load_result, folder)
            assert refusal(read_result, folder, print_nothing)

    def test_memory_when_files_are_large(self, run, tmp_path):
        folders = [copied(run, tmp_path / name) for name in "abcdef"]
        sparse(folders[0] / "summary.json", 10**11, b"{")
        (folders[1] / "summary.json").write_bytes(b"[" + b"[]," * (2**22 // 3 - 2) + b"[]]")
        sparse(folders[2] / "episodes.jsonl", 10**11, b"{")
        (folders[3] / "episodes.jsonl").write_bytes(b"[" + b"[]," * 2**23)
        (folders[4] / "episodes.jsonl").write_bytes(b"{}\n" * 2**20)
        with (folders[5] / "episodes.jsonl").open("ab") as file:
            file.write(b'{"episode":20}' + b"\n" * 2**20)
        begun = [copied(run, tmp_path / f"begun {name}") for name in "abcd"]
        for folder, name in zip(begun, ("config.json", "episodes.jsonl", "journal.jsonl", JOURNAL), strict=True):
            sparse(folder / name, 10**11, b"{")
        archives = archives_that_unpack_to_much(tmp_path / "archives", ("pose", "shown", "landmark"))
        paths = {"result": folders, "report": folders, "resume": begun, "trajectories": archives}
        said, megabytes = read_limited(paths)
        assert all(message for messages in said.values() for message in messages)
        assert megabytes < 600

    @pytest.mark.slow
    def test_memory_when_records_are_as_many_as_may_be(self, run, tmp_path):
        folder = copied(run, tmp_path / "run")
        record = json.loads((run / "episodes.jsonl").read_text().splitlines()[0])
        with (folder / "episodes.jsonl").open("w") as file:
            for number in range(2**28 // 400):
                file.write(json.dumps({**record, "episode": number}, separators=(",", ":")) + "\n")
        for reader in ("result", "report"):
            said, megabytes = read_limited({reader: [folder]}, gigabytes=8, seconds=300)
            assert said[reader]
            assert megabytes < 1500

    def test_report_when_agents_have_strange_names(self, tmp_path):
        names = ["$\\frac{", "a|b`c`", "</script><script>alert(1)</script>", "%n & _x_ \\end{", "ä " * 40, "=1+1"]
        for number, name in enumerate(names):
            make_result(tmp_path / "results" / str(number), name, num_mazes=2)
        lines: list[str] = []
        results = writing.write_report([tmp_path / "results"], tmp_path / "out", lines.append)
        assert {result.agent for result in results} == set(names)
        assert all("not installed" in line for line in lines)
        assert "<script>alert" not in (tmp_path / "out" / "report.html").read_text()

    @pytest.mark.parametrize("num_examples", [12, pytest.param(100, marks=pytest.mark.slow)])
    def test_report_when_numbers_are_strange_but_legal(self, tmp_path, num_examples):
        good = make_result(tmp_path / "good", "mah", num_mazes=2)
        lines = [json.loads(line) for line in (good / "episodes.jsonl").read_text().splitlines()]
        summary = json.loads((good / "summary.json").read_text())
        folder = copied(good, tmp_path / "strange")
        numbers = st.sampled_from([0, 1, 1e-300, 1e15, 2**53 - 1])

        def check(parts: tuple[Any, ...]) -> None:
            size, split, noise, steps, length, distance, seed, maze = parts
            changes = {"size": size, "split": split, "position_noise": noise, "steps": steps, "path_length": length}
            changes |= {"distance": distance, "seed": seed, "success": False, "spl": 0, "spl_grid": 0, "maze": maze}
            changed = [{**record, **changes} for record in lines]
            (folder / "episodes.jsonl").write_text("".join(json.dumps(record) + "\n" for record in changed))
            perturbation = {**summary["perturbation"], "position_noise": noise}
            provenance = {
                **summary["provenance"],
                "python": [1],
                "machine": {"a": {}},
                "command": [{}, 1],
                "packages": 7,
            }
            edited = {**summary, "size": size, "split": split, "perturbation": perturbation, "provenance": provenance}
            (folder / "summary.json").write_text(json.dumps(edited))
            if refusal(writing.read_results, [folder, good], print_nothing) is None and num_examples > 12:
                refusal(writing.write_report, [folder, good], tmp_path / "out", print_nothing)

        parts = (st.sampled_from([13, 15, 5, 255]), st.sampled_from(["eval", "train", "custom"]), numbers, numbers)
        names = st.sampled_from(["13-eval-00", "", "x" * 300, "13-eval-99"])
        fuzz(st.tuples(*parts, numbers, st.sampled_from([0, 1, 168, 65_024]), numbers, names), check, num_examples)

    def test_command_when_a_finished_run_was_edited(self, run, tmp_path, monkeypatch, capsys):
        folder = copied(run, tmp_path / "run")
        (folder / "summary.json").write_text("{}")
        arguments = ["--agent", "random", "--distances", "1", "--episodes-per-distance", "1", "--resume", "--out"]
        monkeypatch.setattr(sys, "argv", ["mazebench", "eval", *arguments, str(folder)])
        with pytest.raises(SystemExit) as caught:
            cli.main()
        assert caught.value.code == 2
        assert len(capsys.readouterr().err.splitlines()) == 1


class TestResume:
    @pytest.fixture
    def begun(self, run, tmp_path) -> pathlib.Path:
        """The run as if it had been killed near its end."""
        folder = copied(run, tmp_path / "begun")
        (folder / "summary.json").unlink()
        return folder

    @very_few_or_many
    @pytest.mark.parametrize("name", ["config.json", "episodes.jsonl", "journal.jsonl"])
    def test_run_when_a_file_is_broken(self, run, begun, tmp_path, name, num_examples):
        whole = (run / "episodes.jsonl").read_bytes()
        content = whole if name != "config.json" else (run / name).read_bytes()
        value = json.loads(content.splitlines()[0] if name != "config.json" else content)
        folder = tmp_path / "out"

        def check(content: bytes) -> None:
            copied(begun, folder)
            if name == "journal.jsonl":
                (folder / "episodes.jsonl").unlink()
            (folder / name).write_bytes(content)
            before = content_of(folder)
            if refusal(lambda: evaluate(RANDOM, folder, resume=True)) is None:
                assert (folder / "episodes.jsonl").read_bytes().count(b"\n") == 20
            else:
                assert content_of(folder).keys() == before.keys()

        texts = broken_json(value).map(lambda text: text.encode("utf-8", "surrogatepass") + b"\n")
        fuzz(broken(content) | texts, check, num_examples)

    @pytest.mark.parametrize(
        "name", ["config.json", "config.json.tmp", "episodes.jsonl", "journal.jsonl", "summary.json.tmp", JOURNAL]
    )
    @pytest.mark.parametrize("kind", ["folder", "pipe", "device", "link", "dangling link", "circular link"])
    def test_run_when_something_else_stands_for_a_file(self, begun, tmp_path, name, kind):
        (begun / name).unlink(missing_ok=True)
        special_files(tmp_path)[kind](begun / name)
        if name == "config.json.tmp":
            (begun / "config.json").unlink()
        with contextlib.suppress(RunError):  # of a file that is wanted only at the end
            refusal(lambda: evaluate(RANDOM, begun, resume=True, record=True))
        assert (tmp_path / "victim").read_text() == "mine\n"
        assert not (tmp_path / "nothing").exists()

    @pytest.mark.parametrize(
        ("counts", "said"),
        [((0, 0, 22, 1), "found episode 0"), ((0, 1, 22, 0), "found episode 0"), ((3, 1, 4, 1), "found episode 3")],
    )
    def test_journal_when_a_block_holds_no_trajectory(self, tmp_path, counts, said):
        _, num_poses, num_map_bytes, num_landmarks = counts
        body = bytes(6 * num_poses + num_map_bytes + 4 * num_landmarks)
        head = struct.pack("<IIIII", *counts, 0)
        checksum = zlib.crc32(body, zlib.crc32(head))
        (tmp_path / JOURNAL).write_bytes(struct.pack("<IIIII", *counts, checksum) + body)
        with pytest.raises(InputError, match=rf"journal: expected a pose, a goal and a map of 13 cells a side, {said}"):
            TrajectoryLog(tmp_path, 20, 13)

    def test_trajectories_when_of_other_mazes(self, run, tmp_path):
        with pytest.raises(InputError, match="expected maps of 15 cells a side, found 13"):
            TrajectoryLog(run, 20, 15)


class TestSuites:
    @few_or_many
    @pytest.mark.parametrize("name", ["suite.json", "random/near/summary.json"])
    def test_suite_when_broken(self, suite, tmp_path, name, num_examples):
        folder = copied(suite, tmp_path / "out")
        value = json.loads((suite / name).read_text())
        run = SuiteRun("tiny", ["random"], folder)

        def read() -> None:
            read_suite(folder)
            run.run(resume=True)
            run.summaries()
            compare_folders(folder, suite)

        def check(text: str) -> None:
            (folder / name).write_bytes(text.encode("utf-8", "surrogatepass"))
            refusal(read)

        fuzz(broken_json(value), check, num_examples)
        assert {path.name for path in tmp_path.iterdir()} == {"out"}

    @pytest.mark.parametrize("kind", ["missing", "folder", "pipe", "device", "dangling link", "hole", "empty"])
    def test_suite_when_something_else_stands_for_its_file(self, suite, tmp_path, kind):
        folder = copied(suite, tmp_path / "out")
        (folder / "suite.json").unlink()
        special_files(tmp_path)[kind](folder / "suite.json")
        assert refusal(read_suite, folder)
        assert refusal(lambda: SuiteRun("tiny", ["random"], folder).run(resume=True))


class TestNoCodeRuns:
    def test_pickle_when_it_stands_for_any_file(self, run, training, tmp_path, mark):
        for number, (kind, content) in enumerate(pickles(mark).items()):
            (tmp_path / kind).mkdir()
            for name in ("a.txt", "a.png", "agent.safetensors"):
                (tmp_path / kind / name).write_bytes(content)
            assert refusal(read_mazes, tmp_path / kind / "a.txt")
            assert refusal(read_mazes, tmp_path / kind / "a.png")
            assert refusal(lambda path=tmp_path / kind / "agent.safetensors": MAH.build(INTERFACE, checkpoint=path))
            for name in ("summary.json", "episodes.jsonl"):
                folder = copied(run, tmp_path / f"run-{number}")
                (folder / name).write_bytes(content)
                assert refusal(load_result, folder)
                assert refusal(read_result, folder, print_nothing)
            assert refusal(load_trajectories, tmp_path / kind / "agent.safetensors", 20)
            for name in TestTraining.FILES:
                folder = copied(training, tmp_path / f"training-{number}")
                (max((folder / "checkpoints").iterdir()) / name).write_bytes(content)
                assert refusal(train, TRAINING, folder, True), name
        assert not mark.exists()

    def test_object_arrays_when_in_archives(self, run, tmp_path, mark):
        with np.load(run / TRAJECTORIES) as arrays:
            pickled_npz(tmp_path / TRAJECTORIES, arrays.files, mark)
        assert refusal(load_trajectories, tmp_path / TRAJECTORIES, 20)
        Replay(4, 400).save(tmp_path / "replay.npz")
        with np.load(tmp_path / "replay.npz") as arrays:
            pickled_npz(tmp_path / "replay.npz", arrays.files, mark)
        assert refusal(Replay(4, 400).load, tmp_path / "replay.npz")
        assert not mark.exists()

    def test_pickle_when_it_is_loaded(self, tmp_path, mark):
        # What the tests above rest on: these files do run code where they are let to.
        pickled_npz(tmp_path / "x.npz", ["a"], mark)
        with np.load(tmp_path / "x.npz", allow_pickle=True) as arrays, contextlib.suppress(ValueError):
            arrays["a"]
        assert mark.exists()

    def test_folders_when_they_name_agents(self, run, tmp_path, mark, monkeypatch):
        """Results that claim to be of a module's agent make nobody import it."""
        (tmp_path / "evil_at_hand.py").write_text(f"import os\nos.mkdir({str(mark)!r})\nclass Evil: pass\n")
        monkeypatch.chdir(tmp_path)
        monkeypatch.syspath_prepend(tmp_path)
        folder = make_result(tmp_path / "results", "evil_at_hand:Evil", num_mazes=2)
        writing.write_report([folder], tmp_path / "out", print_nothing)
        compare_folders(folder, folder)
        assert not mark.exists()


def test_map_when_written_by_a_stranger_and_exported(tmp_path):
    """A name with markup in it stays a name in the files that are made of a map."""
    name = 'a"><include file="/etc/passwd"/><x y="'
    maze = Maze(np.array([[letter == "#" for letter in row] for row in PLAN.split()]), name.replace("/", "_"))
    paths = write_maze(maze, tmp_path, ["txt", "mjcf", "png"])
    assert mujoco.MjModel.from_xml_path(str(paths[1])).ngeom
    assert read_maze(paths[0]) == maze
    assert format_maze(read_maze(paths[2])) == format_maze(maze)
    write_image(draw_maze(maze), tmp_path / "x.png")
    assert os.listdir(tmp_path)
