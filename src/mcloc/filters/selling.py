"""C = Σ_i λ_i e_i e_iᵀ, λ_i ≥ 0, e_i whole numbers: Selling's decomposition of a covariance in the
plane [Selling 1874; Fehrenbach, Mirebeau: JMIV 49, 2014].
"""

import numpy as np
from numpy.typing import NDArray

Reals = NDArray[np.float64]

_OTHERS = (1, 2), (2, 0), (0, 1)
_MOST_TURNS = 200  # for eigenvalues of 1 : 256 some 10


def selling(c: Reals) -> tuple[Reals, NDArray[np.intp]]:
    """λ (K, 3) and e (K, 3, 2) of matrices (K, 2, 2) that are positive definite, or 0.

    A superbase v₀ + v₁ + v₂ = 0 is made obtuse, v_iᵀ C v_j ≤ 0: then λ_k = −v_iᵀ C v_j of the other
    two, and e_k is v_k, turned by a right angle.
    """
    base = np.tile([[1.0, 0.0], [0.0, 1.0], [-1.0, -1.0]], (len(c), 1, 1))
    for _ in range(_MOST_TURNS):
        products = np.einsum("nia,nab,njb->nij", base, c, base)
        of_others = np.stack([products[:, i, j] for i, j in _OTHERS], axis=1)
        worst = of_others.argmax(axis=1)
        acute = of_others.max(axis=1) > 1e-12 * np.einsum("naa->n", c)
        if not acute.any():
            break
        for k, (i, j) in enumerate(_OTHERS):
            turned = acute & (worst == k)
            base[turned, k] = base[turned, i] - base[turned, j]
            base[turned, i] *= -1.0
    e = np.stack([-base[:, :, 1], base[:, :, 0]], axis=-1)
    return np.maximum(-of_others, 0.0), np.rint(e).astype(np.intp)
