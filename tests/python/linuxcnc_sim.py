"""The whole controller of LinuxCNC in simulation, with a scan card made of HAL components.

    linuxcnc_sim.py ROOT FOLDER PORT

ROOT is the unpacked package (setup.sh), FOLDER an empty folder for its files, PORT that of linuxcncrsh. Needs no
display, no realtime kernel and no installation; LinuxCNC refuses to run as root, so as root it runs as nobody.

Prints `ready` when linuxcncrsh answers. Then takes lines on standard input: `card DELAY WIDTH [KIND]` sets, in s, how
long after START the laser is on and for how long it stays, and what BUSY is then: high with it, `inverted`, or
`bouncing` (low once more for 5 ms, 5 ms after it has risen). `pins` asks for START and the laser; the answer to both is
those two. `trips FILE` says where a touch probe trips: rows of x, y and z of the axes, mm; it trips where the axes stand
over one of them and z is not above it. Samples of every ms go to FOLDER/samples.txt: number, x, y, z (commanded, mm), START, laser. Ends with its
standard input.
"""

import os
import signal
import socket
import subprocess
import sys
import threading
import time

ROOT, FOLDER, PORT = sys.argv[1], sys.argv[2], sys.argv[3]
USR = f"{ROOT}/usr"
# Keys of the shared memory of NML, HAL, motion and sampler: one controller at a time on a computer.
KEYS = [0x3E9, 0x3EA, 0x3EB, 0x3EC, 0x3ED, 0x48484C34, 0x48414C32, 0x64, 0x48534130]

INI = """[EMC]
MACHINE = terrace-test
VERSION = 1.1
DEBUG = 0
NML_FILE = {folder}/linuxcnc.nml
[TASK]
TASK = milltask
CYCLE_TIME = 0.001
[RS274NGC]
PARAMETER_FILE = {folder}/sim.var
[DISPLAY]
DISPLAY = linuxcncrsh
[EMCMOT]
EMCMOT = motmod
COMM_TIMEOUT = 1.0
SERVO_PERIOD = 1000000
[EMCIO]
EMCIO = io
CYCLE_TIME = 0.1
TOOL_TABLE = {folder}/tool.tbl
[TRAJ]
COORDINATES = XYZ
LINEAR_UNITS = mm
ANGULAR_UNITS = degree
DEFAULT_LINEAR_VELOCITY = 100
MAX_LINEAR_VELOCITY = 500
DEFAULT_LINEAR_ACCELERATION = 2000
MAX_LINEAR_ACCELERATION = 5000
[KINS]
JOINTS = 3
KINEMATICS = trivkins coordinates=XYZ
"""
AXIS = """[{section}]
TYPE = LINEAR
MIN_LIMIT = -1000
MAX_LIMIT = 1000
MAX_VELOCITY = 300
MAX_ACCELERATION = 3000
FERROR = 1
MIN_FERROR = 1
HOME = 0
HOME_OFFSET = 0
HOME_SEARCH_VEL = 0
HOME_LATCH_VEL = 0
HOME_SEQUENCE = 0
"""
HAL = """addf comp.0 servo-thread
addf near.0 servo-thread
addf near.1 servo-thread
addf lut5.1 servo-thread
addf motion-command-handler servo-thread
addf motion-controller servo-thread
addf timedelay.0 servo-thread
addf oneshot.0 servo-thread
addf timedelay.1 servo-thread
addf oneshot.1 servo-thread
addf lut5.0 servo-thread
addf sampler.0 servo-thread
net x joint.0.motor-pos-cmd => joint.0.motor-pos-fb sampler.0.pin.0
net y joint.1.motor-pos-cmd => joint.1.motor-pos-fb sampler.0.pin.1
net z joint.2.motor-pos-cmd => joint.2.motor-pos-fb sampler.0.pin.2 comp.0.in0
net x => near.0.in1
net y => near.1.in1
net below comp.0.out => lut5.1.in-0
net over-x near.0.out => lut5.1.in-1
net over-y near.1.out => lut5.1.in-2
net touches lut5.1.out => motion.probe-input
setp lut5.1.function 0x80
setp near.0.difference 0.02
setp near.1.difference 0.02
setp comp.0.in1 -1e9
net estop iocontrol.0.user-enable-out => iocontrol.0.emc-enable-in
net prepare iocontrol.0.tool-prepare => iocontrol.0.tool-prepared
net change iocontrol.0.tool-change => iocontrol.0.tool-changed
net start motion.digital-out-00 => timedelay.0.in sampler.0.pin.3
net begun timedelay.0.out => oneshot.0.in
net busy oneshot.0.out => timedelay.1.in lut5.0.in-0 sampler.0.pin.4
net opens timedelay.1.out => oneshot.1.in
net open oneshot.1.out => lut5.0.in-1
net input lut5.0.out => motion.digital-in-00
setp timedelay.0.on-delay 0.02
setp timedelay.0.off-delay 0
setp oneshot.0.width 0.05
setp timedelay.1.on-delay 1000
setp timedelay.1.off-delay 0
setp oneshot.1.width 0.005
setp lut5.0.function 0xD2
setp lut5.0.in-2 FALSE
"""

