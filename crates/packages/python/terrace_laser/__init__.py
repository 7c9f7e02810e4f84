"""Job folders of terrace as numpy arrays.

    import terrace_laser

    job = terrace_laser.load("part.job")
    job.manifest["summary"]["time_s"]["total"]
    block = job.program.blocks[0]
    for stroke in job.program.strokes_of(0):
        print(stroke.pen, stroke.points)           # nm in the field, whole numbers
    for mark in job.scene.marks:
        print(mark.points, mark.defocus_um)        # mm on the part

Nothing is verified here: `terrace verify FOLDER` does that. Formats: docs/reference/formats.md.
"""

from ._folder import JobFolder, load
from ._program import BlockRecord, Pen, Program, Stroke, read_program
from ._scene import Mark, Motion, Part, Scene, read_scene

__all__ = [
    "BlockRecord",
    "JobFolder",
    "Mark",
    "Motion",
    "Part",
    "Pen",
    "Program",
    "Scene",
    "Stroke",
    "load",
    "read_program",
    "read_scene",
]
