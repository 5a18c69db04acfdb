"""Trains the demonstrators of the four sports and records their sets, with the commands of data/README.md, and keeps what
demonstrators.md shows in demonstrators.json and docs/images/demonstrators.svg.

python3 docs/results/demonstrators.py DEMOSIFT RUNS    trains, records and times with this binary; folders that exist are kept
python3 docs/results/demonstrators.py                  prints the tables and draws the figure from demonstrators.json
"""

import json
import re
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
KEPT = Path(__file__).with_suffix(".json")
FIGURE = ROOT / "docs/images/demonstrators.svg"
ENOUGH = 0.8
COLORS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9"]


def commands():
    """The lines of data/README.md, in their order: name of the run folder, arguments."""
    lines = re.findall(r"^demosift (record .*)$", (ROOT / "data/README.md").read_text(), re.M)
    return [(Path(line.split("--out ")[1]).name, line.split()) for line in lines]


def record(binary, runs):
    runs.mkdir(parents=True, exist_ok=True)
    for name, arguments in commands():
        arguments = [argument.replace("runs/", f"{runs}/") for argument in arguments]
        out = Path(arguments[arguments.index("--out") + 1])
        if (out / "provenance.json").exists():
            continue
        begun = time.monotonic()
        subprocess.run([binary, *arguments], check=True, cwd=ROOT)
        (out / "seconds.txt").write_text(f"{time.monotonic() - begun:.1f}\n")


def summary(runs):
    found = {}
    for name, arguments in commands():
        out = runs / Path(arguments[arguments.index("--out") + 1]).name
        provenance = json.loads((out / "provenance.json").read_text())
        rows = [json.loads(line) for line in (out / "metrics.jsonl").read_text().splitlines()] if (out / "metrics.jsonl").exists() else []
        curve = [row for row in rows if row["stage"] == "demonstrator" and row["part"] == ""]
        every = max(1, len(curve) // 60)
        thinned = [row for index, row in enumerate(curve) if index % every == 0 or index == len(curve) - 1]
        reached = next((row["environment_steps"] for row in curve if row["success"] >= ENOUGH), None)
        found[name] = {
            "demonstrator": {key: provenance[key] for key in ["task", "updates", "environment_steps", "final"]},
            "guests": provenance.get("guests", []),
            "trained_here": bool(curve),
            "seconds": float((out / "seconds.txt").read_text()),
            "steps_to_enough": reached,
            "curve": [[int(row["environment_steps"]), round(row["task_return"], 3), round(row["score"], 4), round(row["success"], 3)] for row in thinned],
            "demonstrations": [
                {key: origin.get(key) for key in ["demonstration", "task", "variant", "updates", "stage_return", "stage_score", "stage_success", "score", "succeeded"]}
                for origin in provenance["demonstrations"]
            ],
        }
    return found


def table(found):
    print("| set | environment steps to 80 % | wall time to 80 % | whole training | success of 100 episodes after it |")
    print("|---|---|---|---|---|")
    for name, run in found.items():
        if not run["trained_here"]:
            continue
        whole, final = run["demonstrator"], run["demonstrator"]["final"]
        share = run["steps_to_enough"] / whole["environment_steps"]
        print(
            f"| `{name}` | {run['steps_to_enough']:,.0f} | {share * run['seconds']:.0f} s "
            f"| {whole['environment_steps']:,} in {run['seconds']:.0f} s | {100 * final['success']:.0f} % |"
        )
    print("\n| set | mean task return of the stages, worst first | demonstrations that succeed |")
    print("|---|---|---|")
    for name, run in found.items():
        origins = sorted(run["demonstrations"], key=lambda origin: origin["stage_score"])
        step = max(1, len(origins) // 10)
        returns = ", ".join(f"{origin['stage_return']:.0f}" for origin in origins[::step])
        print(f"| `{name}` | {returns} | {sum(bool(origin['succeeded']) for origin in origins)} of {len(origins)} |")


def figure(found):
    """Success over environment steps, a line for each demonstrator."""
    runs = [(run["demonstrator"]["task"], run["curve"]) for run in found.values() if run["trained_here"]]
    width, height, left, top, right, bottom = 720, 320, 60, 20, 190, 50
    most = max(curve[-1][0] for _, curve in runs)
    x = lambda steps: left + (width - left - right) * steps / most
    y = lambda share: height - bottom - (height - top - bottom) * share
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="13">',
        f'<rect width="{width}" height="{height}" fill="white"/>',
    ]
    for share in [0, 0.2, 0.4, 0.6, 0.8, 1]:
        parts.append(f'<line x1="{left}" x2="{width - right}" y1="{y(share):.1f}" y2="{y(share):.1f}" stroke="#{"888" if share == ENOUGH else "ddd"}"/>')
        parts.append(f'<text x="{left - 8}" y="{y(share) + 4:.1f}" text-anchor="end">{100 * share:.0f} %</text>')
    for index in range(5):
        steps = most * index / 4
        parts.append(f'<text x="{x(steps):.1f}" y="{height - bottom + 20}" text-anchor="middle">{steps / 1e6:.2f}</text>')
    parts.append(f'<text x="{(left + width - right) / 2}" y="{height - 8}" text-anchor="middle">environment steps, millions</text>')
    for index, (task, curve) in enumerate(runs):
        points = " ".join(f"{x(row[0]):.1f},{y(row[3]):.1f}" for row in curve)
        color = COLORS[index % len(COLORS)]
        parts.append(f'<polyline points="{points}" fill="none" stroke="{color}" stroke-width="2"/>')
        parts.append(f'<line x1="{width - right + 12}" x2="{width - right + 36}" y1="{40 + 22 * index}" y2="{40 + 22 * index}" stroke="{color}" stroke-width="3"/>')
        parts.append(f'<text x="{width - right + 42}" y="{44 + 22 * index}">{task}</text>')
    FIGURE.write_text("\n".join([*parts, "</svg>\n"]))


if __name__ == "__main__":
    if len(sys.argv) == 3:
        binary, runs = Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve()
        record(binary, runs)
        KEPT.write_text(json.dumps(summary(runs)) + "\n")
    found = json.loads(KEPT.read_text())
    table(found)
    figure(found)
