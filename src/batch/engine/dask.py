"""Gives tasks to a Dask scheduler for terrace, and tells what became of them.

Arguments: address of the scheduler, seconds to wait for one that is gone, what a worker needs (JSON). Standard input:
one JSON object a line, a task to submit or a worker to set aside each; its end cancels what has not begun. Standard
output: one JSON object a line, an event each.
"""

import itertools
import json
import logging
import queue
import sys
import threading
import time

# How long a worker may take to answer, and may be silent, s. A worker speaks to its scheduler twice a second.
PROBE_S = 30
SILENT_S = 45
SILENT = f"nothing has been heard of it for {SILENT_S} s"

saying = threading.Lock()


def say(**event):
    with saying:
        print(json.dumps(event), flush=True)


try:
    from distributed import Client, get_worker
except ImportError as error:
    say(event="absent", why=str(error))
    sys.exit(3)


def work(argv, cwd):
    """Runs on a worker: one group of units in a process of its own."""
    import os
    import shutil
    import subprocess

    worker = get_worker()
    here = argv[0] if os.path.exists(argv[0]) else shutil.which("terrace")
    # What a slot of this worker may take, where the batch names no limit.
    share = int((worker.memory_manager.memory_limit or 0) / worker.state.nthreads)
    argv = [here or argv[0]] + [share_of.replace("{memory}", str(share)) for share_of in argv[1:]]
    try:
        ended = subprocess.run(
            argv, cwd=cwd, stdin=subprocess.DEVNULL, capture_output=True, text=True, errors="replace"
        )
    except OSError as error:
        # No program, no folder: what is wrong is the machine.
        return -1, "", str(error), worker.address
    return ended.returncode, ended.stdout, ended.stderr[-4000:], worker.address


def unfit(need):
    """Runs on a worker: why it cannot work on the units; None where it can."""
    import os
    import shutil
    import subprocess
    import tempfile

    if os.name != "posix":
        return "it runs Windows, where the paths of this computer lead nowhere: start the worker in WSL 2"
    import resource

    if shutil.which("sh") is None:
        return "it has no shell sh"
    here = need["program"] if os.path.exists(need["program"]) else shutil.which("terrace")
    if here is None:
        return f"there is neither {need['program']} nor a terrace on its path"
    try:
        asked = subprocess.run([here, "--version"], stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=20)
    except (OSError, subprocess.TimeoutExpired) as error:
        return f"its terrace cannot be run: {error}"
    if asked.stdout.strip() != need["version"]:
        return f"its {here} is {asked.stdout.strip() or 'no terrace'}, this is {need['version']}"
    if not os.path.isdir(need["cwd"]):
        return f"it has no folder {need['cwd']}"
    file = os.path.join(need["cwd"], need["file"])
    try:
        if os.path.getsize(file) != need["bytes"]:
            return f"its {file} is another file: is the folder shared?"
        with open(file, "rb"):
            pass
        with tempfile.TemporaryFile(dir=os.path.dirname(file)):
            pass
    except OSError as error:
        return f"{error}: is the folder shared?"
    limit = resource.getrlimit(resource.RLIMIT_AS)[1]
    if limit != resource.RLIM_INFINITY and limit < need["memory"]:
        return f"its limit of memory (ulimit -v) is {limit >> 20} MB, below the {need['memory'] >> 20} MB of a unit"
    return None


