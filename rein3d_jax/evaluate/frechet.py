"""Frechet distance of two sets of features, each taken as a Gaussian (Heusel et al. 2017, FID; Unterthiner et al. 2019,
FVD). NumPy in float64, since small eigenvalues of large covariances decide it; called once for a whole data set."""

import numpy as np


def feature_statistics(features: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean (d,) and unbiased covariance (d, d), float64, of `features` (n, d), n >= 2."""
    features = np.asarray(features, np.float64)
    assert features.ndim == 2 and len(features) >= 2, f"{features.shape}: at least two feature vectors are needed"
    return features.mean(axis=0), np.atleast_2d(np.cov(features, rowvar=False))


def frechet_distance(mean1: np.ndarray, cov1: np.ndarray, mean2: np.ndarray, cov2: np.ndarray) -> float:
    """Distance |m1 - m2|^2 + tr(C1 + C2 - 2 (C1 C2)^(1/2)) >= 0; means (d,), covariances (d, d), singular or not.

    With C = A A^T by eigendecomposition the last trace is the sum of the singular values of A1^T A2: no root of a
    product that rounding has made asymmetric. Fewer samples than d bias the distance upwards: compare only distances of
    equally many clips.
    """
    roots = _root(cov1).T @ _root(cov2)
    both = np.trace(cov1) + np.trace(cov2) - 2 * np.linalg.svd(roots, compute_uv=False).sum()
    difference = np.asarray(mean1, np.float64) - mean2
    return max(float(difference @ difference + both), 0.0)


def _root(covariance: np.ndarray) -> np.ndarray:
    """(d, d) A with A A^T = C; eigenvalues that rounding made negative are 0."""
    values, vectors = np.linalg.eigh(np.asarray(covariance, np.float64))
    return vectors * np.sqrt(np.maximum(values, 0.0))
