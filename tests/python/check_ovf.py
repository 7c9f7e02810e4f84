"""The OpenVectorFormat file of a job folder, read with Google's protobuf: every byte accounted for, stage
positions equal to the manifest's and points equal to program.txt's in single precision."""

import importlib
import pathlib
import sys
import tempfile

from grpc_tools import protoc

from job import Job, demand, run, single


def schema():
    """The messages of stepped_ovf.proto, compiled beside nothing of ours."""
    here = pathlib.Path(__file__).parent
    with tempfile.TemporaryDirectory() as out:
        code = protoc.main(["protoc", f"-I{here}", f"--python_out={out}", str(here / "stepped_ovf.proto")])
        demand(code == 0, "protoc failed")
        sys.path.insert(0, out)
        return importlib.import_module("stepped_ovf_pb2")


class File:
    """The bytes, and which of them were read."""

    def __init__(self, path):
        self.bytes = path.read_bytes()
        self.spans = []

    def take(self, start, end):
        demand(0 <= start <= end <= len(self.bytes), f"offset {start} to {end} is outside of the file")
        self.spans.append((start, end))
        return self.bytes[start:end]

    def offset(self, at):
        return int.from_bytes(self.take(at, at + 8), "little", signed=True)

    def message(self, at, message):
        length, shift, end = 0, 0, at
        while True:
            byte = self.bytes[end]
            length |= (byte & 0x7F) << shift
            shift, end = shift + 7, end + 1
            if byte < 0x80:
                break
        self.take(at, end)
        used = message.ParseFromString(self.take(end, end + length))
        demand(used in (None, length), "a message is shorter than its length says")
        demand(not unknown(message), f"the message at {at} has fields that the schema does not know")
        return message

    def check_gap_free(self):
        at = 0
        for start, end in sorted(self.spans):
            demand(start == at, f"bytes {at} to {start} belong to nothing or to two messages")
            at = end
        demand(at == len(self.bytes), f"the file goes on after {at}")


def unknown(message):
    from google.protobuf import unknown_fields

    return len(unknown_fields.UnknownFieldSet(message)) > 0


def check_params(job, shell):
    pens = job.manifest["pens"]
    # A set for every pen, and one for every other pair of pen and focus shift.
    shifts = {(s.pen, b.focus_shift) for b in job.program.blocks if b.focus_shift for s in b.strokes}
    demand(sorted(shell.params) == list(range(1, len(pens) + len(shifts) + 1)), "keys of the marking parameters")
    delays = job.manifest["machine"]["delays"]
    names = {pen["name"]: pen for pen in pens}
    for key, p in sorted(shell.params.items()):
        demand(p.name in names, f"pen {key} is named {p.name!r}")
        pen = names[p.name]
        demand(key > len(pens) or pen is pens[key - 1] and p.shift_mm == 0, f"pen {key} has other parameters")
        demand(p.power_w == single(pen["power_w"]), f"pen {key}: power")
        demand(p.speed_mm_s == single(pen["speed_mm_s"]), f"pen {key}: speed")
        demand(p.exposure_us == single(pen.get("dwell_us", 0)), f"pen {key}: dwell")
        demand(p.rate_hz == round(pen["frequency_khz"] * 1000), f"pen {key}: frequency")
        for name, value in [("laser_on", p.on_delay_us), ("laser_off", p.off_delay_us), ("jump", p.jump_delay_us),
                            ("mark", p.mark_delay_us), ("polygon", p.polygon_delay_us)]:
            expected = float(delays[name].removesuffix(" s")) * 1e6
            demand(abs(value - expected) <= 1e-4 * max(1, abs(expected)), f"pen {key}: delay {name} is {value} us")


def box(b):
    return (b.x0, b.y0, b.x1, b.y1)


def around(points):
    xs, ys = points[0::2], points[1::2]
    return (min(xs), min(ys), max(xs), max(ys))


