"""Prints the numbers stored in the test of src/metrics/agreement.rs: Kendall's tau-b by scipy 1.x (pip install scipy)."""
from scipy.stats import kendalltau

left = [106, 86, 100, 101, 99, 103, 97, 113, 112, 110]
right = [7, 0, 27, 50, 28, 29, 20, 12, 6, 17]
tied = [1, 2, 2, 3, 3, 3, 4, 5, 5, 9]
tied_too = [2, 2, 1, 1, 7, 3, 3, 3, 8, 8]
for a, b in [(left, right), (tied, left), (tied, tied_too)]:
    print(repr(float(kendalltau(a, b, variant="b").statistic)))
