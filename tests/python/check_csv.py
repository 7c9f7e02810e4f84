"""Every CSV file of a job folder, read by Python's csv: header, numbers of strokes and pens, and every coordinate equal
to the nanometre to program.txt."""

import csv

from job import Job, demand, nm, run


def check_block(job, block, entry):
    path = job.folder / entry["files"]["csv"]
    with open(path, encoding="ascii", newline="") as stream:
        rows = list(csv.DictReader(stream))
    expected = []
    for number, stroke in enumerate(block.strokes, 1):
        expected += [(number, stroke.pen + 1, *job.controller(p)) for p in stroke.points]
    found = [(int(r["stroke"]), int(r["pen"]), nm(r["x_mm"]), nm(r["y_mm"])) for r in rows]
    demand(found == expected, f"{path}: points differ from program.txt")
    return len(found)


def check(folder):
    job = Job(folder)
    entries = job.manifest["blocks"]
    points = sum(check_block(job, b, e) for b, e in zip(job.program.blocks, entries))
    found = sorted(p.name for p in (job.folder / "blocks").glob("*.csv"))
    demand(found == sorted(f"{b.id}.csv" for b in job.program.blocks), "blocks/ does not hold one CSV file per block")
    return f"{len(entries)} CSV files, {points} points equal to the nanometre"


if __name__ == "__main__":
    run(check, "FOLDER", 1)
