"""Kills, breaks and crowds runs of demosift, and holds what comes of it against a run that was left alone.

usage: torture.py BINARY [--full] [--only kills,writes,errors,corruption,crowds] [--seed N]

Each trial ends in one of the ways that its table names. Wanted is that after any kill, and after any error of the disk, going
on leads to the same bytes; that a damaged file is told by its name; and that of two runs in one folder one is told so.
It needs Linux, strace, and nothing but the standard library of Python.
"""

import argparse
import hashlib
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time

TINY = """
[inner]
batch_steps = 120
[meta_train]
rounds = 12
checkpoint_every = 2
[judge]
iterations = 2
evaluations = 4
repeats = 2
[cloning_judge.judging]
iterations = 4
averaged = 2
evaluations = 4
repeats = 2
most_repeats = 3
[imitate]
environment_steps = 1800
evaluations = 4
evaluate_every = 2
checkpoint_every = 2
cloning_updates = 6
[imitate.update]
batch_steps = 300
[referee]
cloning = 3
gail = 1
"""
RECORD = (
    "record --task point_mass --count 4 --seed 3 --set demonstrator.snapshot_every=1 --set demonstrator.batch_steps=300 "
    "--set demonstrator.updates=8 --set demonstrator.checkpoint_every=2 --out set"
)
JOB = "sift set --task point_mass --config tiny.toml"
# Each system call that changes what is on the disk.
WRITES = ["write", "fsync", "fdatasync", "rename", "ftruncate", "unlink", "rmdir", "mkdir"]
LONGEST_SECS = 300


