"""Every drawing of a job folder, read by ezdxf: no audit error or fix, every coordinate equal to the
nanometre to program.txt, order, layers, colours and closed flags as they should be."""

import ezdxf
from ezdxf.lldxf.tagger import ascii_tags_loader

from job import Job, demand, nm, run


def points_of(entity):
    """Points of an entity in nm, as ezdxf parsed them (its numbers are doubles: exact to the nm)."""
    if entity.dxftype() == "LINE":
        vectors = [entity.dxf.start, entity.dxf.end]
    elif entity.dxftype() == "POINT":
        vectors = [entity.dxf.location]
    else:
        vectors = [v.dxf.location for v in entity.vertices]
        if entity.is_closed:
            demand(len(vectors) >= 3, "a closed polyline of fewer than three vertices")
            vectors.append(vectors[0])
    for v in vectors:
        demand(v.z == 0, f"z is {v.z}")
    return [(round(v.x * 1e6), round(v.y * 1e6)) for v in vectors]


def check_numbers(path):
    """The text of every coordinate has six decimals and no sign on zero; lines end in CR LF."""
    data = path.read_bytes()
    demand(data.count(b"\n") == data.count(b"\r\n"), f"{path}: a line does not end in CR LF")
    with open(path, encoding="ascii", newline=None) as stream:
        for tag in ascii_tags_loader(stream):
            if tag.code in (10, 20, 11, 21) and tag.value.strip() != "0.0":
                nm(tag.value.strip())


def check_block(job, block, entry):
    path = job.folder / entry["files"]["dxf"]
    check_numbers(path)
    drawing = ezdxf.readfile(path)
    demand(drawing.dxfversion == "AC1009", f"{path}: version {drawing.dxfversion}")
    auditor = drawing.audit()
    demand(not auditor.errors, f"{path}: audit: {[e.message for e in auditor.errors]}")
    demand(not auditor.fixes, f"{path}: audit repaired: {[e.message for e in auditor.fixes]}")
    entities = list(drawing.modelspace())
    demand(len(entities) == len(block.strokes), f"{path}: {len(entities)} entities, {len(block.strokes)} strokes")
    count = 0
    for i, (entity, stroke) in enumerate(zip(entities, block.strokes)):
        at = f"{path}, entity {i}"
        expected = [job.controller(p) for p in stroke.points]
        kind = {1: "POINT", 2: "LINE"}.get(len(expected), "POLYLINE")
        demand(entity.dxftype() == kind, f"{at}: {entity.dxftype()}, not {kind}")
        if kind == "POLYLINE":
            closed = len(expected) >= 4 and expected[0] == expected[-1]
            demand(bool(entity.is_closed) == closed, f"{at}: closed flag {entity.is_closed}")
        demand(points_of(entity) == expected, f"{at}: points differ from program.txt")
        layer = f"{block.id}_P{stroke.pen + 1}"
        demand(entity.dxf.layer == layer, f"{at}: layer {entity.dxf.layer}, not {layer}")
        demand(layer in drawing.layers, f"{at}: layer {layer} is not in the table")
        demand(drawing.layers.get(layer).dxf.color == stroke.pen % 255 + 1, f"{at}: wrong colour")
        count += len(expected)
    return count


def check(folder):
    job = Job(folder)
    entries = job.manifest["blocks"]
    points = sum(check_block(job, b, e) for b, e in zip(job.program.blocks, entries))
    found = sorted(p.name for p in (job.folder / "blocks").glob("*.dxf"))
    demand(found == sorted(f"{b.id}.dxf" for b in job.program.blocks), "blocks/ does not hold one drawing per block")
    strokes = sum(len(b.strokes) for b in job.program.blocks)
    return f"{len(entries)} drawings, {strokes} strokes, {points} points equal to the nanometre, audit clean"


if __name__ == "__main__":
    run(check, "FOLDER", 1)
