"""Prints the tables of spine.md from the run folders of the commands that stand there, and keeps the numbers in spine.json.

python3 docs/results/spine.py FOLDER_OF_RUNS
"""

import json
import statistics
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
# Of the public set's own README; never seen by what judges.
TRUE_RETURNS = [1090, 1853, 268, -178, 4312, -399, 4020, 3979, 568, -46]
SEEDS = [0, 1, 2]


def ranks(values):
    return [sum(w < v for w in values) + (sum(w == v for w in values) + 1) / 2 for v in values]


def spearman(left, right):
    return statistics.correlation(ranks(left), ranks(right))


def stage_scores():
    provenance = json.loads((ROOT / "data/provenance/free_throw_8.json").read_text())
    return [origin["stage_score"] for origin in provenance["demonstrations"]]


def oracle(folder, count):
    outcomes = []
    for demo in range(count):
        curves = [json.loads(path.read_text()) for path in sorted(folder.glob(f"learning_curve_oracle_{demo}_*.json"))]
        outcomes.append(statistics.mean(curve["end"]["score"] for curve in curves))
    return outcomes


def mean_and_std(values, digits):
    return f"{statistics.mean(values):.{digits}f} ± {statistics.stdev(values):.{digits}f}"


def report(runs, name, task, truth_name, truth, digits):
    taught = oracle(runs / f"{name}_oracle", len(truth))
    found = {"truth": truth, "oracle": taught, "runs": []}
    gains = []
    for seed in SEEDS:
        folder = runs / f"{name}_{seed}"
        entries = json.loads((folder / "ranking.json").read_text())["entries"]
        curves = {part: json.loads((folder / f"learning_curve_{part}.json").read_text()) for part in ["subset", "all"]}
        by_demo = [entry["score"] for entry in sorted(entries, key=lambda entry: entry["demo"])]
        gains.append(by_demo)
        found["runs"].append(
            {
                "seed": seed,
                "before": entries[0]["before"],
                "gain": by_demo,
                "order": [entry["demo"] for entry in entries],
                "spearman_truth": spearman(by_demo, truth),
                "spearman_oracle": spearman(by_demo, taught),
                "kept": curves["subset"]["demos"],
                "from_subset": curves["subset"]["outcome"],
                "from_all": curves["all"]["outcome"],
            }
        )
    print(f"### {task}\n")
    print(f"| demonstration | {truth_name} | oracle [m] | " + " | ".join(f"gain, seed {seed} [m]" for seed in SEEDS) + " |")
    print("|---|---|---|" + "---|" * len(SEEDS))
    for demo in sorted(range(len(truth)), key=lambda demo: -truth[demo]):
        row = [str(demo), f"{truth[demo]:.{digits}f}", f"{taught[demo]:.{digits}f}"]
        row += [f"{gain[demo]:+.{digits}f}" for gain in gains]
        print("| " + " | ".join(row) + " |")
    print(f"\nSpearman of the oracle itself with the {truth_name.split(' [')[0]}: {spearman(taught, truth):.2f}.\n")
    print(f"| seed | ranking | Spearman, {truth_name.split(' [')[0]} | Spearman, oracle | kept | policy from the kept [m] | from all [m] |")
    print("|---|---|---|---|---|---|---|")

    def outcome(point):
        success = "" if point["success"] is None else f" ({point['success']:.0%} score)"
        return f"{point['score']:.{digits}f}{success}"

    for run in found["runs"]:
        order = " ".join(map(str, run["order"]))
        kept = ", ".join(map(str, sorted(run["kept"])))
        print(
            f"| {run['seed']} | {order} | {run['spearman_truth']:.2f} | {run['spearman_oracle']:.2f} | {kept} "
            f"| {outcome(run['from_subset'])} | {outcome(run['from_all'])} |"
        )
    column = lambda key: [run[key] for run in found["runs"]]
    score = lambda key: [run[key]["score"] for run in found["runs"]]
    print(
        f"| mean ± std | | {mean_and_std(column('spearman_truth'), 2)} | {mean_and_std(column('spearman_oracle'), 2)} | "
        f"| {mean_and_std(score('from_subset'), digits)} | {mean_and_std(score('from_all'), digits)} |\n"
    )
    print(f"The best single demonstration, by the oracle: {max(taught):.{digits}f} m.\n")
    return found


def main():
    runs = Path(sys.argv[1])
    found = {
        "free_throw": report(runs, "free_throw", "Free Throw, eight demonstrations", "stage's heuristic [m]", stage_scores(), 2),
        "half_cheetah": report(runs, "half_cheetah", "HalfCheetah, ten noise levels", "true return", TRUE_RETURNS, 0),
    }
    (ROOT / "docs/results/spine.json").write_text(json.dumps(found, indent=1) + "\n")


main()
