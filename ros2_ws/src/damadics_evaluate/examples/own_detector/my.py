"""A detector and a fault of one's own, for `evaluate run`, `paper`, `lublin` and `recordings`."""

import numpy as np


class Sluggish:
    """How far the stem lags behind its command, averaged over ten samples."""

    def fit(self, columns):
        """Learn from a fault-free record how far it lags when all is well."""
        lag = columns['cv'] - columns['x1']
        self.mean, self.spread = lag.mean(), lag.std()

    def statistic(self, columns):
        """Return one value per sample, from this sample and earlier ones only."""
        z = np.abs(columns['cv'] - columns['x1'] - self.mean) / self.spread
        return np.convolve(z, np.full(10, 0.1))[: len(z)]


class SlackSpring:
    """The spring gives way and the position transmitter drifts with it."""

    strength = 0.5  # at the end; start (900 s) and development (0 s) may be stated as well

    def valve(self, actuator, strength):
        """Return the actuator with its constants changed."""
        from dataclasses import replace

        return replace(actuator, stiffness=actuator.stiffness * (1.0 - 0.6 * strength))

    def signals(self, columns, strength):
        """Return what the instruments show."""
        columns['x1'] = columns['x1'] - 0.2 * strength
        return columns
