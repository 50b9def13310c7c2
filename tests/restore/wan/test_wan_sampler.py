"""Flow matching and its solvers: exact where theory says exact, of the order they claim, blind to yaws."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.restore.wan.sampler import guided, sample_latents
from rein3d_jax.restore.wan.schedule import clean_of, noised, sampling_sigmas, timesteps_of, velocity_of
from rein3d_jax.restore.wan.solver import SOLVERS, euler, unipc

KEY = jax.random.key(0)
NOISE = jax.random.normal(KEY, (2, 4, 6, 3))
CLEAN = jax.random.uniform(jax.random.key(1), NOISE.shape)
SPREAD = 0.5  # of normal data, whose flow is known


def gaussian_velocity(x, _, timestep):
    """E[noise - x0 | x_s = x] for x0 ~ N(0, SPREAD^2)."""
    s = timestep / 1000
    return x * (s - (1 - s) * SPREAD**2) / (s**2 + (1 - s) ** 2 * SPREAD**2)


def error(solver, steps):
    """Of the ODE's solution over s = 0.9 ... 0.1, where x / sqrt(s^2 + (1-s)^2 SPREAD^2) stays as it is."""
    sigmas = np.linspace(0.9, 0.1, steps + 1)
    scale = np.sqrt(sigmas**2 + (1 - sigmas) ** 2 * SPREAD**2)
    with jax.enable_x64(True):
        rows = solver(sigmas)._replace(timestep=1000 * sigmas[:-1])  # not cut to whole numbers: the ODE itself
        end = sample_latents(KEY, gaussian_velocity, jnp.ones((1, 1, 1), jnp.float64), None, rows)
    return abs(float(end[0, 0, 0]) - scale[-1] / scale[0])


def test_the_schedule_is_the_published_one():
    np.testing.assert_array_equal(timesteps_of(sampling_sigmas(4, 3.0)), [999, 900, 750, 500])
    sigmas = sampling_sigmas(7, 5.0)
    assert (np.diff(sigmas) < 0).all() and sigmas[-1] == 0 and 1 - sigmas[0] == pytest.approx(1e-6)


def test_noise_velocity_and_clean_fit_together():
    x = noised(CLEAN, NOISE, 0.3)
    np.testing.assert_allclose(clean_of(x, velocity_of(CLEAN, NOISE), 0.3), CLEAN, atol=1e-6)  # float32
    np.testing.assert_array_equal(noised(CLEAN, NOISE, 1.0), NOISE)


@pytest.mark.parametrize("solver", SOLVERS.values())
@pytest.mark.parametrize("steps", [1, 2, 3, 10])
def test_straight_paths_are_followed_exactly(solver, steps):
    """The velocity of one clip and one noise is constant, so any number of steps ends at the clip."""
    drawn = sample_latents(
        KEY, lambda x, *_: velocity_of(CLEAN, NOISE), NOISE, None, solver(sampling_sigmas(steps, 3.0))
    )
    np.testing.assert_allclose(drawn, CLEAN, atol=1e-5)  # float32; the first sigma is 1e-6 short of 1


@pytest.mark.parametrize(("solver", "order"), [(euler, 1), (unipc, 2)])
def test_halving_the_step_divides_the_error_as_the_order_says(solver, order):
    coarse, fine = error(solver, 40), error(solver, 80)
    assert 0.8 * 2**order < coarse / fine < 1.25 * 2 ** (order + 1)  # its corrector may lift UniPC by one


def test_four_steps_of_unipc_are_nearer_than_four_of_euler():
    """What few-step sampling lives on, where steps are too large for the orders to show."""
    assert error(unipc, 4) < 0.8 * error(euler, 4)  # 0.63 when written


def test_a_known_x0_is_a_fixed_point_of_every_row():
    """Coefficients of x and of x0 move x0 onto itself: (s'/s) s + ... = s' for what is left of the noise."""
    for solver in SOLVERS.values():
        rows, sigmas = solver(sampling_sigmas(10, 3.0)), sampling_sigmas(10, 3.0)
        clean_weight = rows.predict[:, 1:].sum(axis=1)
        np.testing.assert_allclose(rows.predict[:, 0] * (1 - sigmas[:-1]) + clean_weight, 1 - sigmas[1:], atol=1e-6)


def test_it_is_what_diffusers_samples(golden_unipc):
    def velocity(x, _, timestep):
        return jnp.sin(2 * x) + timestep / 1000 * x

    solver = unipc(sampling_sigmas(10, 3.0))
    np.testing.assert_array_equal(solver.timestep, golden_unipc["timesteps"])
    drawn = sample_latents(KEY, velocity, jnp.asarray(golden_unipc["noise"]), None, solver)
    np.testing.assert_allclose(drawn, golden_unipc["sample"], atol=1e-5)  # float32; 1e-6 in float64 (parity test)


def test_random_yaws_move_the_seam_for_the_network_and_leave_the_panorama_where_it_was():
    columns = jnp.arange(6.0)[:, None]

    def pointwise(x, control, timestep):
        return x * control + timestep / 1000

    def with_a_seam(x, control, timestep):
        return pointwise(x, control, timestep) + columns

    solver = unipc(sampling_sigmas(6, 3.0))
    control = jnp.broadcast_to(columns, NOISE.shape) / 6
    for velocity, blind in ((pointwise, True), (with_a_seam, False)):
        still, rolled = (
            sample_latents(jax.random.key(4), velocity, NOISE, control, solver, yaw_step=by) for by in (0, 2)
        )
        assert np.allclose(still, rolled, atol=1e-5) == blind


def test_guidance_goes_on_from_what_is_said_without_text():
    def one(x, control, timestep):
        return jnp.ones_like(x)

    def three(x, control, timestep):
        return 3 * jnp.ones_like(x)

    assert guided(three, one, 1.0) is three
    np.testing.assert_array_equal(guided(three, one, 0.0)(NOISE, None, 0.0), 1)
    np.testing.assert_array_equal(guided(three, one, 5.0)(NOISE, None, 0.0), 11)
