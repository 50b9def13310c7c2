"""gsplat's torch reference with tile lists in plain torch instead of its loop in Python."""

from functools import partial

from benchmarks.engines import gsplat_torch as engine_gsplat

build = partial(engine_gsplat.build, own_lists=False)
