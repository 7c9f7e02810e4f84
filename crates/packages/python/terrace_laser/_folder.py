"""A job folder: manifest, program and scene, each read when it is first asked for."""

from __future__ import annotations

import functools
import json
import os
import pathlib
from typing import Any

from ._program import Program, read_program
from ._scene import Scene, read_scene


MANIFEST_SCHEMA = 4


class JobFolder:
    """What `terrace compile` has written."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = pathlib.Path(path)

    @functools.cached_property
    def manifest(self) -> dict[str, Any]:
        """manifest.json: figures, inputs and blocks, with units in the names of their keys.

        Raises ValueError for a folder of another version of the manifest.
        """
        file = self.path / "manifest.json"
        try:
            manifest: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
            schema = manifest["schema"]
        except (ValueError, KeyError, TypeError) as e:
            raise ValueError(f"{file}: this is no manifest: {e}") from None
        if schema != MANIFEST_SCHEMA:
            raise ValueError(f"{file}: schema {schema!r}, this package reads schema {MANIFEST_SCHEMA}")
        return manifest

    @functools.cached_property
    def program(self) -> Program:
        """program.txt of a stepped job: whole nanometres in the field of the scanner.

        Raises ValueError, with the line, for a text that is not such a program.
        """
        return read_program(self.path / "program.txt")

    @functools.cached_property
    def scene(self) -> Scene:
        """What view.html draws: part, marks and blocks in mm, in the frame of the part.

        Raises ValueError for a page of another version.
        """
        return read_scene(self.path / "view.html")


def load(path: str | os.PathLike[str]) -> JobFolder:
    """The job folder at a path. Raises FileNotFoundError where there is no manifest.json."""
    folder = JobFolder(path)
    if not (folder.path / "manifest.json").is_file():
        raise FileNotFoundError(f"{folder.path} is not a job folder: it has no manifest.json")
    return folder
