"""Euler and UniPC (Zhao et al. 2023; bh2, order 2, predicting x0) as one table of coefficients, made in float64.

Both are linear in what a step has at hand, so that the sampler is one scan over rows. With a = 1 - s, lambda =
ln(a / s), h = lambda_t - lambda_s, e = expm1(-h), m = the predicted x0:

    predict  x_t = (s_t / s_s) x - a_t e (m_0 + rho (m_-1 - m_0) / r),     r = (lambda_-1 - lambda_s) / h
    correct  x_s = the same from the step before, with the x0 predicted at its own end added to the differences
"""

from typing import NamedTuple

import numpy as np

from rein3d_jax.restore.wan.schedule import timesteps_of


class Solver(NamedTuple):
    """Coefficients, one row a step, in float64; the sampler rounds to its own precision."""

    sigma: np.ndarray  # (n,)
    timestep: np.ndarray  # (n,)
    correct: np.ndarray  # (n, 5) of x, the x before, and x0 predicted now, a step and two steps before
    predict: np.ndarray  # (n, 3) of the corrected x, and x0 predicted now and a step before


def euler(sigmas: np.ndarray) -> Solver:
    """Coefficients of x' = x + (s' - s) v = (s' / s) x + (1 - s' / s) x0."""
    ratio = sigmas[1:] / sigmas[:-1]
    correct = np.tile([1.0, 0, 0, 0, 0], (len(ratio), 1))
    return Solver(sigmas[:-1], timesteps_of(sigmas), correct, np.stack([ratio, 1 - ratio, 0 * ratio], axis=1))


def unipc(sigmas: np.ndarray) -> Solver:
    """Coefficients of UniPC: order 1 in the first step and the last, order 2 between; each step but the first corrects
    the one before."""
    timesteps, count = timesteps_of(sigmas), len(sigmas) - 1
    # The reference rounds its sigmas, and the first, 1 - 1e-6, is 3 % of lambda's argument off in it.
    sigmas = sigmas.astype(np.float32).astype(np.float64)
    orders = [1 if step in (0, count - 1) else 2 for step in range(count)]
    predict = [_predict(sigmas, step, orders[step]) for step in range(count)]
    correct = [[1.0, 0, 0, 0, 0], *(_correct(sigmas, step, orders[step - 1]) for step in range(1, count))]
    return Solver(sigmas[:-1], timesteps, np.array(correct), np.array(predict))


SOLVERS = {"unipc": unipc, "euler": euler}


def _lambda(sigma):
    with np.errstate(divide="ignore"):  # the last sigma is 0: h is infinite there, and e is -1
        return np.log1p(-sigma) - np.log(sigma)


def _step(sigmas, start):
    """lambda's step h from `start` to the next, and the gain -a_t expm1(-h) of x0 in it."""
    h = _lambda(sigmas[start + 1]) - _lambda(sigmas[start])
    return h, -(1 - sigmas[start + 1]) * np.expm1(-h)


def _before(sigmas, start, h):
    """r, where the step before `start` began, in units of h (negative)."""
    return (_lambda(sigmas[start - 1]) - _lambda(sigmas[start])) / h


def _predict(sigmas, step, order):
    h, gain = _step(sigmas, step)
    past = 0.5 / _before(sigmas, step, h) if order == 2 else 0.0
    return [sigmas[step + 1] / sigmas[step], gain * (1 - past), gain * past]


def _correct(sigmas, step, order):
    h, gain = _step(sigmas, step - 1)
    past, now = 0.0, 0.5
    if order == 2:
        e, r = np.expm1(-h), _before(sigmas, step - 1, h)
        k = e / -h - 1
        past, now = np.linalg.solve([[1, 1], [r, 1]], [k / e, (k / -h - 0.5) * 2 / e])
        past /= r
    return [0.0, sigmas[step] / sigmas[step - 1], gain * now, gain * (1 - now - past), gain * past]
