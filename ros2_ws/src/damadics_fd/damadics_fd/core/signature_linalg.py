# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Small symmetric positive definite systems inside compiled code (numba's own need SciPy)."""

import numpy as np
from numpy.typing import NDArray

from damadics_fd.core.jit import jit

Matrix = NDArray[np.float64]


@jit
def cholesky(A: Matrix, L: Matrix) -> bool:
    """
    Factorise A = L L'.

    :param A: symmetric positive definite, n x n; only the lower triangle is read.
    :param L: n x n, receives the lower triangle; may be A itself.
    :return: False where A is not positive definite; L is then unusable.
    """
    n = A.shape[0]
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
def forward(L: Matrix, B: Matrix) -> None:
    """
    Solve L Y = B in place.

    :param L: lower triangle, n x n.
    :param B: n x m right-hand sides, receives Y.
    """
    n, m = B.shape
    for i in range(n):
        for k in range(i):
            a = L[i, k]
            for j in range(m):
                B[i, j] -= a * B[k, j]
        for j in range(m):
            B[i, j] /= L[i, i]


@jit
def inverse(A: Matrix, work: Matrix) -> bool:
    """
    Invert a symmetric positive definite matrix in place.

    :param A: n x n, receives its inverse.
    :param work: n x n scratch.
    :return: False where A is not positive definite.
    """
    n = A.shape[0]
    if not cholesky(A, work):
        return False
    A[:, :] = 0.0
    for i in range(n):
        A[i, i] = 1.0
    forward(work, A)  # A = L^-1
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
