"""Writes `swerve/messages.py` from the Rust types of the messages; with `--check` says whether it is up to date.

Only what rustfmt makes of plain structs and enums with serde's derives is understood; anything else is an error.
"""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass, field
from pathlib import Path

HERE = Path(__file__).resolve().parent.parent
CRATES = HERE.parent / "crates"
TARGET = HERE / "swerve" / "messages.py"

SOURCES = [
    CRATES / "swerve-geom/src/planar.rs",
    CRATES / "swerve-geom/src/obb.rs",
    CRATES / "swerve-geom/src/polyline.rs",
    CRATES / "swerve-map/src/border.rs",
    CRATES / "swerve-map/src/route.rs",
    CRATES / "swerve-map/src/router.rs",
    *sorted((CRATES / "swerve-msg/src").glob("*.rs")),
]
# What is in these files or under these names is no message, or is written by hand in `_plain.py`.
NOT_MESSAGES = {"Packed", "Away", "Written", "BlockId", "Pixels"}

SIMPLE = {
    "f64": "float",
    "f32": "float",
    "bool": "bool",
    "String": "str",
    "Time": "Time",
    "Span": "Span",
    "Digest": "int",
    "Pixels": "Pixels",
    "Border": "list[tuple[float, float]]",
    "LaneId": "int",
    **{f"{sign}{bits}": "int" for sign in "iu" for bits in ("8", "16", "32", "64", "size")},
}
PACKED = {"u8": "np.uint8", "u16": "np.uint16", "u32": "np.uint32", "f32": "np.float32"}


@dataclass
class Item:
    kind: str
    name: str
    doc: str
    attributes: str
    lines: list[str]
    # (name, type or None, doc, skipped, missing in messages of earlier versions)
    fields: list[tuple[str, str | None, str, bool, bool]] = field(default_factory=list)


def items(text: str) -> list[Item]:
    found: list[Item] = []
    lines = text.split("#[cfg(test)]\nmod tests")[0].splitlines()
    doc: list[str] = []
    attributes: list[str] = []
    i = 0
    while i < len(lines):
        line = lines[i]
        head = re.match(r"pub (struct|enum) (\w+)(<[^>]*>)?( \{|\((.*)\);)$", line)
        if line.startswith("///"):
            doc.append(line[4:])
        elif line.startswith("#["):
            attributes.append(line)
        elif head and "Serialize" in "".join(attributes):
            item = Item(head[1], head[2], " ".join(doc), "".join(attributes), [])
            if head[5] is not None:
                item.kind, item.lines = "alias", [head[5].removeprefix("pub ")]
            else:
                while lines[i + 1] != "}":
                    i += 1
                    item.lines.append(lines[i].strip())
            found.append(item)
            doc, attributes = [], []
        else:
            doc, attributes = [], []
        i += 1
    return found


def snake(name: str) -> str:
    return re.sub(r"(?<=[a-z0-9])([A-Z])", r"_\1", name).lower()


def read_fields(item: Item) -> None:
    doc: list[str] = []
    skipped = added = False
    renamed = None
    for line in item.lines:
        if line.startswith("///"):
            doc.append(line[4:])
            continue
        if line.startswith("#["):
            skipped |= "serde(skip)" in line
            added |= "unless_default" in line
            named = re.search(r'rename = "(\w+)"', line)
            renamed = named[1] if named else renamed
            continue
        if item.kind == "struct":
            match = re.match(r"(?:pub )?(\w+): (.+),$", line)
        else:
            match = re.match(r"(\w+)(?:\((.+)\))?,$", line)
        if match is None:
            raise SystemExit(f"{item.name}: cannot read `{line}`")
        item.fields.append((renamed or match[1], match[2], " ".join(doc), skipped, added))
        doc, skipped, added, renamed = [], False, False, None


def python_type(rust: str, known: set[str]) -> str:
    rust = rust.strip()
    if rust in SIMPLE:
        return SIMPLE[rust]
    if match := re.fullmatch(r"Option<(.+)>", rust):
        return f"{python_type(match[1], known)} | None"
    if match := re.fullmatch(r"Vec<(.+)>", rust):
        return f"list[{python_type(match[1], known)}]"
    if match := re.fullmatch(r"\[(.+); (\d+)\]", rust):
        return f"tuple[{', '.join([python_type(match[1], known)] * int(match[2]))}]"
    if match := re.fullmatch(r"Packed<(\w+)>", rust):
        return f"NDArray[{PACKED[match[1]]}]"
    if re.fullmatch(r"(Vector|Point)<\w+>", rust):
        return "tuple[float, float, float]"
    bare = re.sub(r"<.*>$", "", rust)
    if bare in known or bare == "Transform":
        return bare
    raise SystemExit(f"no Python type for `{rust}`")


