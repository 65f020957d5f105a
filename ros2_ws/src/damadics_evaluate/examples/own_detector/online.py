"""A detector that judges sample by sample, with a limit of its own."""


class OneSidedCusum:
    """CUSUM of the lag between command and position (k = 3, h = 12)."""

    def fit(self, columns):
        """Learn mean and spread, start at zero."""
        lag = columns['cv'] - columns['x1']
        self.mean, self.spread, self.sum = lag.mean(), lag.std(), 0.0

    def update(self, sample):
        """Return score and limit; it flags while the score is at the limit or above."""
        z = abs(sample.cv - sample.x1 - self.mean) / self.spread
        self.sum = min(max(0.0, self.sum + z - 3.0), 24.0)
        return self.sum, 12.0
