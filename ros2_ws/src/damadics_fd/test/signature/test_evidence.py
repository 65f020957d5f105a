# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The compiled evidence against the specification written down literally with numpy."""

import ast
import inspect
from pathlib import Path

import numpy as np
import pytest
from damadics_fd.core.linalg import cholesky, forward, inverse
from damadics_fd.core.signature import state as st
from damadics_fd.core.signature.evidence import evaluate
from damadics_fd.core.signature.settings import SignatureSettings
from damadics_fd.core.signature.size import joint_change
from damadics_fd.core.signature.state import (
    N_COL,
    N_HYP,
    N_REF,
    ONE,
    PB,
    POS,
    POSX,
    SET_ALARM,
    SET_MID,
    SIGN,
    SIGN_T,
    X1,
    X1_T,
    G,
    State,
    V,
)
from damadics_fd.core.signature.sums import accumulate

pytestmark = pytest.mark.plain
COLUMNS = {1: [SIGN, V], 2: [X1], 3: [ONE], 4: [POSX], 5: [PB], 6: [G], 7: [POS]}
WIDTH = {1: [0.2, 0.5], 2: [1.0], 3: [0.2], 4: [0.3], 5: [0.3], 6: [0.3], 7: [0.1]}
PRIOR = [1.0, 0.45, 0.45, 0.03, 0.03, 0.03, 0.03, 0.03]
SIGMA = 7e-4


def spd(rng: np.random.Generator, n: int) -> np.ndarray:
    a = rng.standard_normal((n, n))
    return a @ a.T + 0.1 * np.eye(n)


def test_cholesky_forward_and_inverse_agree_with_numpy():
    rng = np.random.default_rng(1)
    for n in (1, 2, 4, N_REF):
        a = spd(rng, n)
        low = np.zeros((n, n))
        assert cholesky(a, low, n)
        np.testing.assert_allclose(np.tril(low), np.linalg.cholesky(a), rtol=1e-11)
        b = rng.standard_normal((n, 3))
        y = b.copy()
        forward(low, y, n, 3)
        np.testing.assert_allclose(np.tril(low) @ y, b, atol=1e-11)
        x = a.copy()
        assert inverse(x, np.zeros((n, n)), n)
        np.testing.assert_allclose(x @ a, np.eye(n), atol=1e-9)


def test_cholesky_refuses_an_indefinite_matrix():
    assert not cholesky(np.array([[1.0, 2.0], [2.0, 1.0]]), np.zeros((2, 2)), 2)