def text_of(doc: str) -> str:
    doc = re.sub(r"\[`?([^\]`]+)`?\](\([^)]*\))?", r"`\1`", doc)
    return doc.replace("**", "").replace("\\", "\\\\").replace('"""', "'''")


def wrapped(text: str, indent: str) -> list[str]:
    lines, line = [], indent
    for word in text.split():
        if len(line) + len(word) > 110 and line.strip():
            lines.append(line.rstrip())
            line = indent
        line += word + " "
    return [*lines, line.rstrip()]


def default(kind: str, added: bool) -> str:
    """What a field is where nothing is said: the zero of its type, if that is plain."""
    if kind.endswith("| None"):
        return " = None"
    if added and kind.startswith("list["):
        return " = field(default_factory=list)"
    if added and kind == "bool":
        return " = False"
    return ""


def write(all_items: list[Item]) -> str:
    known = {item.name for item in all_items}
    out = [
        '"""The messages on the edges between operators, field by field as the Rust types have them.',
        "",
        "Written by `tools/messages.py`: change the Rust types, not this file. SI units and radians; instants and spans",
        "are integer nanoseconds.",
        '"""',
        "",
        "from __future__ import annotations",
        "",
        "from dataclasses import dataclass, field",
        "from enum import Enum",
        "",
        "import numpy as np",
        "from numpy.typing import NDArray",
        "",
        "from ._plain import Message, Pixels, Tagged, Transform",
        "",
        "#: An instant: nanoseconds since the run started.",
        "Time = int",
        "#: A length of time in nanoseconds.",
        "Span = int",
    ]
    names = ["Message", "Pixels", "Span", "Time", "Transform"]
    for item in sorted(all_items, key=lambda item: order(item, all_items)):
        names.append(item.name)
        doc = text_of(item.doc)
        if item.kind == "alias":
            out += [f"#: {doc}", f"{item.name} = {python_type(item.lines[0], known)}"]
            continue
        if item.kind == "enum" and all(kind is None for _, kind, _, _, _ in item.fields):
            out += ["", "", f"class {item.name}(str, Enum):", *docstring(doc)]
            for name, _, about, _, _ in item.fields:
                out += [f'    {snake(name).upper()} = "{snake(name)}"', *docstring(text_of(about))]
            continue
        if item.kind == "enum":
            tags = {snake(name): kind for name, kind, _, _, _ in item.fields}
            kinds = sorted({python_type(kind, known) for kind in tags.values() if kind})
            out += ["", "", "@dataclass(frozen=True, slots=True)", f"class {item.name}(Tagged):", *docstring(doc)]
            out += ["    kind: str", *docstring("One of " + ", ".join(f"`{tag}`" for tag in tags) + ".")]
            out += [f"    value: {' | '.join(kinds)} | None = None"]
            continue
        out += ["", "", "@dataclass(slots=True)", f"class {item.name}(Message):", *docstring(doc)]
        plain = [(n, python_type(k or "", known), d, added) for n, k, d, skipped, added in item.fields if not skipped]
        last_required = max((i for i, (_, k, _, added) in enumerate(plain) if not default(k, added)), default=-1)
        for i, (name, kind, about, added) in enumerate(plain):
            out.append(f"    {name}: {kind}{default(kind, added) if i > last_required else ''}")
            if about:
                out += docstring(text_of(about))
    listed = ",\n    ".join(f'"{name}"' for name in sorted(names))
    out += ["", "", f"__all__ = [\n    {listed},\n]", ""]
    return "\n".join(out)


def docstring(doc: str) -> list[str]:
    lines = wrapped(f'"""{doc}', "    ")
    if len(lines) == 1:
        return [lines[0] + '"""']
    return [*lines, '    """']


def order(item: Item, all_items: list[Item]) -> tuple[int, int]:
    """Aliases and enums first: dataclasses name each other in texts, which are read later."""
    return ({"alias": 0, "enum": 1, "struct": 2}[item.kind], all_items.index(item))


def main() -> None:
    all_items = [item for source in SOURCES for item in items(source.read_text())]
    all_items = [item for item in all_items if item.name not in NOT_MESSAGES]
    for item in all_items:
        if item.kind != "alias":
            read_fields(item)
    # An enum that carries another one comes after it.
    all_items.sort(key=lambda item: any(kind for _, kind, _, _, _ in item.fields if item.kind == "enum"))
    text = write(all_items)
    if sys.argv[1:] == ["--check"]:
        if TARGET.read_text() != text:
            raise SystemExit(f"{TARGET.name} is not what the Rust types say: run {Path(__file__).name}")
        print(f"{TARGET.name}: {len(all_items)} types, as in Rust")
        return
    TARGET.write_text(text)


if __name__ == "__main__":
    main()