children = []


def command(words):
    return (["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"] if os.getuid() == 0 else []) + words


def environment():
    libraries = f"{USR}/lib:{USR}/lib/x86_64-linux-gnu"
    own = {"LD_LIBRARY_PATH": libraries, "HOME": FOLDER, "RTAPI_FIFO_PATH": f"{FOLDER}/fifo", "EMC2_HOME": USR}
    return {**os.environ, **own, "INI_FILE_NAME": f"{FOLDER}/sim.ini", "PATH": f"{USR}/bin:{os.environ['PATH']}"}


def start(*words, cwd=USR):
    """Starts a program that stays; its output goes to a file of its name."""
    out = open(f"{FOLDER}/{words[0]}.log", "ab")
    child = subprocess.Popen(command(list(words)), cwd=cwd, env=environment(), stdin=subprocess.DEVNULL, stdout=out,
                             stderr=out, start_new_session=True)
    children.append(child)
    return child


def call(*words):
    done = subprocess.run(command(list(words)), cwd=USR, env=environment(), stdin=subprocess.DEVNULL,
                          capture_output=True, text=True, timeout=60)
    if done.returncode != 0:
        sys.exit(f"{' '.join(words)}: {done.stdout}{done.stderr}")
    return done.stdout


def wait_for(what, is_there):
    end = time.monotonic() + 60
    while not is_there():
        if time.monotonic() > end:
            sys.exit(f"{what} is not there after 60 s: see {FOLDER}")
        time.sleep(0.02)


def answers():
    try:
        socket.create_connection(("localhost", int(PORT)), 1).close()
        return True
    except OSError:
        return False


def write(name, text):
    with open(f"{FOLDER}/{name}", "w") as file:
        file.write(text)


def free_memory():
    """Removes what a controller that was killed has left; refuses beside one that runs."""
    for line in open("/proc/sysvipc/shm").read().splitlines()[1:]:
        words = line.split()
        if int(words[0]) & 0xFFFFFFFF in KEYS:
            if int(words[6]) > 0:
                sys.exit("another LinuxCNC runs on this computer")
            subprocess.run(["ipcrm", "-m", words[1]], check=False, stderr=subprocess.DEVNULL)


