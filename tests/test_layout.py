"""The house rules of docs/architecture.md: who imports whom, what is packaged, what an import does."""

from __future__ import annotations

import ast
import functools
import graphlib
import importlib
import json
import pathlib
import re
import tomllib
from collections.abc import Iterator

import pytest
from processes import run_python

from mazebench.maps.kinds import NOVEL

ROOT = pathlib.Path(__file__).parent.parent
# A module imports only from those of lines above it and its own.
ORDER = (
    {"constants", "errors", "kernels", "options", "stopping", "storage"},
    {"maps"},
    {"world"},
    {"tasks"},
    {"envs"},
    {"agent", "agent_loading"},
    {"results"},
    {"evaluation"},
    {"training"},
    {"report"},
    {"play"},
    {"bench", "testing", "commands", "cli", "__main__"},
)
LAYERS = {name: layer for layer, names in enumerate(ORDER) for name in names}
# A folder of agents/ imports only from those of lines above it and itself: first parts, then agents. `mah` shares the
# learner of `dqn`.
AGENT_ORDER = (
    {"common"},
    {"robot", "muzero"},
    {"expert"},
    {"random_agent", "planner", "navigator", "neural_planner", "mmn", "dqn"},
    {"mah", "integrations"},
)
AGENT_LAYERS = {name: layer for layer, names in enumerate(AGENT_ORDER) for name in names}
# Where in the repository a library may be imported.
WALLS = {
    "mujoco": (
        "mazebench/world",
        "mazebench/envs",
        "mazebench/play/viewer.py",
        "mazebench/bench",
    ),
    "dm_control": ("mazebench/envs/dm_control.py",),
    "torch": ("agents",),
    "gymnasium": ("mazebench/envs", "mazebench/bench"),
    "numba": ("mazebench/kernels.py",),
    "minari": ("mazebench/evaluation/minari_data.py",),
    "ray": ("mazebench/evaluation/cluster.py", "mazebench/training/distributed.py"),
    "matplotlib": ("mazebench/report",),
    "pandas": ("mazebench/report",),
    "stable_baselines3": ("agents/integrations/sb3.py",),
}
FOLDERS = {"mazebench": "mazebench", "mazebench_agents": "agents", "mazebench_assets": "assets"}

PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def sources(*folders: str) -> list[pathlib.Path]:
    return sorted(path for folder in folders for path in (ROOT / folder).rglob("*.py"))


