"""How what policies score at the end of their training by GAIL goes with what their demonstrations score themselves.

python docs/results/end_of_training.py        prints the table from fig3.json and data/provenance

A row is over the subsets of Fig. 3 on which policies were trained: of each the mean of its trainings, and of its demonstrations.
"""

import json
from collections import defaultdict
from pathlib import Path
from statistics import correlation, mean

HERE = Path(__file__).parent
SETS = ["free_throw_8", "martial_arts_10"]


def trainings(name, cells):
    """Score at the end and of the best policy on the way, by the subset that it learned from."""
    found = defaultdict(list)
    for cell in cells:
        work, training = cell["work"], cell["found"].get("training")
        if training and work["set"] == name and work["imitator"] == "gail":
            found[tuple(work["demos"])].append((training["end"]["score"], training["chosen"]["score"]))
    return found


def row(name, cells):
    provenance = json.loads((HERE.parents[1] / "data" / "provenance" / f"{name}.json").read_text())
    shown = {of["demonstration"]: of["score"] for of in provenance["demonstrations"]}
    by_subset = trainings(name, cells)
    own = [mean(shown[demo] for demo in subset) for subset in by_subset]
    end, best = ([mean(of[which] for of in found) for found in by_subset.values()] for which in (0, 1))
    beyond = [mean(of) - mean(own) for of in (end, best)]
    return f"| {name} | {len(own)} | {correlation(own, end):.2f} | {beyond[0]:+.2f} m | {beyond[1]:+.2f} m |"


if __name__ == "__main__":
    results = json.loads((HERE / "fig3.json").read_text())
    print("| set | subsets | correlation of the end with what was shown | end − shown | best on the way − shown |")
    print("|---|---|---|---|---|")
    for name in SETS:
        print(row(name, results["cells"]))
