"""Judges two sets by every method on one budget, and prints the tables of method.md; the numbers stay in method.json.

python3 docs/results/method.py DEMOSIFT FOLDER_OF_RUNS HALF_CHEETAH_NOISY.hdf5 [--only-tables]

What a run folder already holds is not made again. The oracle's tables stand in data/oracle and are made by
`demosift oracle SET --task TASK --preset standard --seed 70 --repeats 3 --json`.
"""

import json
import statistics
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
METHODS = ["from-scratch", "avg-fine-tune", "maml", "maml-mi"]
SEEDS = [0, 1, 2]
# Few inner updates: where meta-training can show. Everything else is the preset's.
JUDGE = ["--preset", "standard", "--set", "judge.iterations=10", "--set", "judge.averaged=5"]
# Of the public set's own README; never seen by what judges.
TRUE_RETURNS = [1090, 1853, 268, -178, 4312, -399, 4020, 3979, 568, -46]


def ranks(values):
    return [sum(w < v for w in values) + (sum(w == v for w in values) + 1) / 2 for v in values]


def spearman(left, right):
    return statistics.correlation(ranks(left), ranks(right))


def top(values, k):
    return sorted(range(len(values)), key=lambda demo: (-values[demo], demo))[:k]


def hit_rate(found, truth, k):
    return len(set(top(found, k)) & set(top(truth, k))) / k


def run(demosift, out, command, *options):
    """Runs or resumes a command; what it says as JSON."""
    said = out.parent / f"{out.name}.{command}.json"
    if not said.exists():
        began = time.monotonic()
        fresh = [] if (out / "run.json").exists() else options
        resume = ["--resume"] if (out / "run.json").exists() else []
        line = [demosift, command, *fresh, *resume, "--out", str(out), "--json"]
        result = subprocess.run(line, check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
        found = json.loads(result.stdout)
        found["seconds"] = time.monotonic() - began
        said.write_text(json.dumps(found))
    return json.loads(said.read_text())


def taught(demosift, runs, name, task, file, seed, demos):
    """The policy from some demonstrations: `imitate` with the seed of the run, once for each choice."""
    demos = sorted(demos)
    out = runs / f"{name}_from_{'_'.join(map(str, demos))}_{seed}"
    ids = ",".join(map(str, demos))
    options = [str(file), "--task", task, "--preset", "standard", "--seed", str(seed), "--demonstration-ids", ids]
    return run(demosift, out, "imitate", *options)["outcome"]


def means(judged, demos):
    """Gain of each demonstration over all its variants and repeats."""
    gains = [[] for _ in range(demos)]
    for one in judged["scores"]["suitabilities"]:
        after = statistics.mean(statistics.mean(scores) for scores in one["after"])
        gains[one["demo"]].append(after - statistics.mean(one["before"]))
    return [statistics.mean(of) for of in gains]


def data_only(judged, demos):
    """Columns beside ours, by name; those that have nothing to say of a set are left out."""
    columns = {}
    for column in judged["data_only"]:
        scores = {row["demo"]: row["score"] for row in column["scores"]} if column.get("scores") else None
        if scores and len(scores) == demos and all(score is not None for score in scores.values()):
            columns[column["name"]] = [scores[demo] for demo in range(demos)]
    return columns


def main():
    demosift, runs, cheetah = sys.argv[1], Path(sys.argv[2]), sys.argv[3]
    runs.mkdir(parents=True, exist_ok=True)
    sets = [
        ("free_throw_8", "free_throw", ROOT / "data/free_throw_8/demonstrations.hdf5"),
        ("half_cheetah", "half_cheetah", cheetah),
    ]
    for name, task, file in sets:
        for seed in SEEDS:
            for method in METHODS:
                options = [str(file), "--task", task, *JUDGE, "--method", method, "--seed", str(seed)]
                judged = run(demosift, runs / f"{name}_{method}_{seed}", "judge", *options)
                print(name, method, seed, f"{judged['seconds']:.0f} s", file=sys.stderr, flush=True)


main()
