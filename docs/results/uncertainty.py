"""How often the intervals of two repeats hold the mean of the others, from a score table of many repeats.

    python3 docs/results/uncertainty.py RUN_FOLDER

Standard library only. The interval is that of crates/demosift/src/uncertainty.rs for two repeats: Student's t with 5
degrees of freedom, 4 of them for the set's mean spread. Episodes are the same for all repeats, so their noise is out.
"""
import itertools
import json
import math
import statistics
import sys

T_95_OF_5 = 2.0150  # of Student's t with 5 degrees of freedom, for an interval of 90 %
POOLING = 4

table = json.load(open(f"{sys.argv[1]}/scores.json"))["suitabilities"]
means = [[statistics.mean(scores) for scores in one["after"]] for one in table]
repeats = len(means[0])
print("demonstration, mean after, standard deviation over repeats")
for one, of in zip(table, means):
    print(one["demo"], round(statistics.mean(of), 2), round(statistics.stdev(of), 2))

held = between = total = 0
for pair in itertools.combinations(range(repeats), 2):
    variances = [statistics.variance([of[i] for i in pair]) for of in means]
    common = statistics.mean(variances)
    for of, own in zip(means, variances):
        rest = statistics.mean(of[i] for i in range(repeats) if i not in pair)
        two = [of[i] for i in pair]
        variance = (own + POOLING * common) / (1 + POOLING)
        # The mean of the others is not the truth either, and its own error is allowed for.
        error = math.sqrt(variance / 2 + variance / (repeats - 2))
        held += abs(statistics.mean(two) - rest) < T_95_OF_5 * error
        between += min(two) <= rest <= max(two)
        total += 1
print(f"the interval of two repeats holds the mean of the others in {held / total:.0%} of {total} cases")
print(f"the range between the two does in {between / total:.0%}")

deviations = [[value - statistics.mean(of) for value in of] for of in means]
correlations = [statistics.correlation(a, b) for a, b in itertools.combinations(deviations, 2)]
print(f"deviations of the same repeat correlate by {statistics.mean(correlations):.2f} between demonstrations")