def blocks(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    x = rng.uniform(0.05, 0.95, n)
    v = rng.uniform(0.03, 0.2, n) * rng.choice([-1.0, 1.0], n)
    f = 0.8 / (1.0 - 0.55 * x) * rng.uniform(0.95, 1.05, n)
    phi = np.zeros((n, N_COL))
    phi[:, X1], phi[:, ONE], phi[:, V], phi[:, SIGN] = x + 0.25, 1.0, v, np.sign(v)
    node = x * 10.0
    i = node.astype(int)
    phi[np.arange(n), st.TABLE + i] = (i + 1 - node) * f
    phi[np.arange(n), st.TABLE + i + 1] = (node - i) * f
    phi[:, PB] = x + 0.25 + f
    phi[:, G] = f / 0.9
    phi[:, POS] = -(1.0 + 0.5 + x)
    phi[:, POSX] = phi[:, POS] * x
    w = rng.uniform(0.1, 1.0, n)
    phi[:, st.LAG] = 0.1 * f * rng.standard_normal(n)
    phi[:, st.STRIBECK] = np.sign(v) * np.exp(-((v / 0.026) ** 2))
    return phi, w, v


def reference_posterior(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    theta = np.zeros(N_REF)
    theta[:4] = 1.0, 0.0, 0.0246, 0.0108
    scale = np.array([1e-3, 1e-3, 1e-3, 5e-4] + [2e-3] * st.N_TABLE + [1e-3, 1e-3])
    m = rng.standard_normal((N_REF, N_REF)) * 0.3 + np.eye(N_REF)
    cov = scale[:, None] * (m @ m.T) * scale[None, :]
    return theta, np.linalg.inv(cov)


def specification(phi, w, v, r, forget, theta, J0, eps, b_r, b_p, tau=None):
    """The evidence, with full normal equations and a general solver; tau: growing changes."""
    columns, widths = dict(COLUMNS), dict(WIDTH)
    if tau is not None:
        columns[1], widths[1] = [SIGN, V, SIGN_T], [0.2, 0.5, 0.3]
        columns[2], widths[2] = [X1, X1_T], [1.0, 1.0]
    weight = w * forget ** np.arange(len(w))[::-1]
    S = (phi * weight[:, None]).T @ phi
    q = phi.T @ (weight * r)
    rr, ne, vb = weight @ r**2, weight.sum(), weight @ np.abs(v)
    sc1 = max(1.0, eps**2 * rr / (SIGMA**2 * ne))
    iv = 1.0 / (SIGMA**2 * sc1)
    J, change, std = np.zeros(N_HYP), {}, {}
    for h in range(N_HYP):
        T = columns.get(h, [])
        A = np.zeros((N_COL, N_REF + len(T)))
        A[np.arange(N_REF), np.arange(N_REF)] = 1.0
        for k, column in enumerate(T):
            A[column, N_REF + k] = 1.0
        H = iv * A.T @ S @ A
        H[:N_REF, :N_REF] += J0
        for k, width in enumerate(widths.get(h, [])):
            H[N_REF + k, N_REF + k] += width**-2
        g = iv * A.T @ q
        sol = np.linalg.solve(H, g)
        J[h] = iv * rr - g @ sol
        change[h], std[h] = sol[N_REF:], np.linalg.inv(H)[N_REF:, N_REF:]
    vm = vb / ne
    scale = theta[SIGN] + theta[V] * vm
    a = np.array([1.0, vm] if tau is None else [1.0, vm, tau])
    b = np.array([1.0] if tau is None else [1.0, tau])
    dF = a @ change[1] / scale
    dF_std = np.sqrt(a @ std[1] @ a) / scale
    if dF < -1.3:
        J[1] = J[0]
    dK = b @ change[2] / theta[X1]
    if dK < -1.05:
        J[2] = J[0]
    sc = max(1.0, J.min() / max(ne - 2.0, 1.0))
    logp = np.log(PRIOR) - J / (2.0 * sc)
    logp[1] -= 0.5 * np.log(ne)
    if logp[2:].max() - logp[1] > 3.0:  # the moving stem contradicts the stick range
        b_r = 0.0
    D = (J[0] - J.min()) / sc + 2.0 * b_r
    logp[1] += b_r
    logp[2:] += b_p
    p = np.exp(logp[1:] - logp[1:].max())
    value = [dF, dK] + [change[h][0] for h in range(3, 8)]
    width = [dF_std, np.sqrt(b @ std[2] @ b) / theta[X1]]
    width += [np.sqrt(std[h][0, 0]) for h in range(3, 8)]
    return D, p / p.sum(), np.array(value), np.array(width)


CASES = {
    'none': lambda phi: 0.0 * phi[:, 0],
    'friction': lambda phi: 0.006 * phi[:, SIGN] + 0.012 * phi[:, V],
    'no friction left': lambda phi: -0.0108 * phi[:, SIGN] - 0.0246 * phi[:, V],
    'impossible friction': lambda phi: -0.03 * phi[:, SIGN],
    'spring': lambda phi: 0.02 * phi[:, X1],
    'broken spring': lambda phi: -1.2 * phi[:, X1],
    'preload': lambda phi: 0.01 * phi[:, ONE],
    'position gain': lambda phi: 0.03 * phi[:, POSX],
    'pressure gain': lambda phi: 0.02 * phi[:, PB],
    'dp': lambda phi: 0.05 * phi[:, G],
    'position offset': lambda phi: 0.01 * phi[:, POS],
}


@pytest.mark.parametrize('case', CASES)
@pytest.mark.parametrize('eps, b_r, b_p', [(0.2, 0.0, 0.0), (0.03, 3.0, 0.0), (0.2, 0.0, 6.0)])
def test_evidence_equals_the_specification(case, eps, b_r, b_p):
    rng = np.random.default_rng(len(case))
    phi, w, v = blocks(rng, 60)
    theta, J0 = reference_posterior(rng)
    r = CASES[case](phi) + SIGMA * rng.standard_normal(60) / np.sqrt(w)
    c = SignatureSettings().record()[0]
    s = State.new()
    s.theta[:], s.J0[:, :], s.sigma = theta, J0, SIGMA
    forget = 1.0 - 1.0 / 30.0
    for k in range(60):
        s.block.ph[:], s.block.w, s.block.v = phi[k], w[k], v[k]
        accumulate(s, SET_MID, forget, r[k])
    D = evaluate(s, c, SET_MID, eps, b_r, b_p)
    expected, p, value, std = specification(phi, w, v, r, forget, theta, J0, eps, b_r, b_p)
    assert pytest.approx(expected, rel=1e-6, abs=1e-6) == D
    np.testing.assert_allclose(np.exp(s.logp[SET_MID][1:]), p, rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose(s.value[SET_MID][1:], value, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(s.sd[SET_MID][1:], std, rtol=1e-6)


@pytest.mark.parametrize('growing', [True, False])
@pytest.mark.parametrize('column', [SIGN, X1])
def test_evidence_of_growing_changes_equals_the_specification(column, growing):
    rng = np.random.default_rng(7)
    phi, w, v = blocks(rng, 40)
    theta, J0 = reference_posterior(rng)
    t = np.linspace(0.0, 0.8, 40)  # 10 s
    phi[:, SIGN_T], phi[:, X1_T] = phi[:, SIGN] * t, phi[:, X1] * t
    r = 0.02 * phi[:, column] * (t if growing else 1.0)
    r = r + SIGMA * rng.standard_normal(40) / np.sqrt(w)
    c = SignatureSettings().record()[0]
    s = State.new()
    s.theta[:], s.J0[:, :], s.sigma, s.t = theta, J0, SIGMA, 8_000_000_000
    for k in range(40):
        s.block.ph[:], s.block.w, s.block.v = phi[k], w[k], v[k]
        accumulate(s, SET_ALARM, 1.0 - 1.0 / 30.0, r[k])
    D = evaluate(s, c, SET_ALARM, 0.2, 0.0, 0.0)
    expected, p, value, std = specification(
        phi, w, v, r, 1.0 - 1.0 / 30.0, theta, J0, 0.2, 0.0, 0.0, tau=0.8
    )
    assert pytest.approx(expected, rel=1e-6) == D
    np.testing.assert_allclose(np.exp(s.logp[SET_ALARM][1:]), p, rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose(s.value[SET_ALARM][1:], value, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(s.sd[SET_ALARM][1:], std, rtol=1e-6)
    assert p[0 if column == SIGN else 1] > 0.95


def test_joint_change_separates_spring_preload_and_friction():
    rng = np.random.default_rng(5)
    phi, w, v = blocks(rng, 400)
    theta, J0 = reference_posterior(rng)
    c = SignatureSettings().record()[0]
    s = State.new()
    s.theta[:], s.J0[:, :], s.sigma = theta, J0 * 100.0, SIGMA
    change = (
        0.01 * phi[:, X1]
        + 0.004 * phi[:, ONE]
        + 0.3 * (theta[SIGN] * phi[:, SIGN] + theta[V] * phi[:, V])
    )
    for k in range(400):
        s.block.ph[:], s.block.w, s.block.v = phi[k], w[k], v[k]
        accumulate(s, SET_MID, 1.0, change[k] + SIGMA * rng.standard_normal() / np.sqrt(w[k]))
    assert joint_change(s, c, SET_MID)
    expected = np.array([0.01, 0.004 * c.force_scale, 0.3])
    assert np.all(np.abs(s.now - expected) < 4.0 * s.now_std)
    assert np.all(s.now_std < [0.002, 4.0, 0.05])


def test_settings_read_the_same_uncompiled():
    """A setting that hides a method of numpy.record would differ between both ways to run."""
    assert not set(SignatureSettings().record().dtype.names) & set(dir(np.generic))


def test_every_field_of_the_state_is_written_by_one_file():
    room = Path(inspect.getfile(State)).parent
    writers = {name: set() for name in State.names()}
    for source in room.rglob('*.py'):
        for function in ast.walk(ast.parse(source.read_text('utf-8'))):
            if isinstance(function, ast.FunctionDef):
                for name in written(function) & writers.keys():
                    writers[name].add(source.name)
    del writers['block'], writers['work']  # scratch
    assert {name: files for name, files in writers.items() if len(files) != 1} == {}


def written(function: ast.FunctionDef) -> set[str]:
    """Return the fields of `s` that a function assigns to, by another name too."""
    views, fields = {}, set()
    for node in ast.walk(function):
        if not isinstance(node, ast.AugAssign | ast.AnnAssign | ast.Assign):
            continue
        for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
            pairs = [(target, node.value)]
            if isinstance(target, ast.Tuple):
                values = getattr(node.value, 'elts', [node.value] * len(target.elts))
                pairs = zip(target.elts, values, strict=True)
            for to, value in pairs:
                if isinstance(to, ast.Name):
                    views[to.id] = field_of(value, views)
                else:
                    fields.add(field_of(to, views))
    return fields


def field_of(node: ast.expr, views: dict[str, str]) -> str:
    """Return the field of `s` that an expression is a view of, '' for none."""
    while isinstance(node, ast.Subscript):
        node = node.value
    if isinstance(node, ast.Name):
        return views.get(node.id, '')
    own = isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name)
    return node.attr if own and node.value.id == 's' else ''
