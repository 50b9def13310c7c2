"""Batches of pairs for training, from a dataset's folder or made on the device. Either way a batch is a function of
the seed and the step, so that a resumed run sees what it would have; hosts take different pairs of the same step."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.io.pairs.pair_shard import PairDataset
from rein3d_jax.pipeline.pairs import Drawn, PairConfig, grown, room_pair, with_buffers
from rein3d_jax.scene import Pair


class StoredPairs:
    """Pairs of a dataset, shuffled anew each time round (Grain)."""

    def __init__(self, folder: str, *, batch: int, seed: int = 0, host: int = 0, hosts: int = 1):
        """`batch` pairs a step for this host of `hosts`. Raises InputError where the folder holds no dataset, or fewer
        pairs than hosts take in a step."""
        try:
            import grain
        except ImportError as error:
            raise InputError("datasets need the package grain: pip install 'rein3d-jax[data]'") from error
        pairs = PairDataset(folder)
        if len(pairs) < batch * hosts:
            raise InputError(f"{folder} holds {len(pairs)} pairs, and a step takes {batch * hosts}: build more of them")
        shuffled = grain.MapDataset.source(pairs).seed(seed).shuffle().repeat()
        self._batches = shuffled[host::hosts].batch(batch, batch_fn=_together)

    def at(self, step: int) -> Pair:
        """The pairs (b, t, ...) of a step."""
        return self._batches[step]


def _together(pairs: list[Pair]) -> Pair:
    return jax.tree.map(lambda *leaves: np.stack(leaves), *pairs)


class DrawnPairs:
    """Pairs of rooms drawn and traced on the device while training: no disk, and none twice."""

    def __init__(self, config: PairConfig, *, batch: int, seed: int = 0, host: int = 0, hosts: int = 1):
        self.config, self.batch, self.host, self.hosts = with_buffers(config), batch, host, hosts
        self.key = jax.random.key(seed)

    def at(self, step: int) -> Pair:
        """The pairs (b, t, ...) of a step. Raises InputError where no room has a path of the config's length."""
        first = (step * self.hosts + self.host) * self.batch
        keys = jax.vmap(lambda index: jax.random.fold_in(self.key, index))(first + jnp.arange(self.batch))
        config = self.config
        while True:
            drawn = _batch(keys, config)
            if float(drawn.length.min()) < config.length:
                raise InputError(
                    f"no room has a straight path of {config.length:g} m: lower pairs.frames or pairs.speed"
                )
            if (more := grown(config, drawn.needed.max(axis=0))) is None:
                return drawn.pair
            config = more


@partial(jax.jit, static_argnames="config")
def _batch(keys: jax.Array, config: PairConfig) -> Drawn:
    return jax.vmap(lambda key: room_pair(key, config))(keys)
