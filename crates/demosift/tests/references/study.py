"""Prints the numbers stored in the tests of src/study/estimate.rs: paired t intervals and quantiles by scipy 1.x (pip install scipy)."""
import numpy as np
from scipy.stats import t, ttest_rel

one = np.array([0.91, 0.88, 0.93, 0.79, 0.95, 0.9, 0.86, 0.92, 0.81, 0.94])
other = np.array([0.85, 0.9, 0.84, 0.75, 0.93, 0.78, 0.88, 0.83, 0.72, 0.9])
for count in (10, 3):
    interval = ttest_rel(one[:count], other[:count]).confidence_interval(0.95)
    print([float(np.mean(one[:count] - other[:count])), float(interval.low), float(interval.high)])
print([(n, float(t.ppf(0.975, n))) for n in (1, 2, 5, 9, 12, 13, 20, 30, 99)])
print([float(t.ppf(0.975, n)) for n in range(1, 13)])
