"""Attention in windows is plain attention between the pixels of each window."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.upsample.window_attention import Window, window_attention

HEIGHT, WIDTH = 8, 8
WINDOW = Window(2, 4, 2)


def drawn(seed):
    keys = jax.random.split(jax.random.key(seed))
    return jax.random.normal(keys[0], (HEIGHT, WIDTH, 3, 6)), jax.random.normal(keys[1], (2, 3, 7))


def one_by_one(parts, near, shifted):
    """Pixel by pixel: who shares its window, columns wrapping, rows not."""
    down, right = (1, 2) if shifted else (0, 0)
    query, key, value = (np.asarray(parts[:, :, i], np.float64).reshape(HEIGHT, WIDTH, 2, 3) for i in range(3))
    out = np.zeros((HEIGHT, WIDTH, 2, 3))
    window = lambda r, c: ((r - down) // 2, ((c - right) % WIDTH) // 4)  # noqa: E731
    place = lambda r, c: ((r - down) % 2, ((c - right) % WIDTH) % 4)  # noqa: E731
    pixels = [(r, c) for r in range(HEIGHT) for c in range(WIDTH)]
    for r, c in pixels:
        mates = [at for at in pixels if window(*at) == window(r, c)]
        for head in range(2):
            scores = []
            for mate in mates:
                apart = np.add(np.subtract(place(r, c), place(*mate)), (1, 3))
                scores.append(query[r, c, head] @ key[*mate, head] / 3**0.5 + float(near[head, *apart]))
            weights = np.exp(np.array(scores) - max(scores))
            out[r, c, head] = sum(w * value[*m, head] for w, m in zip(weights / weights.sum(), mates, strict=True))
    return out.reshape(HEIGHT, WIDTH, 6)


@pytest.mark.parametrize("shifted", [False, True])
def test_it_is_attention_between_those_who_share_a_window(shifted):
    parts, near = drawn(0)
    found = jax.jit(window_attention, static_argnums=3)(parts, near, jnp.array(shifted), WINDOW)
    np.testing.assert_allclose(found, one_by_one(parts, near, shifted), atol=1e-5)  # float32, 8 keys
