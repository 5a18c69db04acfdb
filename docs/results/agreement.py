"""How well rankings of the four sports agree with the oracle; prints the table of agreement.md, keeps numbers in agreement.json.

python3 docs/results/agreement.py DEMOSIFT RUNS [SET ...]    judges what RUNS does not hold yet, of these sets or of all
python3 docs/results/agreement.py                            prints the table from agreement.json

The oracle's tables stand in data/oracle, each with the command that made it; no judging reads them.
"""

import json
import statistics
import subprocess
import sys
from pathlib import Path

from method import hit_rate, spearman

ROOT = Path(__file__).resolve().parents[2]
KEPT = Path(__file__).with_suffix(".json")
# Set, task, and what else the run says; a set of several goals is judged for one of them.
SETS = {
    "free_throw_8": ("free_throw_8", "free_throw", []),
    "free_throw_20": ("free_throw_20", "free_throw", []),
    "penalty_save_12_low_left": ("penalty_save_12", "penalty_save", ["--variant", "low_left"]),
    "handstand_15": ("handstand_15", "handstand", []),
    "martial_arts_10": ("martial_arts_10", "martial_arts", []),
}
METHODS = ["maml", "maml-mi"]
SEEDS = [0, 1, 2]


def judge(binary, runs, name, method, seed):
    """Suitabilities, in the order of the set, and what stands beside them."""
    data, task, options = SETS[name]
    out = runs / f"{name}_{method}_{seed}"
    resume = ["--resume"] if (out / "run.json").exists() else []
    line = [binary, "judge", str(ROOT / "data" / data), "--task", task, *options, "--method", method]
    line += ["--preset", "standard", "--seed", str(seed), "--out", str(out), "--json", *resume]
    found = json.loads(subprocess.run(line, check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL).stdout)
    scores = {of["demo"]: of["score"] for of in found["uncertainty"]["demonstrations"]}
    own = next((column["scores"] for column in found["data_only"] if column["name"] == "heuristic"), None)
    return {
        "gain": [scores[demo] for demo in sorted(scores)],
        "abd": found["adapted_behaviors_distance"],
        "own": own,
    }


def measured(binary, runs, wanted):
    kept = json.loads(KEPT.read_text()) if KEPT.exists() else {}
    for seed in SEEDS:
        for method in METHODS:
            for name in wanted:
                found = kept.setdefault(name, {}).setdefault(method, {})
                if str(seed) not in found:
                    found[str(seed)] = judge(binary, runs, name, method, seed)
                    KEPT.write_text(json.dumps(kept, indent=1) + "\n")
                    print(name, method, seed, file=sys.stderr, flush=True)


def spread(values):
    if len(values) < 2:
        return f"{values[0]:.2f}"
    return f"{statistics.mean(values):.2f} ± {statistics.stdev(values):.2f}".replace("-", "−")


def show():
    kept = json.loads(KEPT.read_text()) if KEPT.exists() else {}
    print("| set | method | Spearman | hit rate at 2 | at half | ABD | seeds |")
    print("|---|---|---|---|---|---|---|")
    for name in SETS:
        oracle = ROOT / "data" / "oracle" / f"{name}.json"
        if name not in kept:
            continue
        if not oracle.exists():
            print(f"{oracle} is missing: `demosift oracle` makes it", file=sys.stderr)
            continue
        truth = [alone["mean"] for alone in json.loads(oracle.read_text())["alone"]]
        rows = [(method, list(kept[name].get(method, {}).values())) for method in METHODS]
        for method, runs in rows:
            if not runs:
                continue
            gains = [run["gain"] for run in runs]
            cells = [[spearman(gain, truth) for gain in gains]]
            cells += [[hit_rate(gain, truth, k) for gain in gains] for k in (2, len(truth) // 2)]
            cells += [[run["abd"] for run in runs]]
            print(f"| `{name}` | {method} | {' | '.join(map(spread, cells))} | {len(runs)} |")
        own = next((runs[0]["own"] for _, runs in rows if runs), None)
        # Of a task with several goals it is that under the goal for which a demonstration was recorded.
        if own and not SETS[name][2]:
            cells = [spearman(own, truth), hit_rate(own, truth, 2), hit_rate(own, truth, len(truth) // 2)]
            print(f"| | the recording's own heuristic | {' | '.join(f'{cell:.2f}' for cell in cells)} | - | - |")


if __name__ == "__main__":
    if len(sys.argv) == 2:
        sys.exit(__doc__)
    if len(sys.argv) > 2:
        measured(sys.argv[1], Path(sys.argv[2]), sys.argv[3:] or list(SETS))
    show()
