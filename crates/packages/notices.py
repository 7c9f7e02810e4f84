"""The licences of what is built into a binary, as one text."""

from __future__ import annotations

import json
import pathlib
import subprocess
from typing import Any

NAMES = ("LICENSE", "LICENCE", "COPYING", "COPYRIGHT", "NOTICE", "UNLICENSE")
RULE = "=" * 80
HEAD = """\
terrace is built from the packages below, each under its own licence; where a package offers several, any of them.
Numbers are those of the texts that follow, each given once. terrace's own licence is in the file LICENSE, those of the
Rust standard library are in rust-standard-library.html.
"""


def text(root: pathlib.Path, target: str) -> str:
    packages = sorted(linked(root, target), key=lambda package: (package["name"], package["version"]))
    texts: dict[str, int] = {}
    lines = []
    for package in packages:
        own = licence_files(folder(package)) or standard_texts(package["license"], packages)
        numbers = sorted({texts.setdefault(tidy(path), len(texts) + 1) for path in own})
        where = package.get("repository") or ""
        lines.append(f"{package['name']} {package['version']}: {package['license']} {numbers} {where}".rstrip() + "\n")
    # The C library, and what the compiler adds to it.
    names = {"musl": ("musl", "zig"), "gnu": ("mingw-w64",)}[target.rsplit("-", 1)[1]]
    folder_of_runtimes = root / "crates/packages/runtimes"
    runtimes = [f"{RULE}\nLinked in: {name}\n\n{(folder_of_runtimes / f'{name}.txt').read_text()}" for name in names]
    return "\n".join([HEAD, "".join(lines), *(f"{RULE}\n[{number}]\n\n{text}" for text, number in texts.items()), *runtimes])


def linked(root: pathlib.Path, target: str) -> list[dict[str, Any]]:
    """The packages whose code is in the binary: not those that only run while it is built."""
    command = ["cargo", "metadata", "--locked", "--format-version", "1", "--filter-platform", target]
    metadata = json.loads(subprocess.run(command, check=True, cwd=root, stdout=subprocess.PIPE).stdout)
    packages = {package["id"]: package for package in metadata["packages"]}
    nodes = {node["id"]: node for node in metadata["resolve"]["nodes"]}
    found, ahead = set(), [metadata["resolve"]["root"]]
    while ahead:
        package = ahead.pop()
        is_macro = any("proc-macro" in made["kind"] for made in packages[package]["targets"])
        if package in found or is_macro:
            continue
        found.add(package)
        for needed in nodes[package]["deps"]:
            if any(kind["kind"] is None for kind in needed["dep_kinds"]):
                ahead.append(needed["pkg"])
    return [packages[package] for package in found if packages[package]["source"]]


def folder(package: dict[str, Any]) -> pathlib.Path:
    return pathlib.Path(package["manifest_path"]).parent


def licence_files(folder: pathlib.Path) -> list[pathlib.Path]:
    """Those of the package and of what it brings in folders of its own, such as a library in C."""
    inner = [path for name in ("LICENSES", "licenses") for path in (folder / name).glob("*")]
    named = [path for path in folder.rglob("*") if path.name.upper().startswith(NAMES) and path.suffix != ".rs"]
    found = {path for path in named + inner if path.is_file()}
    return sorted(path for path in found if "tests" not in path.relative_to(folder).parts)


def standard_texts(licence: str, packages: list[dict[str, Any]]) -> list[pathlib.Path]:
    """Those of a package that carries none: of each licence that it offers."""
    # The CSS parser is under the same licence as the packages of its project that come without.
    css = next(folder(package) for package in packages if package["name"] == "cssparser")
    standard = rust_documents() / "licenses"
    known = {"MIT": standard / "MIT.txt", "Apache-2.0": standard / "Apache-2.0.txt", "MPL-2.0": css / "LICENSE"}
    return [known[name] for name in licence.split(" OR ")]


def rust_documents() -> pathlib.Path:
    sysroot = subprocess.run(["rustc", "--print", "sysroot"], check=True, stdout=subprocess.PIPE).stdout.decode()
    return pathlib.Path(sysroot.strip()) / "share/doc/rust"


def tidy(path: pathlib.Path) -> str:
    """A text without what differs in no word."""
    lines = (line.rstrip() for line in path.read_text(encoding="utf-8", errors="replace").strip().split("\n"))
    return "\n".join(lines) + "\n"
