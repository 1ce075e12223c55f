"""Rank of the regressor of a mechanism with sixty digits, by Gaussian elimination with full pivoting."""

import itertools

import numpy as np

# Relative to the first pivot: those that count are above `KEPT`, all others below `DROPPED`.
KEPT, DROPPED = 1e-25, 1e-35


def pivots_of(matrix):
    """Absolute pivots in order, the first one 1."""
    rest, pivots = matrix.copy(), []
    while rest.size:
        i, j = np.unravel_index(np.argmax(np.abs(rest)), rest.shape)
        pivot = rest[i, j]
        if pivot == 0:
            break
        pivots.append(abs(pivot))
        row, column = rest[i] / pivot, rest[:, j]
        rest = np.delete(np.delete(rest - np.outer(column, row), i, 0), j, 1)
    return [float(p / pivots[0]) for p in pivots]


def random_positions(mechanism, rng, spread, n):
    """Positions of the independent coordinates, within a share of their nominal values."""
    nominal = np.array([mechanism.nominal[x] for x in mechanism.active])
    return (nominal + rng.uniform(-spread, spread, len(nominal)) * np.maximum(np.abs(nominal), 0.3) for _ in range(n))


def states_near_nominal(mechanism, rng, spread, n_states):
    """Random positions with the passive coordinates that are reached from the nominal pose."""
    followed = ((q, mechanism.follow(q)) for q in random_positions(mechanism, rng, spread, 100 * n_states))
    return list(itertools.islice((state for state in followed if state[1] is not None), n_states))


def rank_of(rough, exact, rng, spread, n_rows):
    """Rank over random states, the pivots on both sides of it, and the number of states.

    The mechanism with doubles finds the states, the one with sixty digits computes the regressor.
    """
    n, rows = len(rough.active), []
    for q, start in states_near_nominal(rough, rng, spread, -(-n_rows // n)):
        h = exact.regressor(q, rng.uniform(-2, 2, n), rng.uniform(-4, 4, n), start)
        if h is None:
            raise ValueError("the loops do not close to 50 digits")
        rows.append(h)
    matrix = np.concatenate(rows)
    size = np.abs(matrix).max(axis=0)
    # Columns of similar size; those that are only rounding stay small.
    pivots = pivots_of(matrix / np.maximum(size, 1e-10 * size.max())) + [0.0]
    rank = sum(p > DROPPED for p in pivots)
    return rank, pivots[rank - 1], pivots[rank], len(rows)