@functools.cache
def parse(path: pathlib.Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"), path.name)


def name_of(path: pathlib.Path) -> str:
    """Relative to the repository, for messages."""
    return path.relative_to(ROOT).as_posix()


def imports(path: pathlib.Path, for_types: bool = False) -> Iterator[str]:
    """The dotted names that a file imports when it runs, those inside functions included; or also for types."""
    folders = {folder: package for package, folder in FOLDERS.items()}
    top, *inner = path.relative_to(ROOT).parent.parts
    package = [folders[top], *inner]
    for node in ast.walk(parse(path)) if for_types else running(parse(path)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            module = ".".join([*base, *([node.module] if node.module else [])])
            yield from (f"{module}.{alias.name}" for alias in node.names)


def running(node: ast.AST) -> Iterator[ast.AST]:
    """All nodes but those under `if TYPE_CHECKING`, which is never true when code runs."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.If) and isinstance(child.test, ast.Name) and child.test.id == "TYPE_CHECKING":
            continue
        yield child
        yield from running(child)


def layer_of(dotted: str) -> str | None:
    """`mazes` for `mazebench.maps.maze`; None for other packages, and for what mazebench/__init__.py gives."""
    package, _, rest = dotted.partition(".")
    name = rest.partition(".")[0]
    return name if package == "mazebench" and name in modules() else None


def modules() -> set[str]:
    """The modules and folders of mazebench."""
    inside = [
        path for path in (ROOT / "mazebench").iterdir() if path.suffix == ".py" or (path / "__init__.py").exists()
    ]
    return {path.stem for path in inside} - {"__init__"}


class TestImports:
    @pytest.mark.parametrize("path", sources("mazebench"), ids=name_of)
    def test_imports_when_within_mazebench(self, path):
        importer = path.relative_to(ROOT / "mazebench").parts[0].removesuffix(".py")
        imported = {layer for layer in map(layer_of, imports(path)) if layer}
        if importer == "__init__":
            assert imported == {"envs"}, "it registers the Gymnasium ids; all else is imported when first used"
            return
        below = {layer for layer in imported if LAYERS[layer] > LAYERS[importer]}
        assert not below, f"{name_of(path)} may import only what stands above {importer}"

    @pytest.mark.parametrize(
        "folder", sorted({path.parent for path in sources("agents")} - {ROOT / "agents"}), ids=name_of
    )
    def test_imports_when_within_agents(self, folder):
        importer, *_ = folder.relative_to(ROOT / "agents").parts
        for path in folder.glob("*.py"):
            dotted = [name.split(".") for name in imports(path, for_types=True)]
            imported = {parts[1] for parts in dotted if parts[0] == "mazebench_agents"} - {importer}
            above = {name for name in imported if AGENT_LAYERS[name] < AGENT_LAYERS[importer]}
            assert imported == above, f"{name_of(path)} may import only folders that stand above {importer}"

    @pytest.mark.parametrize("library", WALLS)
    def test_library_when_imported(self, library):
        homes = [ROOT / home for home in WALLS[library]]
        strays = [
            name_of(path)
            for path in sources("mazebench", "agents", "assets")
            if any(dotted.split(".")[0] == library for dotted in imports(path))
            and not any(path == home or home in path.parents for home in homes)
        ]
        assert strays == []

    def test_agents_when_mazebench_is_imported(self):
        for path in sources("mazebench"):
            assert not [dotted for dotted in imports(path) if dotted.startswith("mazebench_agents")], name_of(path)

    def test_process_when_mazebench_is_imported(self):
        program = (
            "import os, sys, json\n"
            "import gymnasium  # which sets a variable of pygame's\n"
            "before = dict(os.environ)\n"
            "import mazebench\n"
            "heavy = ['mujoco', 'dm_control', 'torch', 'cv2', 'scipy', 'ray', 'matplotlib']\n"
            "print(json.dumps([dict(os.environ) == before, [name for name in heavy if name in sys.modules]]))"
        )
        assert json.loads(run_python("-c", program).stdout) == [True, []]

    def test_the_command_line_starts_without_mujoco(self):
        # `render` and `bench` choose a backend before MuJoCo reads it.
        program = "import sys, mazebench.cli; print({'mujoco', 'dm_control', 'torch'} & set(sys.modules))"
        assert run_python("-c", program).stdout == "set()\n"

    def test_rendering_backend_when_everything_is_imported(self):
        program = (
            "import importlib, os\n"
            "chosen = os.environ.get('MUJOCO_GL')\n"
            f"for name in {module_names('mazebench')}:\n"
            "    importlib.import_module(name)\n"
            "assert os.environ.get('MUJOCO_GL') == chosen\n"
        )
        run_python("-c", program)


@pytest.mark.parametrize("path", sources("agents", "mazebench/training"), ids=name_of)
def test_no_module_that_learns_names_a_novel_kind(path):
    """Learned agents meet these kinds first in their one play on eval."""
    names = {*NOVEL, "NOVEL"}
    assert not names & set(re.findall(r"\w+", path.read_text(encoding="utf-8")))


def dotted_name(path: pathlib.Path) -> str:
    """`mazebench.maps.maze` of the module's path."""
    packages = {folder: package for package, folder in FOLDERS.items()}
    top, *inner = path.relative_to(ROOT).with_suffix("").parts
    return ".".join([packages[top], *inner]).removesuffix(".__init__")


def module_names(package: str) -> list[str]:
    """The dotted names of all modules of a package but those that run when imported."""
    return [dotted_name(path) for path in sources(FOLDERS[package]) if path.stem != "__main__"]


def import_graph() -> dict[str, set[str]]:
    """The modules that each module imports, in functions and for types too; packages' own modules only export."""
    names = {name for package in ("mazebench", "mazebench_agents") for name in module_names(package)}
    graph: dict[str, set[str]] = {}
    for path in sources("mazebench", "agents"):
        if path.stem != "__init__":
            # What is imported is a module, or a name in one.
            dotted = set(imports(path, for_types=True))
            graph[dotted_name(path)] = (dotted | {name.rpartition(".")[0] for name in dotted}) & names
    return {name: imported & graph.keys() for name, imported in graph.items()}


class TestCircles:
    def test_no_module_imports_itself_through_others(self):
        graphlib.TopologicalSorter(import_graph()).prepare()  # or CycleError, which names them


class TestPackaging:
    def test_packages_when_compared_with_folders(self):
        found = {
            ".".join((package, *path.parent.relative_to(ROOT / folder).parts))
            for package, folder in FOLDERS.items()
            for path in (ROOT / folder).rglob("__init__.py")
        }
        listed = PYPROJECT["tool"]["setuptools"]["packages"]
        assert len(listed) == len(set(listed))
        assert set(listed) == found

    def test_data_when_compared_with_files(self):
        # A file that no pattern matches is missing from the wheel.
        patterns = PYPROJECT["tool"]["setuptools"]["package-data"]
        for package in PYPROJECT["tool"]["setuptools"]["packages"]:
            top, *inner = package.split(".")
            for path in ROOT.joinpath(FOLDERS[top], *inner).iterdir():
                if path.is_file() and path.suffix != ".py":
                    globs = patterns.get("*", []) + patterns.get(package, [])
                    assert any(path.match(pattern) for pattern in globs), name_of(path)

    @pytest.mark.parametrize(
        "target",
        [
            *PYPROJECT["project"]["scripts"].values(),
            *(target for group in PYPROJECT["project"]["entry-points"].values() for target in group.values()),
        ],
    )
    def test_entry_point_when_loaded(self, target):
        module, _, attribute = target.partition(":")
        assert callable(getattr(importlib.import_module(module), attribute))