class Fleet:
    def __init__(self, address, patience, need):
        self.address, self.patience, self.need = address, patience, need
        self.inbox = queue.Queue()
        self.pending, self.futures = {}, {}
        # The workers of tasks that not all may have.
        self.confined = {}
        # Why workers are not to have tasks.
        self.aside = {}
        # What each worker last told the scheduler, and when that was heard.
        self.heard = {}
        self.generation, self.tries = 0, itertools.count()
        self.client = None

    def connect(self):
        self.client = Client(self.address, timeout=5, set_as_default=False, direct_to_workers=False)

    def workers(self):
        found = self.client.scheduler_info(n_workers=-1)["workers"]
        return [
            {
                "address": address,
                "name": str(worker.get("name") or worker.get("id") or address),
                "threads": worker["nthreads"],
                "memory": worker["memory_limit"] or 0,
                "declared": worker["resources"].get("memory"),
            }
            for address, worker in sorted(found.items())
        ]

    def probe(self, addresses):
        """Asks workers whether they can work, all at once; says which cannot."""
        answers = {}

        def ask(address):
            try:
                answers[address] = self.client.run(unfit, self.need, workers=[address])[address]
            except Exception as error:
                answers[address] = f"it cannot be asked: {error}"

        # One that does not answer holds its thread, which does not hold this program.
        threads = [threading.Thread(target=ask, args=[address], daemon=True) for address in addresses]
        for thread in threads:
            thread.start()
        until = time.monotonic() + PROBE_S
        for thread in threads:
            thread.join(max(0, until - time.monotonic()))
        for address in addresses:
            why = answers.get(address, f"it does not answer within {PROBE_S} s")
            if why is not None:
                self.set_aside(address, why)

    def set_aside(self, address, why):
        if address not in self.aside:
            self.aside[address] = why
            say(event="aside", worker=address, why=why)

    def look_for_silent(self, found):
        """Sets workers aside that have told the scheduler nothing for long; their tasks go to others."""
        now = time.monotonic()
        for address, worker in found.items():
            last = self.heard.get(address)
            if last is None or last[0] != worker["last_seen"]:
                self.heard[address] = (worker["last_seen"], now)
                if self.aside.get(address) == SILENT:
                    del self.aside[address]
                    say(event="back", worker=address)
            elif now - last[1] > SILENT_S:
                self.set_aside(address, SILENT)
        if not set(found) - set(self.aside):
            return
        for address in set(self.aside) & set(found):
            held = set(self.client.processing([address]).get(address, ()))
            for task in [task for task, future in self.futures.items() if future.key in held and task in self.pending]:
                self.futures.pop(task).cancel()
                self.give(self.pending[task])

    def submit(self, task):
        more = {}
        if task.get("memory"):
            more["resources"] = {"memory": task["memory"]}
        self.confined.pop(task["task"], None)
        barred = set(task["not"]) | set(self.aside)
        if barred:
            others = {worker["address"] for worker in self.workers()} - barred
            if others:
                self.confined[task["task"]] = others
                more["workers"] = sorted(others)
        future = self.client.submit(
            work,
            task["argv"],
            task["cwd"],
            key=f"terrace-{self.client.id}-{task['task']}-{next(self.tries)}",
            pure=False,
            retries=2,
            priority=-task["task"],
            **more,
        )
        self.futures[task["task"]] = future
        generation = self.generation
        future.add_done_callback(lambda done: self.inbox.put(("done", task["task"], done, generation)))

    def lost(self, task, why):
        self.pending.pop(task, None)
        self.futures.pop(task, None)
        say(event="lost", task=task, why=why)

    def done(self, task, future, generation):
        if generation != self.generation or task not in self.pending or self.futures.get(task) is not future:
            return
        if future.status == "finished":
            try:
                # It lies on the worker, which may have died since.
                code, out, err, worker = future.result(timeout=30)
            except Exception:
                return self.again(task)
            self.pending.pop(task)
            # Lets the scheduler forget it.
            self.futures.pop(task)
            say(event="ended", task=task, code=code, out=out, err=err, worker=worker)
        elif future.status == "error":
            error = future.exception()
            self.lost(task, f"{type(error).__name__}: {error}")
        else:
            self.come_back()

    def again(self, task):
        """The result of a task is lost: the task is given again, or all are where the scheduler is gone."""
        try:
            self.workers()
        except Exception:
            return self.come_back()
        self.give(self.pending[task])

    def give(self, task):
        try:
            self.submit(task)
        except Exception:
            # The scheduler is gone, which its other tasks tell; where there is none, this does.
            if not self.futures:
                self.come_back()

    def free(self, there):
        """Gives tasks again whose workers are all gone; they would wait for them."""
        for task in [task for task, workers in self.confined.items() if not workers & there]:
            del self.confined[task]
            if task in self.pending:
                self.futures.pop(task).cancel()
                self.give(self.pending[task])

    def come_back(self):
        """The scheduler is gone: waits for one at the same address, and gives it all that is pending."""
        say(event="scheduler-lost")
        self.generation += 1
        until = time.monotonic() + self.patience
        while time.monotonic() < until:
            try:
                self.close()
                self.connect()
                if self.workers():
                    say(event="scheduler-back")
                    for task in list(self.pending.values()):
                        self.submit(task)
                    return
            except Exception:
                pass
            time.sleep(1)
        for task in list(self.pending):
            self.lost(task, f"the Dask scheduler at {self.address} ended and did not come back with a worker")

    def close(self):
        try:
            if self.client is not None:
                self.client.close(timeout=1)
        except Exception:
            pass

    def read(self):
        for line in sys.stdin:
            self.inbox.put(("task", json.loads(line)))
        self.inbox.put(("end",))

    def run(self):
        known = self.workers()
        self.probe([worker["address"] for worker in known])
        say(event="connected", workers=known, aside=self.aside)
        threading.Thread(target=self.read, daemon=True).start()
        looked = time.monotonic()
        while True:
            try:
                kind, *rest = self.inbox.get(timeout=1)
            except queue.Empty:
                kind, rest = "look", []
            if kind == "task" and "aside" in rest[0]:
                self.set_aside(rest[0]["aside"], rest[0]["why"])
            elif kind == "task":
                self.pending[rest[0]["task"]] = rest[0]
                self.give(rest[0])
            elif kind == "done":
                self.done(*rest)
            elif kind == "end":
                break
            if self.pending and time.monotonic() - looked > 2:
                looked = time.monotonic()
                try:
                    now = self.workers()
                except Exception:
                    continue
                if len(now) != len(known):
                    say(event="workers", count=len(now))
                new = {worker["address"] for worker in now} - {worker["address"] for worker in known}
                known = now
                there = {worker["address"] for worker in now}
                self.free(there - set(self.aside) or there)
                if new:
                    self.probe(sorted(new))
                try:
                    self.look_for_silent(self.client.scheduler_info(n_workers=-1)["workers"])
                except Exception:
                    continue
        self.client.cancel(list(self.futures.values()), force=True)
        self.close()


def main():
    logging.disable(logging.CRITICAL)
    fleet = Fleet(sys.argv[1], float(sys.argv[2]), json.loads(sys.argv[3]))
    try:
        fleet.connect()
    except Exception as error:
        say(event="unreachable", why=f"{type(error).__name__}: {error}")
        sys.exit(1)
    fleet.run()


if __name__ == "__main__":
    main()
