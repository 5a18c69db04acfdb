"""Sifts the sets of the repository with preset quick, and keeps what sports.md shows in sports.json.

python3 docs/results/sports.py DEMOSIFT RUNS    sifts with this binary; run folders that are finished are kept
python3 docs/results/sports.py                  prints the tables from sports.json
"""

import json
import statistics
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
KEPT = Path(__file__).with_suffix(".json")
# martial_arts_100 is there to be meta-trained on (C.3); to judge each of a hundred takes long even in quick.
SETS = {
    "free_throw_8": "free_throw",
    "free_throw_20": "free_throw",
    "penalty_save_12": "penalty_save",
    "handstand_15": "handstand",
    "martial_arts_10": "martial_arts",
    "martial_arts_unseen": "martial_arts",
}
SEED = 0


def sift(binary, runs):
    runs.mkdir(parents=True, exist_ok=True)
    for name, task in SETS.items():
        out = runs / name
        if (out / "seconds.txt").exists():
            continue
        begun = time.monotonic()
        arguments = ["sift", f"data/{name}", "--task", task, "--preset", "quick", "--seed", str(SEED), "--out", out]
        with (runs / f"{name}.log").open("w") as log:
            subprocess.run([binary, *arguments], check=True, cwd=ROOT, stdout=log)
        (out / "seconds.txt").write_text(f"{time.monotonic() - begun:.0f}\n")


def ranks(values):
    return [sum(w < v for w in values) + (sum(w == v for w in values) + 1) / 2 for v in values]


def spearman(left, right):
    return statistics.correlation(ranks(left), ranks(right))


def under_variants(suitabilities, origins):
    """For a task of several goals: each goal's most suitable demonstration, and the goal that this one was recorded under."""
    variants = sorted({one["variant"] for one in suitabilities})
    if len(variants) == 1:
        return []
    mean = lambda one: statistics.mean(value for repeat in one["after"] for value in repeat)
    best = [max((one for one in suitabilities if one["variant"] == variant), key=mean)["demo"] for variant in variants]
    return [[variant, demo, origins[demo]["variant"]] for variant, demo in zip(variants, best)]


def summary(runs):
    found = {}
    for name in SETS:
        out = runs / name
        if not (out / "seconds.txt").exists():
            continue
        origins = json.loads((ROOT / f"data/provenance/{name}.json").read_text())["demonstrations"]
        entries = json.loads((out / "ranking.json").read_text())["entries"]
        gain = {entry["demo"]: entry["score"] for entry in entries}
        gains = [gain[demo] for demo in range(len(origins))]
        curves = {part: json.loads((out / f"learning_curve_{part}.json").read_text()) for part in ["subset", "all"]}
        found[name] = {
            "seconds": int((out / "seconds.txt").read_text()),
            "order": [entry["demo"] for entry in entries],
            "gain": [round(value, 4) for value in gains],
            "task": [origin["task"] for origin in origins],
            "succeeded": [origin["succeeded"] for origin in origins],
            "spearman_own": spearman(gains, [origin["score"] for origin in origins]),
            "spearman_stage": spearman(gains, [origin["stage_score"] for origin in origins]),
            "under_variants": under_variants(json.loads((out / "scores.json").read_text())["suitabilities"], origins),
            "kept": curves["subset"]["demos"],
            "policies": {part: [curve["outcome"]["score"], curve["outcome"]["success"]] for part, curve in curves.items()},
        }
    return found


def table(found):
    print("| set | Spearman, the demonstration's own heuristic | Spearman, its stage's | kept | policy from the kept | policy from all | time |")
    print("|---|---|---|---|---|---|---|")
    for name, run in found.items():
        policies = [f"{score:.2f} ({100 * success:.0f} %)" for score, success in (run["policies"][part] for part in ["subset", "all"])]
        kept = len(run["kept"])
        print(
            f"| `{name}` | {run['spearman_own']:.2f} | {run['spearman_stage']:.2f} | {kept} of {len(run['order'])} "
            f"| {policies[0]} | {policies[1]} | {run['seconds']} s |"
        )
    for name, run in found.items():
        for variant, demo, recorded in run["under_variants"]:
            print(f"\n`{name}`, variant {variant}: most suitable is demonstration {demo}, recorded under variant {recorded}.")
    run = found["free_throw_20"]
    guests = [place + 1 for place, demo in enumerate(run["order"]) if run["task"][demo] == "free_throw_taller"]
    print(f"\nPlaces of the taller thrower's demonstrations among twenty: {', '.join(map(str, guests))}.")


if __name__ == "__main__":
    if len(sys.argv) == 3:
        sift(Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve())
        KEPT.write_text(json.dumps(summary(Path(sys.argv[2]).resolve())) + "\n")
    table(json.loads(KEPT.read_text()))
