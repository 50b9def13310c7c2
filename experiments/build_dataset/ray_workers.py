"""A dataset's shards over the machines of a Ray cluster, or over processes of this one."""

from types import ModuleType

from experiments.build_dataset.dataset import DatasetConfig, build_part
from experiments.compile_cache import use_compile_cache
from rein3d_jax.errors import InputError

_RETRIES = 2  # of a task whose process was killed


def build_with_ray(config: DatasetConfig, workers: int, address: str | None = None) -> None:
    """Builds with `workers` Ray tasks of one core each: on the cluster at `address`, or on one started here for the
    purpose. A task whose process is killed is begun again, where it stopped. The output must be a folder that all
    machines share. Raises InputError as build_part does, and where a task was killed too often."""
    ray = _ray()
    cores = {} if address else {"num_cpus": workers}
    ray.init(address=address or "local", include_dashboard=False, log_to_driver=False, **cores)
    try:
        part = ray.remote(num_cpus=1, max_retries=_RETRIES)(_part)
        for said in ray.get([part.remote(config, worker, workers) for worker in range(workers)]):
            print("\n".join(said), flush=True)
    except ray.exceptions.RayTaskError as error:
        if isinstance(error.cause, InputError):
            raise error.cause from None
        raise
    except (ray.exceptions.WorkerCrashedError, ray.exceptions.OutOfMemoryError) as error:
        raise InputError(
            f"a Ray worker was killed {_RETRIES + 1} times, for want of memory perhaps: run the same command again, "
            "with fewer workers a machine"
        ) from error
    finally:
        ray.shutdown()


def _part(config: DatasetConfig, worker: int, workers: int) -> list[str]:
    use_compile_cache()
    said: list[str] = []
    build_part(config, worker, workers, lambda line: said.append(f"worker {worker}: {line}"))
    return said


def _ray() -> ModuleType:
    try:
        import ray
    except ImportError as error:
        raise InputError("--ray needs the package ray: pip install 'rein3d-jax[ray]'") from error
    return ray
