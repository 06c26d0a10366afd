"""Small matrices in plain loops: products, inverses, and Riccati equations by doubling."""

from numpy.typing import NDArray

MOST_DOUBLINGS = 60


def multiply(a: NDArray, b: NDArray, product: NDArray) -> None:
    """product = a b; it is none of both."""
    for i in range(product.shape[0]):
        for j in range(product.shape[1]):
            total = 0.0
            for k in range(a.shape[1]):
                total += a[i, k] * b[k, j]
            product[i, j] = total


def add_product_transposed(a: NDArray, b: NDArray, result: NDArray) -> None:
    """result += a b^T."""
    for i in range(result.shape[0]):
        for j in range(result.shape[1]):
            total = 0.0
            for k in range(a.shape[1]):
                total += a[i, k] * b[j, k]
            result[i, j] += total


def multiply_transposed(a: NDArray, b: NDArray, product: NDArray) -> None:
    """product = a^T b; it is none of both."""
    for i in range(product.shape[0]):
        for j in range(product.shape[1]):
            total = 0.0
            for k in range(a.shape[0]):
                total += a[k, i] * b[k, j]
            product[i, j] = total


def invert(a: NDArray, inverse: NDArray) -> None:
    """The inverse by elimination with pivots; `a` is used up. Raises: ValueError where there is none."""
    size = a.shape[0]
    for i in range(size):
        for j in range(size):
            inverse[i, j] = 1.0 if i == j else 0.0
    for column in range(size):
        pivot = column
        for i in range(column + 1, size):
            if abs(a[i, column]) > abs(a[pivot, column]):
                pivot = i
        if a[pivot, column] == 0.0:
            raise ValueError("a matrix that has to be inverted is singular")
        for j in range(size):
            a[column, j], a[pivot, j] = a[pivot, j], a[column, j]
            inverse[column, j], inverse[pivot, j] = inverse[pivot, j], inverse[column, j]
        scale = 1.0 / a[column, column]
        for j in range(size):
            a[column, j] *= scale
            inverse[column, j] *= scale
        for i in range(size):
            factor = a[i, column]
            if i != column and factor != 0.0:
                for j in range(size):
                    a[i, j] -= factor * a[column, j]
                    inverse[i, j] -= factor * inverse[column, j]


def double(a: NDArray, g: NDArray, h: NDArray, work: NDArray) -> None:
    """Bring h to X = A^T X (I + G X)^-1 A + H, the discrete Riccati equation; a and g are used up.

    work: (4, n, n). Structure-preserving doubling: Chu, Fan, Lin and Wang, Int. J. Control 77 (2004) 767–788. Raises:
    ValueError where it does not converge, as (A, B) cannot be stabilized.
    """
    size = a.shape[0]
    for _ in range(MOST_DOUBLINGS):  # each squares what is left
        multiply(g, h, work[0])
        for i in range(size):
            work[0, i, i] += 1.0
        invert(work[0], work[1])
        multiply(a, work[1], work[0])  # A W^-1
        multiply(work[0], g, work[2])
        multiply(work[1], a, work[3])  # W^-1 A
        add_product_transposed(work[2], a, g)
        multiply(h, work[3], work[1])
        multiply_transposed(a, work[1], work[2])
        change, largest = 0.0, 0.0
        for i in range(size):
            for j in range(size):
                h[i, j] += work[2, i, j]
                change, largest = max(change, abs(work[2, i, j])), max(largest, abs(h[i, j]))
        multiply(work[0], a, work[2])
        for i in range(size):
            for j in range(size):
                a[i, j] = work[2, i, j]
                if not abs(h[i, j]) < 1e100:
                    raise ValueError("the Riccati equation has no solution: what the inputs do not reach is unstable")
        if change <= 1e-15 * largest:
            return
    raise ValueError("the Riccati equation has no solution to which doubling converges")


def cayley(a: NDArray, g: NDArray, h: NDArray, work: NDArray) -> None:
    """Bring A^T X + X A - X G X + H = 0, the continuous equation, to the discrete one with the same X."""
    size, norm_a, norm_g, norm_h = a.shape[0], 0.0, 0.0, 0.0
    for i in range(size):
        row_a, row_g, row_h = 0.0, 0.0, 0.0
        for j in range(size):
            row_a, row_g, row_h = row_a + abs(a[i, j]), row_g + abs(g[i, j]), row_h + abs(h[i, j])
        norm_a, norm_g, norm_h = max(norm_a, row_a), max(norm_g, row_g), max(norm_h, row_h)
    gamma = 1.1 * (norm_a + (norm_g * norm_h) ** 0.5) + 1e-9
    for i in range(size):
        a[i, i] -= gamma
    for i in range(size):
        for j in range(size):
            work[0, i, j] = a[i, j]
    invert(work[0], work[1])  # (A - gamma)^-1
    multiply(h, work[1], work[2])
    multiply(work[2], g, work[0])
    for i in range(size):
        for j in range(size):
            work[0, i, j] += a[j, i]
    invert(work[0], work[3])  # W^-1, W = (A - gamma)^T + H (A - gamma)^-1 G
    for i in range(size):
        for j in range(size):
            a[i, j] = 2.0 * gamma * work[3, j, i] + (1.0 if i == j else 0.0)
    multiply(work[3], work[2], h)
    multiply(work[1], g, work[0])
    multiply(work[0], work[3], g)
    for i in range(size):
        for j in range(size):
            h[i, j] *= 2.0 * gamma
            g[i, j] *= 2.0 * gamma
