"""Random numbers of a grammar: rounded, so that the text of a description has them exactly."""

import random


class DrawnNumbers:
    """Random numbers from a seed."""

    def __init__(self, seed):
        self.rng = random.Random(seed)

    def number(self, low=0.1, high=1.0):
        return round(self.rng.uniform(low, high), 3)

    def signed(self, size=0.5):
        return round(self.rng.uniform(0.1, size) * self.rng.choice([-1, 1]), 3)

    def vec(self, n=3, size=0.5):
        return " ".join(str(self.signed(size)) for _ in range(n))