class Torture:
    def __init__(self, binary, full, seed):
        self.binary = os.path.abspath(binary)
        self.full = full
        self.random = random.Random(seed)
        self.folder = tempfile.mkdtemp(prefix="demosift-torture-")
        self.counts = {}
        self.bad = []
        with open(os.path.join(self.folder, "tiny.toml"), "w") as file:
            file.write(TINY)
        self.must(RECORD.split())
        start = time.time()
        self.said = self.must(JOB.split() + ["--out", "run_whole"]).stdout.replace(b"run_whole", b"RUN")
        self.secs = time.time() - start
        self.whole = self.tree("run_whole")
        print(f"the job takes {self.secs:.1f} s and leaves {len(self.whole)} files", flush=True)

    def start(self, arguments, before=(), threads=1):
        command = [*before, self.binary, *arguments, "--threads", str(threads)]
        pipe = subprocess.PIPE
        return subprocess.Popen(command, cwd=self.folder, stdin=subprocess.DEVNULL, stdout=pipe, stderr=pipe)

    def run(self, arguments, before=(), threads=1):
        child = self.start(arguments, before, threads)
        try:
            out, err = child.communicate(timeout=LONGEST_SECS)
        except subprocess.TimeoutExpired:
            child.kill()
            out, err = child.communicate()
            return subprocess.CompletedProcess(arguments, None, out, err)
        return subprocess.CompletedProcess(arguments, child.returncode, out, err)

    def must(self, arguments):
        done = self.run(arguments)
        if done.returncode != 0:
            sys.exit(f"{' '.join(arguments)} failed: {done.stderr.decode(errors='replace')}")
        return done

    def path(self, *names):
        return os.path.join(self.folder, *names)

    def tree(self, folder):
        found = {}
        for root, folders, files in os.walk(self.path(folder)):
            for name in files + [name for name in folders if name == ".lock"]:
                path = os.path.join(root, name)
                whole = b"folder" if os.path.isdir(path) else open(path, "rb").read()
                found[os.path.relpath(path, self.path(folder))] = hashlib.sha256(whole).hexdigest()
        return found

    def fresh(self, folder, like=None):
        shutil.rmtree(self.path(folder), ignore_errors=True)
        if like:
            shutil.copytree(self.path(like), self.path(folder), symlinks=True)

    def count(self, test, outcome, is_bad=False, what=""):
        self.counts.setdefault(test, {}).setdefault(outcome, 0)
        self.counts[test][outcome] += 1
        if is_bad:
            self.bad.append(f"{test}: {outcome}: {what}")
            print("BAD", self.bad[-1], flush=True)

    def differing(self, folder):
        now = self.tree(folder)
        return sorted(name for name in {*now, *self.whole} if now.get(name) != self.whole.get(name))

    def goes_on(self, test, folder, what, threads=1):
        """Going on must lead to the same bytes and the same words."""
        done = self.run(JOB.split() + ["--out", folder, "--resume"], threads=threads)
        if done.returncode != 0:
            self.count(test, "cannot go on", True, f"{what}: {done.returncode} {done.stderr[:300]!r}")
            return
        differing = self.differing(folder)
        if differing or done.stdout.replace(folder.encode(), b"RUN") != self.said:
            self.count(test, "another result", True, f"{what}: {differing}")
            return
        self.count(test, "the same bytes")

    # Kills at random times, with one thread or two, until so many are done.
    def kills(self):
        for kind, wanted in [("SIGKILL", 500 if self.full else 12), ("Ctrl-C", 200 if self.full else 6)]:
            test, done = f"{kind} at random times", 0
            while done < wanted:
                self.fresh("run_killed")
                of_this_run = 0
                while of_this_run < 30 and done < wanted:
                    threads = self.random.choice([1, 2])
                    child = self.start(JOB.split() + ["--out", "run_killed", "--resume"], threads=threads)
                    try:
                        child.communicate(timeout=0.02 + self.secs * self.random.random() * 0.4)
                        break
                    except subprocess.TimeoutExpired:
                        pass
                    if kind == "SIGKILL":
                        child.kill()
                    else:
                        child.send_signal(self.random.choice([signal.SIGINT, signal.SIGTERM]))
                        if self.random.random() < 0.5:
                            time.sleep(self.random.choice([0, 0.0005, 0.005]))
                            child.send_signal(signal.SIGINT)
                    child.communicate()
                    done, of_this_run = done + 1, of_this_run + 1
                    self.count(test, "killed")
                    if kind != "SIGKILL" and child.returncode not in (130, 143):
                        self.count(test, f"code {child.returncode}", True)
                self.goes_on(test, "run_killed", f"after {of_this_run} kills", self.random.choice([1, 2]))

    def injected(self, call, fault, number):
        trace = self.path("trace")
        before = ["strace", "-f", "-o", trace, "-e", f"trace={call}", "-e", f"inject={call}:{fault}:when={number}"]
        self.fresh("run_injected")
        done = self.run(JOB.split() + ["--out", "run_injected"], before)
        with open(trace, errors="replace") as file:
            text = file.read()
        return done if "INJECTED" in text or "killed by SIGKILL" in text else None

    def points(self, call):
        """How often the job makes a call, and which of those are tried."""
        trace = self.path("trace")
        self.fresh("run_injected")
        self.run(JOB.split() + ["--out", "run_injected"], ["strace", "-f", "-o", trace, "-e", f"trace={call}"])
        with open(trace, errors="replace") as file:
            total = sum(1 for line in file if f" {call}(" in line or f"{call}(" in line.split(" ", 1)[-1])
        points = range(1, total + 1)
        few = 120 if self.full else 3
        return points if total <= few else sorted(self.random.sample(points, few))

    # A kill at each call that changes the disk.
    def writes(self):
        for call in WRITES:
            test = f"SIGKILL at {call}"
            for number in self.points(call):
                if self.injected(call, "signal=KILL", number) is None:
                    break
                self.goes_on(test, "run_injected", f"call {number}")

    # An error of the disk at each call that changes it.
    def errors(self):
        for error in ["ENOSPC", "EIO"]:
            for call in ["rename", "fsync", "write", "fdatasync", "ftruncate", "mkdir"]:
                test = f"{error} at {call}"
                for number in self.points(call):
                    done = self.injected(call, f"error={error}", number)
                    if done is None:
                        break
                    said = done.stderr.decode(errors="replace")
                    if done.returncode == 101 or "panicked" in said or done.returncode is None:
                        self.count(test, "a panic or a hang", True, f"call {number}: {said[:300]}")
                        continue
                    # The trace may be of a write to a pipe, which the job does not depend on.
                    self.count(test, "told" if done.returncode else "not noticed")
                    self.goes_on(test, "run_injected", f"call {number}: {done.returncode} {said[:200]!r}")

    def damaged(self, bytes_, name):
        damaged = bytearray(bytes_)
        kind = self.random.random()
        if kind < 0.1:
            cut = self.random.randrange(len(damaged))
            return bytes(damaged[:cut]), f"cut to {cut}"
        if kind < 0.3 and name.endswith((".json", ".toml", ".jsonl")):
            numbers = list(re.finditer(rb"-?\d+(\.\d+)?", bytes_))
            if numbers:
                found = self.random.choice(numbers)
                other = self.random.choice([b"99", b"-1", b"18446744073709551615", b"1e308", b"0", b"null", b'"x"', b"[]"])
                return bytes_[: found.start()] + other + bytes_[found.end() :], f"{found.group()} to {other}"
        bit = self.random.randrange(8 * len(damaged))
        damaged[bit // 8] ^= 1 << bit % 8
        return bytes(damaged), f"bit {bit}"

    # Flipped bits, cuts and other numbers, in the files of a finished and of an unfinished run.
    def corruption(self):
        snapshots = ["run_whole"]
        for checkpoint in ["checkpoint_judge_cloning.bin", "checkpoint_meta_train.bin", "checkpoint_judge_paper.bin"]:
            for _ in range(40):
                self.fresh("begun")
                child = self.start(JOB.split() + ["--out", "begun"])
                while child.poll() is None and not os.path.exists(self.path("begun", checkpoint)):
                    pass
                child.kill()
                child.communicate()
                if os.path.exists(self.path("begun", checkpoint)):
                    shutil.copytree(self.path("begun"), self.path(f"at_{checkpoint}"))
                    snapshots.append(f"at_{checkpoint}")
                    break
        wanted, done = (1000 if self.full else 30), 0
        while done < wanted:
            like = self.random.choice(snapshots)
            names = [name for name in self.tree(like) if ".lock" not in name and not name.endswith(".partial")]
            checkpoints = [name for name in names if name.startswith("checkpoint")]
            name = self.random.choice(checkpoints if checkpoints and self.random.random() < 0.5 else names)
            with open(self.path(like, name), "rb") as file:
                was = file.read()
            if not was:
                continue
            damaged, what = self.damaged(was, name)
            if damaged == was:
                continue
            done += 1
            self.fresh("run_damaged", like)
            with open(self.path("run_damaged", name), "wb") as file:
                file.write(damaged)
            after = self.run(JOB.split() + ["--out", "run_damaged", "--resume"])
            said = after.stderr.decode(errors="replace")
            test = "damaged, unfinished run" if like != "run_whole" else "damaged, finished run"
            what = f"{like}/{name}, {what}: {said[:300]}"
            if after.returncode is None or after.returncode == 101 or after.returncode < 0:
                self.count(test, "a panic, a signal or a hang", True, what)
            elif after.returncode:
                names_it = os.path.basename(name) in said
                self.count(test, "told with the file" if names_it else "told without the file", not names_it, what)
            elif after.stdout.replace(b"run_damaged", b"RUN") != self.said:
                self.count(test, "used", True, what)
            else:
                differing = self.differing("run_damaged")
                outcome = "made again" if not differing else "lies there unused"
                # What no step reads again is told by whoever reads it: the prior, and policies by `play` and `export`.
                self.count(test, outcome, bool(differing) and differing != [name], f"{what} {differing}")

    # Two runs in one folder, at once or one after the other has begun.
    def crowds(self):
        for number in range(40 if self.full else 6):
            test = "two at once"
            self.fresh("run_crowd")
            first = self.start(JOB.split() + ["--out", "run_crowd"])
            if number % 2:
                time.sleep(self.secs * self.random.random() * 0.5)
            resume = ["--resume"] if number % 2 else []
            second = self.start(JOB.split() + ["--out", "run_crowd", *resume])
            told = [child.communicate()[1].decode(errors="replace") for child in (first, second)]
            codes = [first.returncode, second.returncode]
            busy = [said for said, code in zip(told, codes) if code]
            words = ("another command writes into this folder", "holds a run already")
            is_told = all(code in (0, 2) for code in codes) and all(any(word in said for word in words) for said in busy)
            if codes[0] and codes[1] or not is_told:
                self.count(test, "neither is done, or no clear word", True, f"{codes} {told}")
                continue
            self.count(test, "one is told" if busy else "one after the other")
            self.goes_on(test, "run_crowd", f"{codes} {told}")

    def table(self):
        lines = ["| test | outcome | times |", "|---|---|---|"]
        for test, outcomes in self.counts.items():
            lines += [f"| {test} | {outcome} | {times} |" for outcome, times in sorted(outcomes.items())]
        return "\n".join([*lines, "", f"{len(self.bad)} of these are failures."])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("binary")
    parser.add_argument("--full", action="store_true", help="500 kills, every write, 1000 corruptions: hours")
    parser.add_argument("--only", default="kills,writes,errors,corruption,crowds")
    parser.add_argument("--seed", type=int, default=1)
    typed = parser.parse_args()
    # Whoever stops it sees what it found until then.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    torture = Torture(typed.binary, typed.full, typed.seed)
    try:
        for test in typed.only.split(","):
            if test in ("writes", "errors") and not shutil.which("strace"):
                print(f"skipped {test}: there is no strace", flush=True)
                continue
            start = time.time()
            getattr(torture, test)()
            print(f"{test}: {time.time() - start:.0f} s", flush=True)
    finally:
        print(torture.table(), flush=True)
        shutil.rmtree(torture.folder, ignore_errors=True)
    sys.exit(1 if torture.bad else 0)


if __name__ == "__main__":
    main()
