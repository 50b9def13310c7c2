"""Pairs as bytes and in shards: what comes back, the same bytes each time, and damage named."""

import io
import pickle

import numpy as np
import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.io.pairs.pair_record import decode_pair, encode_pair
from rein3d_jax.io.pairs.pair_shard import MANIFEST, PairDataset, shard_fault, write_shard
from rein3d_jax.scene import Pair, Video


def pair_of(seed, frames=2, height=8):
    rng = np.random.default_rng(seed)
    shape = (frames, height, 2 * height)
    poses = np.tile(np.eye(4, dtype=np.float32), (frames, 1, 1))
    poses[:, 0, 3] = np.arange(frames)
    alpha = rng.random(shape, np.float32)
    clean = Video(rng.random((*shape, 3), np.float32), np.ones(shape, np.float32), 1 + 5 * alpha, poses)
    return Pair(clean, Video(rng.random((*shape, 3), np.float32), alpha, 2 * alpha, poses))


def write_dataset(folder, counts=(2, 1)):
    shards, seed = [], iter(range(100))
    for number, count in enumerate(counts):
        path = folder / f"s{number}.array_record"
        shards.append({"file": path.name} | write_shard(path, (pair_of(next(seed)) for _ in range(count)), {}))
    (folder / MANIFEST).write_text(str({"shards": shards}).replace("'", '"'))
    return folder


def test_a_pair_comes_back():
    pair = pair_of(0)
    again = decode_pair(encode_pair(pair))
    for before, after in ((pair.clean, again.clean), (pair.degraded, again.degraded)):
        np.testing.assert_allclose(after.rgb, before.rgb, atol=0.5 / 255 + 1e-6)  # 8 bits
        np.testing.assert_allclose(after.alpha, before.alpha, atol=0.5 / 255 + 1e-6)
        np.testing.assert_allclose(after.distance, before.distance, rtol=2**-11)  # float16 rounds to 11 bits
        np.testing.assert_array_equal(after.world_from_camera, before.world_from_camera)
    assert encode_pair(again) == encode_pair(pair)  # what was rounded once stays


def npz(**arrays):
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"PK\x03\x04 no archive",
        encode_pair(pair_of(0))[:-100],
        pickle.dumps({"clean_rgb": 1}),
        npz(clean_rgb=np.zeros((1, 8, 16, 3), np.uint8)),
        npz(**{name: np.array([{}], object) for name in ("clean_rgb", "world_from_camera")}),
        encode_pair(pair_of(0)).replace(b"(2, 8, 16, 3)", b"(9, 8, 16, 3)"),
        encode_pair(pair_of(0)).replace(b"'|u1'", b"'|i1'"),
    ],
    ids=["empty", "no zip", "cut off", "pickle", "arrays missing", "objects", "declares more", "another type"],
)
def test_bytes_that_hold_no_pair_are_refused(data):
    with pytest.raises(InputError, match="record 7 holds no pair of clips"):
        decode_pair(data, "record 7")


def test_a_dataset_gives_its_pairs_by_number(tmp_path):
    data = PairDataset(write_dataset(tmp_path))
    assert len(data) == 3 and data.faults() == []
    for index in (2, 0, 1):
        np.testing.assert_allclose(data[index].degraded.rgb, pair_of(index).degraded.rgb, atol=0.5 / 255 + 1e-6)


def test_the_same_pairs_give_the_same_bytes(tmp_path):
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        write_dataset(tmp_path / name)
    for path in (tmp_path / "a").iterdir():
        assert path.read_bytes() == (tmp_path / "b" / path.name).read_bytes()


def test_an_interrupted_shard_leaves_nothing_under_its_name(tmp_path):
    path = tmp_path / "s0.array_record"

    def breaks():
        yield pair_of(0)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_shard(path, breaks(), {})
    assert not path.exists() and not path.with_suffix(".json").exists()
    (tmp_path / ".s0.dead.array_record").write_bytes(b"of a process that was killed")
    write_shard(path, [pair_of(0)], {})
    assert sorted(x.name for x in tmp_path.iterdir()) == ["s0.array_record", "s0.json"]


@pytest.mark.parametrize("where", ["middle", "end", "gone"])
def test_a_damaged_shard_is_named(tmp_path, where):
    shard = write_dataset(tmp_path) / "s0.array_record"
    whole = PairDataset(tmp_path)
    data = bytearray(shard.read_bytes())
    if where == "middle":
        data[300:400] = bytes(100)  # the file is padded; here it holds the first record
        shard.write_bytes(data)
        (fault,) = PairDataset(tmp_path).faults()
        assert "s0.array_record does not have its checksum" in fault
        with pytest.raises(InputError, match=r"s0\.array_record is damaged at record"):
            [whole[0], whole[1]]
    else:
        shard.write_bytes(data[: len(data) // 2]) if where == "end" else shard.unlink()
        with pytest.raises(InputError, match=r"s0\.array_record (has|is missing).*build_dataset"):
            PairDataset(tmp_path)
        assert shard_fault(shard, whole.shards[0][1])


def test_a_folder_without_a_manifest_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"manifest\.json"):
        PairDataset(tmp_path)
    (tmp_path / MANIFEST).write_text('{"shards": [{"file": 3}]}')
    with pytest.raises(InputError, match=r"manifest\.json is no dataset's manifest"):
        PairDataset(tmp_path)
