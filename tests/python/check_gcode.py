"""The stage programs of a job folder, run by the interpreter of LinuxCNC: it ends without error, the
stage stands at the manifest's places when a block starts, the output is off before every move and at the
end, and a dwell follows every group of moves."""

import pathlib
import re
import subprocess
import tempfile

from job import Job, demand, run

# Where a block is marked, and what switches the laser off: per file of stage program.
HANDSHAKE = ("stage.ngc", "SET_AUX_OUTPUT_BIT(0)", "CLEAR_AUX_OUTPUT_BIT(0)")
STOPS = ("stage_m0.nc", "PROGRAM_STOP()", "STOP_SPINDLE_TURNING")


def canonical(rs274, tool_table, path):
    """The canonical commands that the interpreter makes of a program."""
    for _ in range(20):
        with tempfile.TemporaryDirectory() as fresh:
            # The variable file is read and rewritten: an old one would shift this run.
            command = [rs274, "-t", tool_table, "-v", str(pathlib.Path(fresh) / "fresh.var"), "-g", str(path)]
            done = subprocess.run(command, capture_output=True, text=True, timeout=600)
        # It is killed (SIGBUS) at times where another one begins: all share the file of their tools.
        if done.returncode >= 0:
            break
    demand(done.returncode == 0, f"{path.name}: rs274 ended with {done.returncode}: {done.stderr.strip()[-500:]}")
    return [re.sub(r"^[\s\dN./]*", "", line).strip() for line in done.stdout.splitlines() if "(" in line]


def check_program(job, commands, name, start, off):
    place, at_start = [None, None, None], 0
    demand("PROGRAM_END()" in commands, f"{name}: the program has no end")
    is_off, off_since_move, settled, dwells, moves = False, False, True, 0, 0
    for command in commands:
        if command.startswith("STRAIGHT_TRAVERSE"):
            target = [float(v) for v in re.findall(r"-?\d+\.\d+", command)[:3]]
            demand(is_off, f"{name}: the output is not switched off before {command}")
            if None not in place:
                changed = [a != b for a, b in zip(place, target)]
                demand(not (changed[2] and (changed[0] or changed[1])), f"{name}: {command} moves z with x or y")
            place, settled, off_since_move, moves = target, False, False, moves + 1
        elif command.startswith("DWELL"):
            demand(float(re.findall(r"\d+\.\d+", command)[0]) >= 0.05, f"{name}: {command} is too short")
            settled, dwells = True, dwells + 1
        elif command.startswith(off):
            is_off = off_since_move = True
        elif command.startswith(start):
            demand(at_start < len(job.manifest["blocks"]), f"{name}: more starts than blocks")
            entry = job.manifest["blocks"][at_start]
            # The interpreter prints four decimals.
            expected = [round(v, 4) for v in entry["stage"]]
            demand(settled, f"{name}: no dwell before the start of {entry['id']}")
            near = all(abs(a - b) < 0.6e-4 for a, b in zip(place, entry["stage"]))
            equal = [f"{v:.4f}" for v in place] == [f"{v:.4f}" for v in expected]
            demand(equal or (near and tie(entry["stage"])), f"{name}: {entry['id']} starts at {place}, not {expected}")
            is_off, at_start = False, at_start + 1
        elif command.startswith(("STRAIGHT_FEED", "ARC_FEED", "SPINDLE", "START_SPINDLE")):
            demand(False, f"{name}: {command} has no place in a stage program")
    demand(at_start == len(job.manifest["blocks"]), f"{name}: {at_start} starts, {len(job.manifest['blocks'])} blocks")
    demand(is_off and off_since_move and moves > 0, f"{name}: the output is not off at the end")
    after = [c for c in commands[commands.index("PROGRAM_END()") + 1 :] if c != "ON_RESET()"]
    demand(not after, f"{name}: {after} after the end")
    # With the handshake BUSY is asked again after another dwell.
    wanted = (2 if name == "stage.ngc" else 1) * at_start
    demand(dwells == wanted, f"{name}: {dwells} dwells for {at_start} blocks")
    return f"{name}: {at_start} blocks, {moves} moves"


def tie(stage):
    """Whether a coordinate lies half way between two numbers of four decimals."""
    return any(round(abs(v) * 1e6) % 100 == 50 for v in stage)


def check_lines(job, path):
    longest = job.manifest["machine"]["controller"]["max_line"]
    for number, line in enumerate(path.read_text(encoding="ascii").splitlines(), 1):
        demand(len(line) <= longest, f"{path.name}:{number}: {len(line)} characters")
        for word in re.findall(r"[XYZ]\S+", line) if not line.startswith("(") else []:
            demand(re.fullmatch(r"[XYZ]-?\d+\.\d{6}", word), f"{path.name}:{number}: {word}")


def check(folder, rs274, tool_table):
    job = Job(folder)
    results = []
    for name, start, off in (HANDSHAKE, STOPS):
        if job.has(name):
            path = job.folder / name
            check_lines(job, path)
            results.append(check_program(job, canonical(rs274, tool_table, path), name, start, off))
    demand(results, "the folder has no stage program")
    return "; ".join(results)


if __name__ == "__main__":
    run(check, "FOLDER RS274 TOOL_TABLE", 3)
