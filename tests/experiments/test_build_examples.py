"""An example is a function of the seed and its number, and begins where its panorama was taken."""

import jax
import numpy as np

from experiments.build_examples import ExamplesConfig, example

CONFIG = ExamplesConfig(height=32, frames=2)


def test_the_same_number_gives_the_same_example_which_begins_at_its_anchor():
    made = example(0, CONFIG)
    jax.tree.map(np.testing.assert_array_equal, made, example(0, CONFIG))
    clip, rows = made.clip, CONFIG.height // 2
    assert clip.alpha.shape == (CONFIG.frames, rows, 2 * rows)
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(made))
    length = np.linalg.norm(clip.position, axis=-1)
    assert length[0] == 0 and CONFIG.shortest / 2 <= length[-1] <= CONFIG.longest
    print(clip.alpha[0].mean(), clip.alpha[0].min(), clip.alpha[1].mean(), (clip.alpha[1]<.5).mean())
    known = clip.alpha > 0.9
    print(np.abs(clip.rgb - made.clean_rgb)[known].mean(), np.median(np.abs(clip.rgb - made.clean_rgb)[known]), np.abs(np.roll(clip.rgb,5,2) - made.clean_rgb)[known].mean())
    ratio = np.abs(np.log(clip.distance / made.clean_distance))[known & (made.clean_distance > 0)]
    print(np.median(ratio), ratio.mean())
    print(known.mean())
