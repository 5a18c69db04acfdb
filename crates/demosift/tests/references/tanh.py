"""Coefficients of the rational tanh in src/nn/real.rs.

Fits tanh(x) = x P(x^2) / Q(x^2) on [0, LIMIT] with the least largest relative error, by iterated
reweighted least squares (Sanathanan-Koerner for the denominator, Lawson for the maximum norm).
Needs mpmath. Usage: python3 tanh.py [degree of P] [degree of Q]
"""
import sys

from mpmath import matrix, mp, mpf, qr_solve, tanh, cos, pi

mp.dps = 40
LIMIT, POINTS, ROUNDS = mpf(9), 160, 40


def values(coefficients, x):
    return sum(c * x ** (2 * i) for i, c in enumerate(coefficients))


def fit(p_degree, q_degree):
    # Chebyshev-like nodes in [0, LIMIT]
    nodes = [LIMIT * (1 - cos(pi * (i + mpf(1) / 2) / POINTS)) / 2 for i in range(POINTS)]
    weights, denominator = [mpf(1)] * POINTS, [mpf(1)] * POINTS
    for _ in range(ROUNDS):
        system, right = matrix(POINTS, p_degree + q_degree + 1), matrix(POINTS, 1)
        for row, x in enumerate(nodes):
            scale = weights[row] ** 0.5 / denominator[row]
            for i in range(p_degree + 1):
                system[row, i] = scale * x ** (2 * i + 1) / tanh(x)
            for i in range(1, q_degree + 1):
                system[row, p_degree + i] = -scale * x ** (2 * i)
            right[row] = scale
        solution, _ = qr_solve(system, right)
        p = [solution[i] for i in range(p_degree + 1)]
        q = [mpf(1)] + [solution[p_degree + i] for i in range(1, q_degree + 1)]
        denominator = [values(q, x) for x in nodes]
        errors = [abs(x * values(p, x) / values(q, x) / tanh(x) - 1) for x in nodes]
        weights = [w * e for w, e in zip(weights, errors)]
        total = sum(weights)
        weights = [w * POINTS / total for w in weights]
    return p, q, max(errors)


if __name__ == "__main__":
    degrees = [int(argument) for argument in sys.argv[1:]] or [4, 4]
    p, q, error = fit(*degrees)
    print("P", *[mp.nstr(c, 12) for c in p], sep="\n  ")
    print("Q", *[mp.nstr(c, 12) for c in q], sep="\n  ")
    print("largest relative error at the nodes", mp.nstr(error, 3))
