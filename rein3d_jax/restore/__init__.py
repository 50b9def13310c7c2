"""Degraded RGB-alpha video -> clean video. A restorer is `(Video, key) -> Video`; `restorer(config)` names one.

Every restorer returns what was observed (alpha near 1) as it was, and colour AND distance for the rest, with alpha
still saying what was observed: a restored pixel is a guess, and its user may weigh it as one.
"""

from rein3d_jax.restore.background import Background, background_of
from rein3d_jax.restore.restorer import RestoreConfig, Restorer, TrainedNetwork, restorer

__all__ = ["Background", "RestoreConfig", "Restorer", "TrainedNetwork", "background_of", "restorer"]
