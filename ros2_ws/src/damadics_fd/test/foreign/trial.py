# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""One foreign valve through commission and monitor: false alarms, delay, cause, size."""

from dataclasses import dataclass, replace

import numpy as np
from damadics_fd.commands.commission.monitor import identify
from damadics_fd.core.decision.alarm import RAISED
from damadics_fd.core.monitor import run
from damadics_fd.core.settings import Settings
from damadics_fd.core.settings.identified import FaultFree
from damadics_fd.core.signature.signature import Signature

from . import courses
from . import valve as foreign

FAULTS = {
    'friction +100 %': {'dry': 1.0, 'viscous': 1.0},
    'friction +300 %': {'dry': 3.0, 'viscous': 3.0},
    'dry +100 %': {'dry': 1.0},
    'dry +300 %': {'dry': 3.0},
    'spring -20 %': {'spring': -0.2},
}
RIGHT = {'spring -20 %': 'spring_softer'}


@dataclass
class Trial:
    """What became of one fault on one valve."""

    armed: bool
    false_alarms: int
    found: bool
    delay: float  # s of motion since the onset
    cause: str
    right: bool
    size: float  # NaN: withheld
    std: float
    true: float
    occurrences: int  # after the onset
    verdict: str


def commissioned(valve, seed, minutes=20.0, course=None, spoil=None, **given):
    """Return what commission proposes for a valve from strokes."""
    cv = courses.steps(60.0 * minutes, seed)
    columns = foreign.simulate(valve, cv, course, seed=seed)
    if spoil:
        columns = spoil(columns, seed)
    sheet = foreign.sheet(valve, **given)
    return identify([FaultFree('strokes', columns)], Settings.for_mode('monitor', **sheet), sheet)


def trial(
    valve, proposal, fault, seed, quiet=1200.0, after=300.0, course=None, cv=None, spoil=None
):
    """Run a valve fault-free, then with a fault as a step."""
    c = replace(course or foreign.Course(), fault_at=quiet, **FAULTS.get(fault, {}))
    command = courses.steps(quiet + after, seed + 1000) if cv is None else cv
    columns = foreign.simulate(valve, command, c, seed=seed + 1000)
    if spoil:
        columns = spoil(columns, seed)
    result = run(columns, proposal.settings)
    events = result.events
    zero = int(columns['stamp'][0])
    raised = [(e.stamp - zero) * 1e-9 for e in events if e.transition == RAISED]
    after_onset = [t for t in raised if t >= quiet]
    found = bool(after_onset) or bool(result.decisions['fault'][-1])
    moving = np.abs(np.gradient(columns['x1'][::20], 0.1)) > 0.02
    t = (columns['stamp'][::20] - zero) * 1e-9
    delay = np.nan
    if after_onset:
        delay = 0.1 * float(np.sum(moving & (t >= quiet) & (t < after_onset[0])))
    signature: Signature = result.detector.signature
    view = signature.view()
    right = view.cause == RIGHT.get(fault, 'friction_up')
    true = -0.2 if fault in RIGHT else FAULTS.get(fault, {}).get('dry', np.nan)
    monitoring = result.estimator.monitoring and bool(signature.state['verified'][0])
    return Trial(
        monitoring,
        sum(t < quiet for t in raised),
        found,
        delay,
        view.cause,
        right,
        view.value,
        view.std,
        true,
        len(after_onset),
        proposal.verdict,
    )
