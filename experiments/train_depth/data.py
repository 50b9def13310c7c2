"""Batches of augmented panoramas: a function of the seed and the step, so that a resumed run gets the same ones."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from experiments.train_depth.config import DepthTrainConfig
from experiments.train_depth.drawn import drawn_examples
from experiments.train_depth.rendered import RenderedRooms
from rein3d_jax.depth.network.augment import DepthAugmentConfig, augment_depth
from rein3d_jax.depth.network.loss import DepthExample
from rein3d_jax.io.pictures.jpeg import through_jpeg

_HELD_OUT = 2**20  # keys of drawn rooms that no step reaches


class DepthData:
    """Drawn rooms, and rendered ones where there is a folder of them."""

    def __init__(self, config: DepthTrainConfig):
        self.config, data = config, config.data
        self.rendered = RenderedRooms(data.rendered, data.height, data.held_out) if data.rendered else None

    def batch(self, step: int, *, host: int = 0, hosts: int = 1) -> DepthExample:
        """This host's share of step `step`'s examples (accumulate, n, h, 2 h), NumPy. Rendered rooms that are still
        coming are drawn from as far as they go, and only a finished folder gives the same batches again."""
        config, random = self.config, np.random.default_rng((self.config.seed, step))
        seeds = random.integers(0, 2**32, (config.batch, 2, 2), np.uint32)
        many = round(config.data.share * config.batch) if self.rendered else 0
        chosen = random.integers(0, len(self.rendered.trained), many) if many else []
        quality = np.where(random.random(config.batch) < config.data.jpeg, random.integers(30, 96, config.batch), 0)
        keys = jax.vmap(jax.random.wrap_key_data)(seeds)
        drawn = jax.device_get(drawn_examples(keys[many:, 0], config.data)) if many < config.batch else None
        examples = _joined([as_floats(self.rendered.trained[index]) for index in chosen], drawn)
        examples = jax.device_get(_augmented(keys[:, 1], examples, config.augment))
        rgb = np.stack([through_jpeg(x, int(q)) if q else x for x, q in zip(examples.rgb, quality, strict=True)])
        share = slice(host * config.batch // hosts, (host + 1) * config.batch // hosts)
        parts = (config.accumulate, -1)
        return jax.tree.map(lambda x: x[share].reshape(*parts, *x.shape[1:]), examples.replace(rgb=rgb))

    def drawn_held_out(self) -> list[DepthExample]:
        """Examples of drawn rooms that are never trained on."""
        count = self.config.data.drawn_held_out
        if not count:
            return []
        keys = jax.random.split(jax.random.key(_HELD_OUT + self.config.seed), count)
        drawn = jax.device_get(drawn_examples(keys, self.config.data))
        return [jax.tree.map(lambda x, i=i: x[i], drawn) for i in range(count)]


def as_floats(example: DepthExample) -> DepthExample:
    """A stored example as float32."""
    distance, background = (np.asarray(x, np.float32) for x in (example.distance, example.background))
    return DepthExample(np.float32(example.rgb) / 255, distance, background)


def _joined(several: list[DepthExample], drawn: DepthExample | None) -> DepthExample:
    first = [jax.tree.map(lambda *x: np.stack(x), *several)] if several else []
    return jax.tree.map(lambda *x: np.concatenate(x), *first, *([drawn] if drawn is not None else []))


@partial(jax.jit, static_argnames="config")
def _augmented(keys: jax.Array, examples: DepthExample, config: DepthAugmentConfig) -> DepthExample:
    pairs = (keys, jax.tree.map(jnp.asarray, examples))
    return jax.lax.map(lambda pair: augment_depth(*pair, config), pairs)
