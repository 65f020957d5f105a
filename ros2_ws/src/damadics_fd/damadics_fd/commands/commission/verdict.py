# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""How far what was identified is to be trusted, and what will be found with it."""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from damadics_fd.commands.commission.forces.balance import Balance
from damadics_fd.commands.commission.forces.lag import trust
from damadics_fd.commands.commission.forces.regression import K
from damadics_fd.core.settings import Settings
from damadics_fd.core.signature.settings import SignatureSettings

PARTS = 4  # of the moving time, compared with each other
CERTAIN = 4.0  # standard deviations
SHEET = 0.05  # share by which a stated constant may be off without a word
ANOTHER = 0.2  # share by which no spring is off its data sheet
TELLING_PLUG = 0.2  # of the spring force over the stroke: a plug force that tells the area
SAME_PLUG = 1.1  # factor on the plug force within which it confirms the area
OTHER_PLUG = 1.27  # factor on the plug force beyond which it is not that of the sheet
BALANCED = 0.5  # of the plug force of the sheet: less is left by a trim that is balanced
SIZES = ('stroke', 'area', 'stiffness')
DEFAULT = Settings.for_mode('monitor')
REFERENCE = 2.0  # inflation of the variance of the reference, as in the signature
GOOD_FRICTION, GOOD_SPRING = 1.0, 0.2  # smallest changes found of a valve that is not limited
FREE = 2e-3  # of the spring force: friction of a valve that hardly has any
TRUSTED = 0.5  # of the friction: a larger misfit hides it


@dataclass(frozen=True)
class Found:
    """Hold the smallest change of friction and stiffness, as shares, that raises an alarm."""

    friction: float
    spring: float


def smallest(b: Balance, seconds: float) -> Found:
    """
    Return what the signature will find, from the information in its sums.

    A change d raises D = d^2 (Jjj - Jj' (J + J0)^-1 Jj) to the level of the own alarm, with the
    information J of the moving blocks in that time and J0 of the reference.

    :param b: the balance.
    :param seconds: of operation like in the recording.
    :return: shares of friction and stiffness.
    """
    c = SignatureSettings.of(b.settings)
    sigma = max(b.misfit, c.sigma_min * c.force_scale)
    w = trust(b.v, b.sticky)
    A = b.columns / sigma
    S_all = (A * w[:, None]).T @ A
    per = np.array([b.settings.stroke, 1.0, b.settings.stroke, 1.0])
    floor = np.array(c.floor) * c.force_scale / per
    J0 = np.linalg.inv(REFERENCE * np.linalg.pinv(S_all) + np.diag(floor**2))
    per_second = float(w.sum()) / max(b.watched, 1.0)
    share = min(c.memory[2], per_second * seconds) / float(w.sum())
    J = share * S_all
    friction = np.array([0.0, 0.0, b.viscous, b.friction])
    spring = np.array([b.settings.stiffness, 0.0, 0.0, 0.0])
    eliminated = J - J @ np.linalg.solve(J + J0, J)
    sizes = [
        float(np.sqrt(c.d_alarm / max(float(d @ eliminated @ d), 1e-12)))
        for d in (friction, spring)
    ]
    return Found(*sizes)


def parts_differ(b: Balance) -> list[str]:
    """
    Compare the parts of the recordings: a fault-free valve stays the same.

    :param b: the balance.
    :return: a sentence for each quantity that differs.
    """
    order = np.array_split(np.arange(len(b.t)), PARTS)
    rows = []
    floor = max(b.misfit, 1e-9)
    lean = np.zeros((4, 4))  # the viscous part is that of all, give or take the dry one
    lean[2, 2] = (0.3 * b.viscous + 10.0 * b.friction / b.settings.stroke + 1e-9) ** -2
    for part in order:
        A, y, w = b.columns[part], b.force[part], trust(b.v[part], b.sticky[part])
        up = int(np.sum(b.v[part] > 0.0))
        if min(up, len(part) - up) < 5 or np.ptp(b.x[part]) < 0.1:
            continue
        mean = np.array([0.0, 0.0, b.viscous, 0.0])
        H = (A * w[:, None]).T @ A / floor**2 + lean
        theta = np.linalg.solve(H, (A * w[:, None]).T @ y / floor**2 + lean @ mean)
        left = y - A @ theta
        noise = max(float(np.sqrt(np.sum(w * left**2) / max(w.sum() - 4.0, 1.0))), floor)
        v = b.settings.stroke * float(np.median(np.abs(b.v)))
        to_total = np.array([0.0, 0.0, v, 1.0])
        cov = np.linalg.inv(H) * (noise / floor) ** 2
        rows.append(
            (
                float(to_total @ theta),
                float(np.sqrt(to_total @ cov @ to_total)),
                float(theta[K]),
                float(np.sqrt(cov[K, K])),
                noise,
            )
        )
    if len(rows) < 2:
        return []
    friction, friction_std, stiffness, stiffness_std, _ = np.array(rows).T
    s, found = b.settings, []
    for name, values, std, share, unit in (
        ('friction', friction, friction_std, s.material_friction, 'N'),
        ('stiffness', stiffness, stiffness_std, s.material_spring, 'N/m'),
    ):
        low, high = int(np.argmin(values)), int(np.argmax(values))
        width = float(np.hypot(std[low], std[high]))
        allowed = share * abs(float(np.median(values))) + CERTAIN * width
        if values[high] - values[low] > allowed:
            found.append(
                f'the {name} is not the same throughout ({values[low]:.4g} to {values[high]:.4g} '
                f'{unit}): a fault in the recording, or two valves? see --until'
            )
    return found


