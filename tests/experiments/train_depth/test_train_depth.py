"""Training the distance network, in small: batches by the step alone, runs that go on to the same bytes, weights that
are read back."""

import dataclasses
import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from experiments.config import config_from, read_recipe
from experiments.render_rooms.floorplan import Floorplan
from experiments.render_rooms.shell import floorplan_distance
from experiments.train_depth import train
from experiments.train_depth.__main__ import main
from experiments.train_depth.config import DepthDataConfig, DepthTrainConfig
from experiments.train_depth.data import DepthData
from experiments.train_depth.drawn import drawn_examples
from experiments.train_depth.rendered import RenderedRooms, room_examples
from experiments.train_depth.train import start_parameters, train_depth
from experiments.train_restore.run import TrainingRun
from rein3d_jax.depth.network.network import estimate_depth
from rein3d_jax.errors import InputError
from rein3d_jax.geometry.sphere import latitudes, rays_of_pose64, world_from_camera_axes
from rein3d_jax.io.pictures.image import write_rgb
from rein3d_jax.networks.depth import depth_shapes, read_depth_backbone, read_depth_network, write_depth_network

ROWS = 32
CORNERS = [[-2.0, -1.5], [2.0, -1.5], [2.0, 1.5], [-2.0, 1.5]]
CEILING = [[0.0, 0.0, 2.5]]
HEIGHT = 1.25  # metres, of the camera


def write_room(folder, seed):
    """An empty box in the layout of experiments.render_rooms."""
    rng = np.random.default_rng(seed)
    place = np.array([*rng.uniform(-0.5, 0.5, 2), HEIGHT])
    pose = np.eye(4)
    pose[:3, 3] = place
    panorama = {"name": "000", "height": ROWS, "camera_height": HEIGHT, "room_from_panorama": pose.tolist()}
    axes = np.eye(4)
    axes[:3, :3] = world_from_camera_axes()
    plan = Floorplan(np.array(CORNERS), np.array(CEILING))
    distance = floorplan_distance(plan, place, rays_of_pose64(axes, ROWS)).astype(np.float32)
    room = folder / f"room_{seed:06}"
    room.mkdir(parents=True)
    np.savez(room / "000.npz", distance=distance, linear=np.zeros((ROWS, 2 * ROWS, 3), np.float16))
    write_rgb(room / "000.png", np.repeat(distance[..., None] / 4, 3, -1).clip(0, 1))
    described = {"panoramas": [panorama], "corners": CORNERS, "ceiling": CEILING}
    (room / "room.json").write_text(json.dumps(described))
    return room, distance


