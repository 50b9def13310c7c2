"""What the full-size restorer will take in a job, before it begins: operations, and seconds by class of device."""

import jax

from experiments.reconstruct.config import ReconstructConfig
from rein3d_jax.restore.restorer import DIFFUSION
from rein3d_jax.restore.wan.cost import ClipCost, clip_cost, seconds_by_device
from rein3d_jax.restore.wan.training.memory import GIB, Workload, forecast
from rein3d_jax.restore.wan.windows import padded_length

_CLASSES = {"TPU v5 lite": "TPU v5e", "TPU v5": "TPU v5p"}  # as JAX names devices -> as their makers do


def told_cost(config: ReconstructConfig) -> str:
    """The line that is printed: of all paths, each as long as explore.max_frames allows. "" for other restorers."""
    if config.restore.method != DIFFUSION:
        return ""
    paths, sample = config.explore.trajectories, config.restore.diffusion.sample
    cost = path_cost(config, config.explore.max_frames)
    each = ", ".join(f"{name} {_short(paths * number)} s" for name, number in seconds_by_device(cost).items())
    memory = _network_bytes(config) / GIB
    guidance = "without guidance" if sample.guidance == 1 else f"guidance {sample.guidance:g}"
    clips = f"{paths} x {config.explore.max_frames} frames at most"
    taken = f"{sample.steps} steps {guidance}, {cost.passes} passes a path, {_short(paths * cost.total / 1e12)} TFLOP"
    return f"the diffusion restorer: {clips}, {taken}, {memory:.1f} GiB of a device's memory: on one {each}"


def _short(number: float) -> str:
    return f"{number:,.0f}" if number >= 100 else f"{number:.3g}"


def _window(config: ReconstructConfig) -> Workload:
    """The longest clip that is restored at once."""
    frames = min(config.restore.diffusion.sample.windows.frames, padded_length(config.explore.max_frames))
    return Workload(frames, config.restore.height, 2 * config.restore.height)


def _network_bytes(config: ReconstructConfig) -> int:
    return forecast(config.restore.diffusion.network, _window(config)).total


def restore_bytes(config: ReconstructConfig) -> int:
    """Bytes of the machine's memory that the network takes; 0 for other restorers, and on accelerators, which have
    their own."""
    on_cpu = jax.devices()[0].platform == "cpu"
    return _network_bytes(config) if on_cpu and config.restore.method == DIFFUSION else 0


def path_cost(config: ReconstructConfig, frames: int) -> ClipCost:
    """Of one path of so many frames."""
    return clip_cost(config.restore.diffusion, frames, config.restore.height, 2 * config.restore.height)


def restore_seconds(config: ReconstructConfig, frames: float) -> float:
    """Seconds that the network takes for all paths of so many frames, on this machine's first device; 0 for other
    restorers. An accelerator that is not known counts as the slowest that is."""
    if config.restore.method != DIFFUSION:
        return 0.0
    paths, by_class = config.explore.trajectories, seconds_by_device(path_cost(config, round(frames)))
    device = jax.devices()[0]
    if device.platform == "cpu":
        return paths * by_class["CPU core"]
    kind = _CLASSES.get(device.device_kind, device.device_kind)
    known = [seconds for name, seconds in by_class.items() if name in kind]
    return paths * (known[0] if known else max(x for name, x in by_class.items() if name != "CPU core"))
