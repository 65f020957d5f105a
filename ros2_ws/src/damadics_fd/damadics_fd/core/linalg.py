# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Small symmetric positive definite systems inside compiled code (numba's own need SciPy)."""

import numpy as np
from numpy.typing import NDArray

from damadics_fd.core.jit import jit

Matrix = NDArray[np.float64]


@jit
def cholesky(A: Matrix, L: Matrix, n: int) -> bool:
    """
    Factorise A = L L', n x n.

    :param A: symmetric positive definite; only the lower triangle is read.
    :param L: receives the lower triangle; may be A itself.
    :param n: leading rows and columns to use.
    :return: False where A is not positive definite; L is then unusable.
    """
    for j in range(n):
        d = A[j, j]
        for k in range(j):
            d -= L[j, k] * L[j, k]
        if not d > 0.0:
            return False
        d = np.sqrt(d)
        L[j, j] = d
        for i in range(j + 1, n):
            a = A[i, j]
            for k in range(j):
                a -= L[i, k] * L[j, k]
            L[i, j] = a / d
    return True


@jit
def forward(L: Matrix, B: Matrix, n: int, m: int) -> None:
    """
    Solve L Y = B in place.

    :param L: lower triangle, n x n.
    :param B: m right-hand sides, receives Y.
    :param n: leading rows and columns of L to use.
    :param m: leading columns of B to use.
    """
    for i in range(n):
        for k in range(i):
            a = L[i, k]
            for j in range(m):
                B[i, j] -= a * B[k, j]
        for j in range(m):
            B[i, j] /= L[i, i]


@jit
def inverse(A: Matrix, work: Matrix, n: int) -> bool:
    """
    Invert a symmetric positive definite matrix in place.

    :param A: receives its inverse.
    :param work: scratch of at least n x n.
    :param n: leading rows and columns to use.
    :return: False where A is not positive definite.
    """
    if not cholesky(A, work, n):
        return False
    for i in range(n):
        for j in range(n):
            A[i, j] = 1.0 if i == j else 0.0
    forward(work, A, n, n)  # A = L^-1
    for i in range(n):  # L^-T L^-1: rows k < i of L^-1 have no column i
        for j in range(i + 1):
            a = 0.0
            for k in range(i, n):
                a += A[k, i] * A[k, j]
            work[i, j] = a
    for i in range(n):
        for j in range(i + 1):
            A[i, j] = work[i, j]
            A[j, i] = work[i, j]
    return True
