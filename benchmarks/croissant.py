"""Describes the frozen mazes and episodes as a Croissant data set: `python -m benchmarks.croissant`.

Writes assets/croissant.json (Croissant 1.1 with the fields of its RAI vocabulary) from the manifests of the two
benchmarks. The address of the data set is `Source` of `[project.urls]` in pyproject.toml and its date of publication
`date-released` of CITATION.cff; the file has neither as long as these lack them.
"""

from __future__ import annotations

import hashlib
import json
import pathlib
import tomllib
from typing import Any

import yaml

from mazebench.errors import InputError
from mazebench.maps.benchmark import MANIFEST, PAPER_BENCHMARK, TRACKS_BENCHMARK, manifest

ROOT = pathlib.Path(__file__).parent.parent
ASSETS = ROOT / "assets"
OUT = ASSETS / "croissant.json"
FOLDERS = {PAPER_BENCHMARK: "paper_mazes", TRACKS_BENCHMARK: "tracks"}
CREATED = "2026-11-24"  # the day on which the last split, eval of the tracks, was drawn

_DESCRIPTION = """\
Mazes and episodes of mazebench, a benchmark on MuJoCo for navigation with an abstract top-down map that may be wrong. \
`paper_mazes` follows the protocol of arXiv:2412.12024: 20 train and 20 eval mazes of 13, 15, 17, 19 and 21 cells a \
side, and for each size 1,500 local and 20 hierarchical eval episodes. `tracks` has 48 train, 48 dev and 48 eval mazes \
of 31 x 31 cells and 240 episodes each for dev and eval. The maps shown to an agent follow from a maze and the seed of \
an episode."""

# Terms of http://mlcommons.org/croissant/RAI/ but for the prefix.
_RESPONSIBLE_AI = {
    "hasSyntheticData": True,
    "dataCollection": "Generators drew all mazes and episodes from seeds. Nothing was collected or scraped. The seed "
    "of the eval split of the tracks is the hash of a commit that holds all generators.",
    "dataCollectionType": ["Synthetic"],
    "dataPreprocessingProtocol": [
        "No two mazes of a size of paper_mazes, and no two of tracks, are alike under rotations and mirror images. "
        "Mazes of tracks have two free cells at least 40 cells apart."
    ],
    "dataAnnotationProtocol": [
        "No annotation by persons. Programs compute the distance on the grid, the exact shortest path of a disc of "
        "0.15 m radius, and the steps of a privileged oracle."
    ],
    "dataUseCases": [
        "Measuring zero-shot navigation to a goal in unseen mazes with a right, outdated, turned or drawn map, and "
        "how much driving time the map saves.",
        "Training and choosing agents on the splits train and dev. The split eval is for measurement alone.",
    ],
    "dataLimitations": [
        "Layouts come from generators, not from real buildings: square grids of 1 m cells, one floor, static.",
        "A score shows nothing about real robots, cameras, moving obstacles or other bodies.",
        "The eval mazes are public, so only a rule keeps them out of training.",
    ],
    "dataBiases": [
        "Depth-first mazes are all of paper_mazes and a sixth of the eval mazes of tracks.",
        "Distances to the goal are equally frequent from 1 to 15 cells in the local episodes of paper_mazes and nearly "
        "so from 15 to 40 cells in tracks, unlike trips in buildings.",
    ],
    "dataSocialImpact": "The data tells nothing about any person or place. Methods of navigation that it helps to "
    "measure serve civil and military robots alike.",
    "personalSensitiveInformation": ["None. The data describes no person and no real place."],
    "dataReleaseMaintenancePlan": "The files are frozen, and the SHA-256 of each is in a manifest. A change of mazes, "
    "episodes or metrics is a new version. docs/criteria.md has the rule for retirement.",
}

_CROISSANT_TERMS = (
    *("citeAs", "column", "equivalentProperty", "extract", "field", "fileProperty", "fileObject", "fileSet", "format"),
    *("includes", "isLiveDataset", "jsonPath", "key", "md5", "parentField", "path", "recordSet", "references", "regex"),
    *("repeated", "replace", "samplingRate", "separator", "source", "subField", "transform"),
)
_CONTEXT = {  # the official one, with the prefix of the RAI vocabulary
    "@language": "en",
    "@vocab": "https://schema.org/",
    "sc": "https://schema.org/",
    "cr": "http://mlcommons.org/croissant/",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "dct": "http://purl.org/dc/terms/",
    "conformsTo": "dct:conformsTo",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "examples": {"@id": "cr:examples", "@type": "@json"},
    **{term: f"cr:{term}" for term in _CROISSANT_TERMS},
}

