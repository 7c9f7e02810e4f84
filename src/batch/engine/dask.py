"""Gives tasks to a Dask scheduler for terrace, and tells what became of them.

Arguments: address of the scheduler, seconds to wait for one that is gone. Standard input: one JSON object a line, a
task to submit each; its end cancels what has not begun. Standard output: one JSON object a line, an event each.
"""

import itertools
import json
import logging
import queue
import sys
import threading
import time

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
    if here is None:
        raise RuntimeError(f"there is neither {argv[0]} nor a terrace on the path of {worker.address}")
    # What a slot of this worker may take, where the batch names no limit.
    share = int((worker.memory_manager.memory_limit or 0) / worker.state.nthreads)
    argv = [here] + [share_of.replace("{memory}", str(share)) for share_of in argv[1:]]
    ended = subprocess.run(argv, cwd=cwd, stdin=subprocess.DEVNULL, capture_output=True, text=True, errors="replace")
    return ended.returncode, ended.stdout, ended.stderr[-4000:], worker.address


class Fleet:
    def __init__(self, address, patience):
        self.address, self.patience = address, patience
        self.inbox = queue.Queue()
        self.pending, self.futures = {}, {}
        # The workers of tasks that not all may have.
        self.confined = {}
        self.generation, self.tries = 0, itertools.count()
        self.client = None

    def connect(self):
        self.client = Client(self.address, timeout=5, set_as_default=False, direct_to_workers=False)

    def workers(self):
        found = self.client.scheduler_info(n_workers=-1)["workers"]
        return [
            {
                "address": address,
                "threads": worker["nthreads"],
                "memory": worker["memory_limit"] or 0,
                "declared": worker["resources"].get("memory"),
            }
            for address, worker in sorted(found.items())
        ]

    def submit(self, task):
        more = {}
        if task.get("memory"):
            more["resources"] = {"memory": task["memory"]}
        self.confined.pop(task["task"], None)
        if task.get("not"):
            others = {worker["address"] for worker in self.workers()} - set(task["not"])
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
        say(event="connected", workers=known)
        threading.Thread(target=self.read, daemon=True).start()
        looked = time.monotonic()
        while True:
            try:
                kind, *rest = self.inbox.get(timeout=1)
            except queue.Empty:
                kind, rest = "look", []
            if kind == "task":
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
                known = now
                self.free({worker["address"] for worker in now})
        self.client.cancel(list(self.futures.values()), force=True)
        self.close()


def main():
    logging.disable(logging.CRITICAL)
    fleet = Fleet(sys.argv[1], float(sys.argv[2]))
    try:
        fleet.connect()
    except Exception as error:
        say(event="unreachable", why=f"{type(error).__name__}: {error}")
        sys.exit(1)
    fleet.run()


if __name__ == "__main__":
    main()
