"""Settings of a training run of the distance network."""

from dataclasses import dataclass

from experiments.train_restore.config import OptimizerConfig, TrainConfig
from rein3d_jax.depth.network.augment import DepthAugmentConfig
from rein3d_jax.depth.network.config import COARSEST, DepthNetworkConfig
from rein3d_jax.depth.network.loss import DepthLossConfig
from rein3d_jax.errors import InputError
from rein3d_jax.rooms.config import RoomConfig
from rein3d_jax.settings import Settings, setting


@dataclass(frozen=True)
class DepthDataConfig(Settings):
    """Panoramas that are trained on: drawn rooms, made as they are needed, and rendered ones from a folder."""

    height: int = setting(128, "rows, a multiple of 32", within="[32, inf)")
    rendered: str = setting("", "folder that experiments.render_rooms wrote; none: drawn rooms alone")
    share: float = setting(0.5, "of a batch that is rendered", within="[0, 1]")
    held_out: int = setting(10, "every so many rendered rooms, the first is never trained on", within="[2, inf)")
    drawn_held_out: int = setting(16, "drawn rooms of the evaluation", within="[0, inf)")
    below: float = setting(0.7, "the eye's height, at most, of a drawn room's camera", within="[0, inf)", unit="metres")
    above: float = setting(0.4, "the eye's height, at most, of a drawn room's camera", within="[0, inf)", unit="metres")
    jpeg: float = setting(0.3, "share that is compressed, at a quality of 30 to 95", within="[0, 1]")
    rooms: RoomConfig = RoomConfig()

    def __post_init__(self):
        super().__post_init__()
        if self.height % COARSEST:
            raise InputError(f"height must be a multiple of {COARSEST}, not {self.height}")
        if not self.rendered and not self.drawn_held_out:
            raise InputError("drawn_held_out must be at least 1 where there is no folder of rendered rooms")


@dataclass(frozen=True)
class DepthTrainConfig(TrainConfig):
    """A training run of the distance network."""

    model: str = setting("depth", "which network is trained", among=("depth",))
    output: str = setting("runs/depth", "folder of the run")
    batch: int = setting(8, "panoramas a step, over all devices", within="[1, inf)")
    backbone: str = setting("", "folder of the pretrained backbone (benchmarks/convert/backbone.py); none: random")
    weights: str = setting("", "folder of a trained network to go on from, in place of `backbone`")
    backbone_rate: float = setting(0.1, "the backbone's learning rate over the others'", within="[0, 1]")
    frozen: int = setting(2, "the backbone's first stages that stay as they are", within="[0, 7]")
    network: DepthNetworkConfig = DepthNetworkConfig()
    loss: DepthLossConfig = DepthLossConfig()
    augment: DepthAugmentConfig = DepthAugmentConfig()
    data: DepthDataConfig = DepthDataConfig()
    optimizer: OptimizerConfig = OptimizerConfig(warmup=100, second_momentum=0.99)
