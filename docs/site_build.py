"""Additions to mkdocs.yml: explained fields, unbroken figures, widths of cells, the address of the repository.

A figure that has a narrow form next to it, NAME-narrow.svg or .png, is shown in that form on a phone. A film is still
for readers whose systems ask for less motion, if there is a picture of its environment. The notebook becomes a page.
"""

from __future__ import annotations

import ast
import base64
import json
import pathlib
import re
import textwrap
import tomllib

import griffe
from mkdocs.structure.files import File

_COMMENT = re.compile(r"\s# (?!noqa|type:)(.+)$")
_SHAPE = re.compile(r"^\[[^\]]*\]")
# 0.94 [0.89, 0.98]; 0.94 / 0.89 / -0.02; the level behind the name of a track.
_FIGURES = re.compile(r"\d?\.\d+ \[[-+]?\d?\.\d+, [-+]?\d?\.\d+\]|\d?\.\d+(?: / [-+]?\d?\.\d+)+|</code> \d\b")
_CELL = re.compile(r"<td([^>]*)>(.*?)</td>", re.DOTALL)
_FIGURE = re.compile(r'<img [^>]*src="(?P<folder>[^"]*/)?(?P<name>[^"/]+)\.(?P<suffix>svg|png|webp)"[^>]*>')
_IMAGES = pathlib.Path(__file__).parent / "images"
_NOTEBOOK = "examples/first_hour"
_SHORT, _LONG = 24, 60  # letters of a cell that a phone shows on one line, and of one that needs some width


def on_config(config, **kwargs) -> None:
    """Links the repository at the top of each page, once pyproject.toml names it."""
    project = pathlib.Path(config.config_file_path).with_name("pyproject.toml")
    if source := tomllib.loads(project.read_text(encoding="utf-8"))["project"]["urls"].get("Source"):
        config.repo_url, config.repo_name = source, config.site_name


def on_page_content(html: str, **kwargs) -> str:
    """A page with spaces that do not break in figures, and cells of tables that site.css can tell apart by length."""
    html = _CELL.sub(_sized_cell, _FIGURES.sub(lambda found: found[0].replace(" ", "\u00a0"), html))
    return _FIGURE.sub(_with_other_forms, html)


def on_files(files, config, **kwargs) -> None:
    """Adds the notebook as a page, and the pictures that it has drawn."""
    notebook = json.loads(pathlib.Path(config.docs_dir, f"{_NOTEBOOK}.ipynb").read_text(encoding="utf-8"))
    text, pictures = notebook_page(notebook, pathlib.PurePath(_NOTEBOOK).name)
    files.append(File.generated(config, f"{_NOTEBOOK}.md", content=text))
    for name, content in pictures.items():
        files.append(File.generated(config, f"examples/{name}", content=content))


def on_page_markdown(markdown: str, **kwargs) -> str:
    """A text whose links to the notebook lead to its page; elsewhere they lead to the notebook itself."""
    return markdown.replace(f"({_NOTEBOOK}.ipynb)", f"({_NOTEBOOK}.md)")


def notebook_page(notebook: dict, name: str) -> tuple[str, dict[str, bytes]]:
    """Returns a notebook's cells and what they have printed, as Markdown, and the pictures that they have drawn."""
    parts, pictures = [], {}
    for cell in notebook["cells"]:
        source = "".join(cell["source"])
        parts.append(source if cell["cell_type"] == "markdown" else f"```python\n{source}\n```")
        for output in cell.get("outputs", ()):
            if "text" in output:
                parts.append(f"```text\n{''.join(output['text']).rstrip()}\n```")
            elif drawn := output["data"].get("image/png"):
                picture = f"{name}-{len(pictures) + 1}.png"
                pictures[picture] = base64.b64decode("".join(drawn))
                parts.append(f"![What the cell draws]({picture})")
    parts.insert(1, f"This page is the notebook [{name}.ipynb]({name}.ipynb), with the output of one run.")
    return "\n\n".join(parts), pictures


def _with_other_forms(image: re.Match[str]) -> str:
    folder, name, suffix = image["folder"] or "", image["name"], image["suffix"]
    forms = {
        "(max-width: 44em)": (f"{name}-narrow.{suffix}", folder),
        "(prefers-reduced-motion: reduce)": (f"environments/{name}.png", folder.removesuffix("films/")),
    }
    if suffix != "webp":
        del forms["(prefers-reduced-motion: reduce)"]
    sources = [
        f'<source media="{media}" srcset="{place}{form}">'
        for media, (form, place) in forms.items()
        if (_IMAGES / form).exists()
    ]
    return f"<picture>{''.join(sources)}{image[0]}</picture>" if sources else image[0]


def _sized_cell(cell: re.Match[str]) -> str:
    length = len(re.sub(r"<[^>]+>", "", cell[2]))
    size = "short" if length <= _SHORT else "long" if length > _LONG else "medium"
    return f'<td class="{size}"{cell[1]}>{cell[2]}</td>'


class FieldComments(griffe.Extension):
    """Lists what is said of fields and constants in the docstring of their class or module, as "Attributes"."""

    def on_class_members(self, *, cls: griffe.Class, **kwargs) -> None:
        """Called when a class has been read."""
        _list_attributes(cls)

    def on_module_members(self, *, mod: griffe.Module, **kwargs) -> None:
        """Called when a module has been read."""
        _list_attributes(mod)


def _list_attributes(owner: griffe.Class | griffe.Module) -> None:
    own = [each for each in owner.attributes.values() if not each.is_alias and not each.name.startswith("_")]
    lines = [f"  {each.name}: {text}" for each in own if (text := _comment(each) or _documentation(each))]
    if lines and owner.docstring:
        owner.docstring.value += "\n\nAttributes:\n" + "\n".join(lines)


def _comment(attribute: griffe.Attribute) -> str | None:
    if attribute.endlineno is None:
        return None
    found = _COMMENT.search(attribute.lines_collection[attribute.filepath][attribute.endlineno - 1])
    # A shape in brackets would read as the text of a link.
    return _SHAPE.sub(lambda shape: f"`{shape[0]}`", found[1]) if found else None


def _documentation(attribute: griffe.Attribute) -> str | None:
    """Returns the text of the `Doc` in the annotation of an option."""
    if "Doc(" not in str(attribute.annotation):
        return None
    for node in ast.walk(ast.parse(textwrap.dedent("\n".join(attribute.lines)))):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "Doc":
            parts = getattr(node.args[0], "values", [node.args[0]])  # of an f-string
            return "".join(part.value if isinstance(part, ast.Constant) else "..." for part in parts)
    return None
