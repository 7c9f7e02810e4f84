"""The readers on job folders: `python test_readers.py STEPPED ON_THE_FLY`, with terrace_laser installed. The stepped
one has drawings as CSV.
"""

from __future__ import annotations

import json
import pathlib
import random
import shutil
import sys
import tempfile
import unittest

import numpy as np

import terrace_laser

FLY, FOLDER = pathlib.Path(sys.argv.pop()), pathlib.Path(sys.argv.pop())


class Readers(unittest.TestCase):
    def setUp(self) -> None:
        self.job = terrace_laser.load(FOLDER)
        self.copy = pathlib.Path(self.enterContext(tempfile.TemporaryDirectory())) / "copy.job"
        shutil.copytree(FOLDER, self.copy)

    def test_the_program_has_the_figures_of_the_manifest(self) -> None:
        program, manifest = self.job.program, self.job.manifest
        self.assertEqual([b.id for b in program.blocks], [b["id"] for b in manifest["blocks"]])
        self.assertEqual(len(program), sum(b["strokes"] for b in manifest["blocks"]))
        for number, (block, fact) in enumerate(zip(program.blocks, manifest["blocks"])):
            passes = [program.pens[s.pen].passes for s in program.strokes_of(number)]
            lengths = [np.hypot(*np.diff(s.points.astype(float), axis=0).T).sum() for s in program.strokes_of(number)]
            self.assertAlmostEqual(float(np.dot(lengths, passes)) / 1e6, fact["mark_mm"], 5)
            self.assertEqual([c / 1e6 for c in block.centre], fact["centre_mm"])
            self.assertEqual([s / 1e6 for s in block.stage], fact["stage"])
            self.assertEqual(block.lpfl / 1e6, fact["lpfl_mm"])

    def test_drawings_hold_the_points_of_the_program(self) -> None:
        program = self.job.program
        for number, fact in enumerate(self.job.manifest["blocks"]):
            rows = (FOLDER / fact["files"]["csv"]).read_text().splitlines()[1:]
            written = np.array([[float(word) for word in row.split(",")[2:]] for row in rows])
            points = np.concatenate([s.points for s in program.strokes_of(number)])
            np.testing.assert_array_equal(np.round(written * 1e6), points)

    def test_the_scene_lies_where_the_program_marks(self) -> None:
        scene, program = self.job.scene, self.job.program
        on_part = np.concatenate([
            program.on_part(number, np.concatenate([s.points for s in program.strokes_of(number)])) / 1e6
            for number in range(len(program.blocks))
        ])
        drawn = np.concatenate([mark.points for mark in scene.marks])
        for corner in (np.min, np.max):
            np.testing.assert_allclose(corner(drawn[:, :2], axis=0), corner(on_part, axis=0), atol=0.01)
        self.assertEqual({mark.block for mark in scene.marks}, set(range(len(program.blocks))))
        lo, hi = np.array(scene.head["part"]["box"])
        self.assertTrue(np.all(drawn >= lo - 0.01) and np.all(drawn <= hi + 0.01))
        self.assertLess(scene.part.triangles.max(), len(scene.part.vertices))
        worst = max(float(np.abs(mark.defocus_um).max()) for mark in scene.marks)
        self.assertLessEqual(worst, 500 * self.job.manifest["summary"]["budget"]["pdof_mm"] + 0.1)

    def test_the_motion_of_an_on_the_fly_job_passes_its_marks(self) -> None:
        job = terrace_laser.load(FLY)
        motion, scene = job.scene.motion, job.scene
        assert motion is not None
        self.assertIsNone(self.job.scene.motion)
        self.assertTrue(np.all(np.diff(motion.time_s) >= 0))
        self.assertAlmostEqual(float(motion.time_s[-1]), job.manifest["summary"]["time_s"], 1)
        np.testing.assert_allclose(np.linalg.norm(motion.up, axis=1), 1, atol=1e-5)
        marked, spots = np.concatenate([mark.points for mark in scene.marks]), motion.spot[motion.is_on]
        for corner in (np.min, np.max):
            np.testing.assert_allclose(corner(marked, axis=0), corner(spots, axis=0), atol=0.05)

    def damaged(self, file: str, data: bytes) -> None:
        """Reads a damaged file: it gives something, or a ValueError that names it."""
        path = self.copy / file
        path.write_bytes(data)
        job = terrace_laser.load(self.copy)
        try:
            if file == "manifest.json":
                self.assertIn("schema", job.manifest)
            else:
                self.assertIsNotNone(job.program if file == "program.txt" else job.scene)
        except ValueError as e:
            self.assertIn(str(path), str(e))

    def test_damaged_files_give_a_value_error_that_names_them(self) -> None:
        chance = random.Random(1)
        for file in ("program.txt", "view.html", "manifest.json"):
            whole = (FOLDER / file).read_bytes()
            for _ in range(60):
                self.damaged(file, whole[: chance.randrange(len(whole))])
                spoilt = bytearray(whole)
                for _ in range(20):
                    spoilt[chance.randrange(len(spoilt))] = chance.choice(b"\x00 -9\n\xff{")
                self.damaged(file, bytes(spoilt))

    def test_a_line_is_named(self) -> None:
        lines = (FOLDER / "program.txt").read_text().split("\n")
        place = next(i for i, line in enumerate(lines) if line.startswith("block "))
        lines[place + 1] = lines[place + 1].replace("+", "*").replace("-", "*")
        (self.copy / "program.txt").write_text("\n".join(lines))
        with self.assertRaisesRegex(ValueError, f"program.txt, line {place + 2}: "):
            terrace_laser.load(self.copy).program

    def test_other_versions_are_refused(self) -> None:
        manifest = json.loads((FOLDER / "manifest.json").read_text()) | {"schema": 99}
        (self.copy / "manifest.json").write_text(json.dumps(manifest))
        with self.assertRaisesRegex(ValueError, "schema 99"):
            terrace_laser.load(self.copy).manifest
        with self.assertRaises(FileNotFoundError):
            terrace_laser.load(self.copy / "blocks")


if __name__ == "__main__":
    unittest.main()
