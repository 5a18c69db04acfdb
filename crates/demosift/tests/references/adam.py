"""Prints the numbers stored in the test of src/nn/adam.rs: Adam (Kingma & Ba, 2015, Algorithm 1) on
f(x, y, z) = x^2 + 10 (y - 1)^2 + sin(z), learning rate 0.05, in double precision. Standard library only."""
import math

x, m, v = [1.0, -1.0, 0.5], [0.0] * 3, [0.0] * 3
for t in range(1, 201):
    g = [2 * x[0], 20 * (x[1] - 1), math.cos(x[2])]
    for i in range(3):
        m[i] = 0.9 * m[i] + 0.1 * g[i]
        v[i] = 0.999 * v[i] + 0.001 * g[i] ** 2
        x[i] -= 0.05 * (m[i] / (1 - 0.9**t)) / (math.sqrt(v[i] / (1 - 0.999**t)) + 1e-8)
    if t in (1, 2, 10, 200):
        print(t, x)