def up():
    free_memory()
    axes = "".join(AXIS.format(section=s) for n, a in enumerate("XYZ") for s in (f"AXIS_{a}", f"JOINT_{n}"))
    write("sim.ini", INI.format(folder=FOLDER) + axes)
    write("sim.hal", HAL)
    write("tool.tbl", "T1 P1 D0 Z+0\n")
    write("linuxcnc.nml", open(f"{USR}/share/linuxcnc/linuxcnc.nml").read())
    if os.getuid() == 0:
        for path, _, names in os.walk(FOLDER):
            for name in [path] + [f"{path}/{n}" for n in names]:
                os.chown(name, 65534, 65534)
    start("linuxcncsvr", "-ini", f"{FOLDER}/sim.ini")
    # The first one stays and loads what the others ask for.
    start("rtapi_app", "load", "tpmod")
    wait_for("rtapi_app", lambda: os.path.exists(f"{FOLDER}/fifo"))
    time.sleep(0.3)
    start("io", "-ini", f"{FOLDER}/sim.ini")
    for module in (["homemod"], ["trivkins", "coordinates=XYZ"],
                   ["motmod", "servo_period_nsec=1000000", "num_joints=3", "num_dio=1"],
                   ["timedelay", "count=2"], ["comp", "count=1"], ["oneshot", "count=2"], ["lut5", "count=2"], ["near", "count=2"], ["sampler", "depth=8000", "cfg=fffbb"]):
        call("rtapi_app", "load", *module)
    wait_for("io", lambda: "iocontrol.0.user-enable-out" in call("halcmd", "-s", "show", "pin", "iocontrol.0"))
    call("halcmd", "-f", f"{FOLDER}/sim.hal")
    call("halcmd", "start")
    start("halsampler", "-t", f"{FOLDER}/samples.txt")
    # Logs of probes are written where it was started.
    start("milltask", "-ini", f"{FOLDER}/sim.ini", cwd=FOLDER)
    time.sleep(0.5)
    start("linuxcncrsh", "--port", PORT, "--name", "terrace-test", "--", "-ini", f"{FOLDER}/sim.ini")
    wait_for("linuxcncrsh", answers)


def down():
    for child in reversed(children):
        child.terminate()
    # The server goes on as a child of what was started; its arguments name this folder.
    for pid in filter(str.isdigit, os.listdir("/proc")):
        try:
            if f"{FOLDER}/sim.ini" in open(f"/proc/{pid}/cmdline").read().split("\0"):
                os.kill(int(pid), signal.SIGTERM)
        except OSError:
            pass
    time.sleep(0.5)
    for child in children:
        child.kill()
    for child in children:
        child.wait()
    free_memory()


def follow(trips):
    """Sets where the probe trips while the axes go from place to place: they come down slowly."""
    last = None
    while True:
        at = [float(call("halcmd", "-s", "gets", axis)) for axis in "xy"]
        found = max((z for x, y, z in trips if abs(x - at[0]) < 0.02 and abs(y - at[1]) < 0.02), default=-1e9)
        if found != last and found > -1e9:
            # Nothing trips until the probe is known to stand over this place.
            call("halcmd", "setp", "comp.0.in1", "-1e9")
            for k in range(2):
                call("halcmd", "setp", f"near.{k}.in2", f"{at[k]:.7f}")
            call("halcmd", "setp", "comp.0.in1", f"{found:.7f}")
            last = found
        time.sleep(0.02)


signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
try:
    up()
    print("ready", flush=True)
    for line in sys.stdin:
        words = line.split()
        if words[0] == "trips":
            rows = [[float(v) for v in row.split()] for row in open(words[1])]
            threading.Thread(target=follow, args=(rows,), daemon=True).start()
        if words[0] == "card":
            call("halcmd", "setp", "timedelay.0.on-delay", words[1])
            call("halcmd", "setp", "oneshot.0.width", words[2])
            kind = words[3] if len(words) > 3 else ""
            # BUSY is the laser without the bounce, or the other way round: (in-0 and not in-1) xor in-2.
            call("halcmd", "setp", "lut5.0.in-2", "TRUE" if kind == "inverted" else "FALSE")
            call("halcmd", "setp", "timedelay.1.on-delay", "0.005" if kind == "bouncing" else "1000")
        pins = [call("halcmd", "-s", "gets", signal_name).strip() for signal_name in ("start", "busy")]
        print(*pins, flush=True)
finally:
    down()