def check_vectors(job, vectors, strokes, shift, params, at):
    """One vector block against the strokes left; answers with how many of them it holds."""
    kind = vectors.WhichOneof("data")
    xy = list(getattr(vectors, kind).xy)
    demand(len(xy) <= 2_000_000, f"{at}: more than a million points")
    count = {"hatches": len(xy) // 4, "dots": len(xy) // 2}.get(kind, 1)
    mine = strokes[:count]
    demand(count > 0 and len(mine) == count, f"{at}: more strokes than program.txt has")
    expected = []
    for stroke in mine:
        demand({1: "dots", 2: "hatches"}.get(len(stroke.points), "line") == kind, f"{at}: wrong kind {kind}")
        p, pen = params[vectors.params], job.manifest["pens"][stroke.pen]
        is_own = p.name == pen["name"] and p.shift_mm == single(shift / 1e6)
        demand(is_own, f"{at}: not the parameters of pen {stroke.pen + 1} and its focus")
        expected += [single(c / 1e6) for p in stroke.points for c in job.controller(p)]
    demand(xy == expected, f"{at}: points differ from program.txt")
    passes = job.manifest["pens"][mine[0].pen]["passes"]
    demand(vectors.repeats == passes - 1, f"{at}: {vectors.repeats} repeats for {passes} passes")
    demand(vectors.HasField("structuring"), f"{at}: not marked as structuring")
    demand(vectors.about.piece == 1, f"{at}: no part")
    demand(box(vectors.about.box) == around(xy), f"{at}: bounds")
    return count, around(xy)


def check_plane(job, file, pb, start, index, params):
    block, entry = job.program.blocks[index], job.manifest["blocks"][index]
    at = f"work plane {index}"
    table = file.message(file.offset(start), pb.PlaneTable())
    plane = file.message(table.shell, pb.Plane())
    demand(plane.number == index, f"{at} says it is number {plane.number}")
    demand(plane.blocks == len(table.blocks), f"{at}: num_blocks {plane.blocks}, table {len(table.blocks)}")
    demand([plane.x, plane.y, plane.z] == [single(v) for v in entry["stage"]], f"{at}: position")
    demand([plane.turn_x, plane.turn_y, plane.turn_z] == [0, 0, 0] and plane.repeats == 0, f"{at}: turned or repeated")
    patch = plane.about.patches[0]
    demand([patch.u, patch.v] == [single(v) for v in entry["centre_mm"]], f"{at}: centre")
    strokes, boxes = block.strokes, []
    for number, offset in enumerate(table.blocks):
        vectors = file.message(offset, pb.Vectors())
        count, bounds = check_vectors(
            job, vectors, strokes, block.focus_shift, params, f"{at}, vector block {number}")
        strokes = strokes[count:]
        boxes.append(bounds)
    demand(not strokes, f"{at}: {len(strokes)} strokes are missing")
    demand(box(plane.about.box) == join(boxes), f"{at}: bounds")
    return len(table.blocks), plane.machine, join(boxes)


def join(boxes):
    x0, y0, x1, y1 = zip(*boxes)
    return (min(x0), min(y0), max(x1), max(y1))


def check(folder):
    pb = schema()
    job = Job(folder)
    file = File(job.folder / "job.ovf")
    demand(file.take(0, 4) == b"LVF!", "no OpenVectorFormat file")
    table = file.message(file.offset(4), pb.FileTable())
    shell = file.message(table.shell, pb.Shell())
    planes = len(job.program.blocks)
    demand(shell.planes == planes and len(table.planes) == planes, f"{shell.planes} planes for {planes} blocks")
    demand(shell.about.created == 0, "a time of creation makes every file different")
    demand(list(shell.pieces) == [1] and shell.pieces[1].name, "one part with a name")
    check_params(job, shell)
    results = [check_plane(job, file, pb, start, i, shell.params) for i, start in enumerate(table.planes)]
    demand(len({machine for _, machine, _ in results}) == 1, "more than one machine")
    demand(box(shell.about.box) == join([b for _, _, b in results]), "bounds of the job")
    file.check_gap_free()
    return f"{planes} work planes, {sum(n for n, _, _ in results)} vector blocks, {len(file.bytes)} bytes without gap"


if __name__ == "__main__":
    run(check, "FOLDER", 1)
