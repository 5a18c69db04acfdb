"""Judges two sets by every method on one budget, and prints the tables of method.md; the numbers stay in method.json.

python3 docs/results/method.py DEMOSIFT FOLDER_OF_RUNS HALF_CHEETAH_NOISY.hdf5

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
METHODS = {
    "from scratch": ["--method", "from-scratch"],
    "Avg Fine-Tune": ["--method", "avg-fine-tune"],
    "MAML": ["--method", "maml"],
    "MAML, second order": ["--method", "maml", "--set", "meta_train.order=second"],
    "MAML + MI": ["--method", "maml-mi"],
}
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
        resume = ["--resume"] if (out / "run.json").exists() else []
        line = [demosift, command, *options, *resume, "--out", str(out), "--json"]
        result = subprocess.run(line, check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
        found = json.loads(result.stdout)
        found["seconds"] = time.monotonic() - began
        said.write_text(json.dumps(found))
    return json.loads(said.read_text())


def taught(demosift, runs, name, task, file, seed, demos):
    """The policy from some demonstrations: `imitate quick` with the seed of the run, once for each choice."""
    demos = sorted(demos)
    out = runs / f"{name}_from_{'_'.join(map(str, demos))}_{seed}"
    ids = ",".join(map(str, demos))
    options = [str(file), "--task", task, "--preset", "quick", "--seed", str(seed), "--demonstration-ids", ids]
    return run(demosift, out, "imitate", *options)["outcome"]


def folder_of(runs, name, method, seed):
    words = "".join(letter if letter.isalnum() else "_" for letter in method.lower())
    return runs / f"{name}_{words}_{seed}"


def means(judged, demos):
    """Gain of each demonstration over all its variants and repeats."""
    gains = [[] for _ in range(demos)]
    for one in judged["scores"]["suitabilities"]:
        after = statistics.mean(statistics.mean(scores) for scores in one["after"])
        gains[one["demo"]].append(after - statistics.mean(one["before"]))
    return [statistics.mean(of) for of in gains]


def learned(folder):
    """Means of what meta-training measured in its last five rounds."""
    rounds = [json.loads(line) for line in (folder / "metrics.jsonl").read_text().splitlines()]
    rounds = [row for row in rounds if row["stage"] == "meta_train"]
    last = rounds[-5:]
    keys = [key for key in ["behavior_spread", "log_q", "encoding_explained"] if last and key in last[0]]
    return {"rounds": len(rounds)} | {key: statistics.mean(row[key] for row in last) for key in keys}


def described(scores, oracle, truth):
    """How well the scores of all demonstrations agree with what they teach."""
    found = {
        "top_2": sorted(top(scores, 2)),
        "spearman_oracle": spearman(scores, oracle),
        "hit_rate_2": hit_rate(scores, oracle, 2),
        "hit_rate_half": hit_rate(scores, oracle, len(oracle) // 2),
    }
    return found | ({"spearman_truth": spearman(scores, truth)} if truth else {})


def mean_and_std(values, digits):
    if not values:
        return "-"
    spread = f" ± {statistics.stdev(values):.{digits}f}" if len(values) > 1 else ""
    return f"{statistics.mean(values):.{digits}f}{spread}"


def row(label, found, digits):
    column = lambda key, digits: mean_and_std([one[key] for one in found if key in one], digits)
    cells = [
        column("spearman_oracle", 2),
        column("spearman_truth", 2),
        column("hit_rate_2", 2),
        column("hit_rate_half", 2),
        column("distance", 2),
        column("score", digits),
        column("seconds", 0),
    ]
    print(f"| {label} | {' | '.join(cells)} |")


def report(name, task, file, runs, demosift, digits):
    oracle = json.loads((ROOT / "data/oracle" / f"{name}.json").read_text())["alone"]
    oracle = [one["mean"] for one in sorted(oracle, key=lambda one: one["demo"])]
    truth = TRUE_RETURNS if task == "half_cheetah" else None
    found = {"methods": {}, "data_only": {}, "oracle": oracle}
    for method in METHODS:
        found["methods"][method] = []
        for seed in SEEDS:
            folder = folder_of(runs, name, method, seed)
            judged = json.loads((runs / f"{folder.name}.judge.json").read_text())
            one = {"seed": seed, "gains": means(judged, len(oracle))} | described(means(judged, len(oracle)), oracle, truth)
            one |= {"distance": judged["adapted_behaviors_distance"], "seconds": judged["seconds"]}
            one |= {"spent": judged["costs"]["spent_of_quota"], "quota": judged["costs"]["quota"]}
            one |= learned(folder) if method.startswith("MAML") else {}
            one["score"] = taught(demosift, runs, name, task, file, seed, one["top_2"])["score"]
            found["methods"][method].append(one)
    for column in judged["data_only"]:
        if len(set(column["scores"] or [])) > 1:
            one = described(column["scores"], oracle, truth)
            scores = [taught(demosift, runs, name, task, file, seed, one["top_2"])["score"] for seed in SEEDS]
            found["data_only"][column["name"]] = [one | {"score": scores[0]}] + [{"score": score} for score in scores[1:]]
    print(f"\n{name}\n")
    print("| | Spearman, oracle | Spearman, true return | hit rate at 2 | at half | ABD | policy from the top 2 | wall time, s |")
    print("|---|---|---|---|---|---|---|---|")
    for label, rows in [*found["methods"].items(), *found["data_only"].items()]:
        row(label, rows, digits)
    print("\n| | rounds | spread of adapted behaviors | log Q | explained |")
    print("|---|---|---|---|---|")
    for method in ["MAML", "MAML, second order", "MAML + MI"]:
        rows = found["methods"][method]
        column = lambda key: mean_and_std([one[key] for one in rows if key in one], 3)
        print(f"| {method} | {rows[0]['rounds']} | {column('behavior_spread')} | {column('log_q')} | {column('encoding_explained')} |")
    return found


def main():
    demosift, runs, cheetah = sys.argv[1], Path(sys.argv[2]), sys.argv[3]
    runs.mkdir(parents=True, exist_ok=True)
    sets = [
        ("free_throw_8", "free_throw", ROOT / "data/free_throw_8/demonstrations.hdf5", 3),
        ("half_cheetah_noisy", "half_cheetah", cheetah, 0),
    ]
    for name, task, file, _ in sets:
        for seed in SEEDS:
            for method in METHODS:
                options = [str(file), "--task", task, *JUDGE, *METHODS[method], "--seed", str(seed)]
                judged = run(demosift, folder_of(runs, name, method, seed), "judge", *options)
                print(name, method, seed, f"{judged['seconds']:.0f} s", file=sys.stderr, flush=True)
    found = {name: report(name, task, file, runs, demosift, digits) for name, task, file, digits in sets}
    (ROOT / "docs/results/method.json").write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