def sheet_differs(b: Balance, sheet: Settings, given: Collection[str]) -> list[str]:
    """
    Name the stated constants that the valve does not have.

    :param b: the balance.
    :param sheet: what was stated.
    :param given: names of what was stated.
    :return: a sentence for each.
    """
    found = []
    for name, stated, seen in (
        ('stiffness', sheet.stiffness, b.settings.stiffness),
        ('preload', 1.0 + sheet.preload, 1.0 + b.settings.preload),
    ):
        if name in given and abs(seen / stated - 1.0) > SHEET:
            shown = (getattr(sheet, name), getattr(b.settings, name))
            found.append(f'{name} is stated as {shown[0]:.4g} and found to be {shown[1]:.4g}')
    if sheet.plug_diameter > 0.0 and abs(b.gain - 1.0) > SHEET:
        found.append(f'the plug force is {b.gain:.2f} of what plug_diameter and plug_table say')
    return found


def another_valve(b: Balance, sheet: Settings, given: Collection[str]) -> list[str]:
    """
    Tell where the spring is so far from the one found that the constants are another valve's.

    Stiffness is found as force over way: a wrong stroke or area shifts it as a wrong spring does.

    :param b: the balance.
    :param sheet: what was stated.
    :param given: names of what was stated.
    :return: a sentence, none where it fits or where no stiffness belongs to stroke and area.
    """
    share = b.settings.stiffness / sheet.stiffness
    if 1.0 - ANOTHER <= share <= 1.0 + ANOTHER:
        return []
    if 'stiffness' in given:
        return [
            f'the spring is {share:.2f} times as stiff as stated: stroke, area or stiffness is '
            'not that of this valve, and sizes in N and mm are off; changes are told as shares'
        ]
    if _of_default(sheet):
        return [
            f'the spring is {share:.2f} times as stiff as that of the default valve, whose stroke '
            'and area were taken: state stroke, area and stiffness of this one; sizes in N and mm '
            'are off, changes are told as shares'
        ]
    return []


def _of_default(sheet: Settings) -> bool:
    return all(getattr(sheet, name) == getattr(DEFAULT, name) for name in SIZES)


def _telling(b: Balance) -> bool:
    """Tell whether the plug force of the sheet is so large that it compares with the area."""
    by_sheet = b.plug / max(b.gain, 1e-9)
    return by_sheet > TELLING_PLUG * b.settings.stiffness * b.settings.stroke


def another_plug(b: Balance, sheet: Settings, given: Collection[str]) -> list[str]:
    """
    Tell where the plug force is so far from the table that it is another plug's.

    Where the spring fits, the area can only be wrong together with the stroke. Much less than the
    table says is a balanced trim.

    :param b: the balance.
    :param sheet: what was stated.
    :param given: names of what was stated.
    :return: a sentence, none where it fits or no stiffness was stated.
    """
    fits = 1.0 / OTHER_PLUG <= b.gain <= OTHER_PLUG
    if 'stiffness' not in given or not _telling(b) or fits or b.gain < BALANCED:
        return []
    diameter = sheet.plug_diameter * float(np.sqrt(b.gain))
    return [
        f'the plug force is {b.gain:.2f} of what plug_diameter and plug_table say: the plug is '
        f'another one (then state plug_diameter={diameter:.3g}), or stroke and area are off alike'
    ]


def unchecked(b: Balance, sheet: Settings, given: Collection[str]) -> list[str]:
    """
    Name what is taken from the settings because no recording can check it.

    Pressures and positions as shares give forces in units of the area, and nothing in metres. A
    stated stiffness tells the stroke, a plug force as the sheet has it tells the area.

    :param b: the balance.
    :param sheet: what was stated.
    :param given: names of what was stated.
    :return: a sentence, none where there is a stiffness to compare with.
    """
    if 'stiffness' in given or _of_default(sheet):
        return []
    fits = _telling(b) and 1.0 / SAME_PLUG <= b.gain <= SAME_PLUG
    names = 'stroke' if fits else 'stroke, area'
    return [
        f'the data sheet alone tells {names}: state the stiffness of the spring too '
        '(--set stiffness=N/m), which checks it; until then sizes in N, N/m and mm are as good as '
        'the sheet, while alarms, causes and changes as shares do not depend on it'
    ]


def hidden_friction(b: Balance) -> bool:
    """
    Tell whether the balance leaves more than half the friction unexplained.

    What the noise of the sensors leaves is averaged out by the signature and does not count.

    :param b: the balance.
    :return: True where friction faults cannot be seen.
    """
    model = float(np.sqrt(max(b.misfit**2 - b.noise**2, 0.0)))
    least = FREE * b.settings.stiffness * b.settings.stroke
    return model > TRUSTED * max(b.total, least)
