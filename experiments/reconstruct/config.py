"""Everything that decides what the main job makes."""

from dataclasses import dataclass
from pathlib import Path

from experiments.reconstruct.budget import BudgetConfig
from experiments.reconstruct.flythrough import FilmConfig
from experiments.reconstruct.inputs import InputConfig
from rein3d_jax.networks.depth import SHIPPED_DEPTH
from rein3d_jax.pipeline.stages import Stages
from rein3d_jax.settings import setting


@dataclass(frozen=True)
class ReconstructConfig(Stages):
    """The whole job: its input, one config for each stage, where it writes, and its seed."""

    output: str = setting("runs/room", "folder that it writes")
    seed: int = setting(0, "of everything random", within="[0, 4294967295]")
    input: InputConfig = InputConfig()
    film: FilmConfig = FilmConfig()
    budget: BudgetConfig = BudgetConfig()

    @property
    def asks_network(self) -> bool:
        """Whether the distance is the depth network's to say."""
        return self.input.distance is None and self.depth.method == "network"

    @property
    def depth_weights(self) -> Path:
        """Folder of the depth network: the one that is named, or the packaged one."""
        return Path(self.depth.weights or SHIPPED_DEPTH)