# Of a file of episodes: what each column means, and its type.
_COLUMNS = {
    "maze": ("index of the maze in its split, from 0; in tracks, kind by kind as the manifest lists them", "Integer"),
    "start_row": ("row of the start cell, from 0 at the top", "Integer"),
    "start_column": ("column of the start cell, from 0 at the left", "Integer"),
    "goal_row": ("row of the goal cell", "Integer"),
    "goal_column": ("column of the goal cell", "Integer"),
    "distance": ("cells from start to goal along a shortest path on the grid", "Integer"),
    "yaw": ("heading at the start, in radians", "Float"),
    "seed": ("seed of all else that the episode draws, such as errors of the map and noise", "Integer"),
    "shortest_path": ("metres that a disc of 0.15 m radius drives at least to the goal cell", "Float"),
    "oracle_steps": ("steps to the goal that the agent oracle takes, empty where it misses the goal", "Integer"),
}


def describe() -> dict[str, Any]:
    """Returns the description of the data set, as JSON-LD."""
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    authors = [author["name"] for author in citation["authors"]]
    files = [(FOLDERS[benchmark], name) for benchmark in FOLDERS for name in (MANIFEST, *manifest(benchmark)["files"])]
    description = {
        "@context": _CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": ["http://mlcommons.org/croissant/1.1", "http://mlcommons.org/croissant/RAI/1.0"],
        "name": "mazebench",
        "description": _DESCRIPTION,
        "license": f"https://spdx.org/licenses/{citation['license']}.html",
        "creator": [{"@type": "sc:Organization", "name": name} for name in authors],
        "keywords": citation["keywords"],
        "version": f"{manifest(TRACKS_BENCHMARK)['version']}.0.0",  # of the benchmarks, not of the package
        "dateCreated": CREATED,
        "isLiveDataset": False,
        "citeAs": _bibtex(citation["title"], authors, citation["version"]),
        **{f"rai:{name}": value for name, value in _RESPONSIBLE_AI.items()},
        "distribution": [_file(folder, name) for folder, name in files],
        "recordSet": [
            (_episodes if name.startswith("episodes-") else _maze_rows)(folder, name)
            for folder, name in files
            if name.startswith(("episodes-", "mazes-"))
        ],
    }
    if "Source" in project["urls"]:
        description["url"] = project["urls"]["Source"]
    if "date-released" in citation:
        description["datePublished"] = str(citation["date-released"])
    return description


def _bibtex(title: str, authors: list[str], version: str) -> str:
    names = " and ".join(f"{{{name}}}" for name in authors)
    return (
        f"@software{{mazebench, title={{{title}}}, author={{{names}}}, version={{{version}}}, year={{{CREATED[:4]}}}}}"
    )


def _file(folder: str, name: str) -> dict[str, Any]:
    """Returns a file of the distribution; its address is relative to croissant.json."""
    path = f"{folder}/{name}"
    kind = {".csv": "text/csv", ".json": "application/json", ".txt": "text/plain"}[pathlib.Path(name).suffix]
    content = (ASSETS / path).read_bytes()
    return {
        "@type": "cr:FileObject",
        "@id": path,
        "name": name,
        "contentUrl": path,
        "contentSize": f"{len(content)} B",
        "encodingFormat": kind,
        "sha256": _sha256(folder, name, content),
    }


def _sha256(folder: str, name: str, content: bytes) -> str:
    """Returns the manifest's hash of a file, which must be that of its content; a manifest's own is computed."""
    found = hashlib.sha256(content).hexdigest()
    benchmark = next(each for each in FOLDERS if FOLDERS[each] == folder)
    expected = manifest(benchmark)["files"].get(name, found)
    if found != expected:
        raise InputError(f"{folder}/{name}: expected SHA-256 {expected}, found {found}")
    return found


def _episodes(folder: str, name: str) -> dict[str, Any]:
    path = f"{folder}/{name}"
    fields = [
        {
            "@type": "cr:Field",
            "@id": f"{_set_name(path)}/{column}",
            "name": column,
            "description": meaning,
            "dataType": f"sc:{kind}",
            "source": {"fileObject": {"@id": path}, "extract": {"column": column}},
        }
        for column, (meaning, kind) in _COLUMNS.items()
    ]
    return _record_set(path, "The frozen episodes of a task, size and split, one a record.", fields)


def _maze_rows(folder: str, name: str) -> dict[str, Any]:
    path = f"{folder}/{name}"
    field = {
        "@type": "cr:Field",
        "@id": f"{_set_name(path)}/row",
        "name": "row",
        "description": "A row of cells, from left to right: # is a wall, . is free.",
        "dataType": "sc:Text",
        "source": {"fileObject": {"@id": path}, "extract": {"fileProperty": "lines"}},
    }
    text = "The mazes of a split, row by row from the top. A maze has as many rows as a row has characters."
    return _record_set(path, text, [field])


def _record_set(path: str, description: str, fields: list[dict[str, Any]]) -> dict[str, Any]:
    name = _set_name(path)
    return {"@type": "cr:RecordSet", "@id": name, "name": name, "description": description, "field": fields}


def _set_name(path: str) -> str:
    return path.rpartition(".")[0].replace("/", "-")


def main() -> None:
    """Writes the file."""
    OUT.write_text(json.dumps(describe(), indent=1) + "\n", encoding="ascii")


if __name__ == "__main__":
    main()