@pytest.fixture(scope="module")
def rooms(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rooms")
    for seed in range(4):
        write_room(folder, seed)
    return folder


def config_of(rooms, output, **changes) -> DepthTrainConfig:
    config = config_from(DepthTrainConfig, read_recipe("tiny_depth"))
    data = dataclasses.replace(config.data, rendered=str(rooms), share=1.0, held_out=2, drawn_held_out=0)
    network = dataclasses.replace(config.network, looks=1)  # each takes seconds to compile
    return dataclasses.replace(config, output=str(output), data=data, network=network, **changes)


@pytest.fixture(scope="module")
def weights(rooms, tmp_path_factory):
    """A folder of parameters to begin with: an untrained network's own are 800 programs to compile."""
    folder, rng = tmp_path_factory.mktemp("weights"), np.random.default_rng(0)
    shapes = depth_shapes(config_of(rooms, folder).network)
    write_depth_network(folder, jax.tree.map(lambda leaf: 0.1 * rng.normal(size=leaf.shape), shapes))
    return str(folder)


@pytest.fixture(scope="module")
def one_step():
    """The runs here differ in their folders alone: all of them take the step that the first one compiles."""
    compiled, data_parallel = [], train.data_parallel

    def kept(*arguments, **options):
        compiled.extend([] if compiled else [data_parallel(*arguments, **options)])
        return compiled[0]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(train, "data_parallel", kept)
        yield


@pytest.fixture(scope="module")
def unbroken(rooms, weights, one_step, tmp_path_factory):
    """(config, last state) of a run that nobody killed."""
    config = config_of(rooms, tmp_path_factory.mktemp("run"), weights=weights)
    return config, train_depth(config)


def test_a_rendered_room_is_read_as_distances_over_the_cameras_height(tmp_path):
    folder, distance = write_room(tmp_path, 7)
    (example,) = room_examples(folder, ROWS)
    np.testing.assert_allclose(example.distance, distance / HEIGHT, rtol=1e-3)  # float16
    np.testing.assert_allclose(example.background, example.distance, rtol=1e-3)  # nothing stands in it
    floor = -1 / np.sin(np.asarray(latitudes(ROWS))[-4:])
    np.testing.assert_allclose(example.distance[-4:], np.repeat(floor[:, None], 2 * ROWS, 1), rtol=1e-3)
    assert room_examples(folder, 2 * ROWS) == []


def test_some_rooms_are_held_out_and_an_empty_folder_is_refused(rooms, tmp_path):
    read = RenderedRooms(rooms, ROWS, 2)
    assert len(read.trained) == len(read.held_out) == 2
    with pytest.raises(InputError, match="0 rendered rooms"):
        RenderedRooms(tmp_path, ROWS, 2)


def test_a_batch_is_a_function_of_the_seed_and_the_step(rooms, tmp_path):
    config = config_of(rooms, tmp_path)
    one, again = DepthData(config).batch(3), DepthData(config).batch(3)
    jax.tree.map(np.testing.assert_array_equal, one, again)
    assert one.rgb.shape == (1, 2, ROWS, 2 * ROWS, 3)
    assert np.any(one.rgb != DepthData(config).batch(4).rgb)
    assert np.any(one.rgb != DepthData(dataclasses.replace(config, seed=1)).batch(3).rgb)


def test_a_drawn_room_stands_within_its_background():
    config = DepthDataConfig(height=ROWS)
    example = jax.tree.map(lambda x: x[0], drawn_examples(jax.random.split(jax.random.key(0), 1), config))
    known = example.distance > 0
    beyond = jnp.where(known, example.distance > 1.001 * example.background, False)
    assert beyond.mean() < 0.15  # recesses of doors and windows alone lie behind the walls
    assert (jnp.abs(example.distance / example.background - 1) < 1e-3).mean() > 0.3
    np.testing.assert_allclose(example.background[-1], -1 / jnp.sin(latitudes(ROWS)[-1]), rtol=1e-3)


def test_a_run_that_was_killed_goes_on_to_the_same_bytes(unbroken, tmp_path, monkeypatch):
    config, state = unbroken
    broken = dataclasses.replace(config, output=str(tmp_path))
    after = TrainingRun.after

    def dies(self, *arguments):
        after(self, *arguments)
        if self.step == 3:
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(TrainingRun, "after", dies)
        with pytest.raises(KeyboardInterrupt):
            train_depth(broken)
    with pytest.raises(InputError, match="--resume"):
        train_depth(broken)
    jax.tree.map(np.testing.assert_array_equal, train_depth(broken, resume=True), state)


def test_its_weights_are_read_back_and_go_on_being_trained(unbroken):
    config, state = unbroken
    folder = f"{config.output}/weights"
    parameters = read_depth_network(folder, config.network)
    rgb = jnp.full((1, ROWS, 2 * ROWS, 3), 0.5)
    estimate = jax.jit(estimate_depth, static_argnums=2)
    assert jnp.isfinite(estimate(parameters, rgb, config.network).log_distance).all()
    assert int(state.skipped) == 0
    further = start_parameters(dataclasses.replace(config, weights=folder))
    jax.tree.map(np.testing.assert_array_equal, further, parameters)
    with pytest.raises(InputError, match=r"lacks backbone\.block07\.depthwise\.bias \(480,\)"):
        read_depth_network(folder)  # of another network's sizes


def test_the_backbone_is_read_alone_and_moves_at_its_own_rate(unbroken, tmp_path):
    config, _ = unbroken
    backbone = read_depth_network(f"{config.output}/weights", config.network)["backbone"]
    write_depth_network(tmp_path, backbone)
    jax.tree.map(np.testing.assert_array_equal, read_depth_backbone(tmp_path, config.network), backbone)
    drawn = dataclasses.replace(config, weights="", backbone=str(tmp_path))
    start = jax.jit(lambda: start_parameters(drawn)["backbone"])()  # what is drawn besides is not compiled
    jax.tree.map(np.testing.assert_array_equal, start, backbone)


def test_bad_input_is_one_line_and_exit_code_2(tmp_path, capsys):
    arguments = ["--config", "tiny_depth", "--set", f"output={tmp_path}", "--set", f"data.rendered={tmp_path}"]
    assert main(arguments) == 2
    assert "rendered rooms with panoramas of 32 rows" in capsys.readouterr().err
    with pytest.raises(InputError, match="height must be a multiple of 32"):
        DepthDataConfig(height=48)
