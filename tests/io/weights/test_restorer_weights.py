"""A restorer's weights come back as float16 holds them, and what is no such file is refused in one line."""

import json

import numpy as np
import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.io.weights.restorer_weights import SIZES_NAME, read_restorer, write_restorer

SIZE = {"rows": 16, "width": 32}
RNG = np.random.default_rng(0)
PARAMETERS = {
    "first": {"kernel": RNG.normal(size=(300, 7)).astype(np.float32), "bias": np.float32([0, 1e-6, -3e-3])},
    "blocks": {"inner": {"scale": np.float32(1000 * RNG.normal(size=5))}, "shift": np.float32(2.5)},
}


def refusal(path) -> str:
    with pytest.raises(InputError) as caught:
        read_restorer(path)
    text = str(caught.value)
    assert str(path) in text and "\n" not in text
    return text


@pytest.fixture
def written(tmp_path):
    path = tmp_path / "weights.npz"
    write_restorer(path, PARAMETERS, SIZE)
    return path


def test_weights_come_back_within_float16_as_float32(written):
    parameters, sizes = read_restorer(written)
    assert sizes == SIZE
    assert list(parameters) == list(PARAMETERS) and list(parameters["blocks"]) == ["inner", "shift"]

    def near(found, expected):
        assert found.dtype == np.float32 and found.shape == expected.shape
        np.testing.assert_allclose(found, expected, rtol=2**-11, atol=2**-25)  # half of float16's last digit

    for name in ("kernel", "bias"):
        near(parameters["first"][name], PARAMETERS["first"][name])
    near(parameters["blocks"]["inner"]["scale"], PARAMETERS["blocks"]["inner"]["scale"])
    near(parameters["blocks"]["shift"], PARAMETERS["blocks"]["shift"])


def test_what_was_read_is_written_to_the_same_numbers(written, tmp_path):
    """float16 is lost once, not at each passage."""
    once = read_restorer(written)
    write_restorer(tmp_path / "again.npz", *once)
    twice, _ = read_restorer(tmp_path / "again.npz")
    np.testing.assert_array_equal(twice["first"]["kernel"], once[0]["first"]["kernel"])


def test_a_missing_file_is_named_with_the_ways_out(tmp_path):
    text = refusal(tmp_path / "none.npz")
    assert "missing" in text and "train_restore" in text and "restore.method" in text


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.9, 0.999])
def test_a_file_that_was_cut_is_refused(written, share):
    content = written.read_bytes()
    written.write_bytes(content[: int(share * len(content))])
    refusal(written)


@pytest.mark.parametrize("place", range(60, 4000, 397))
def test_a_file_of_which_a_byte_changed_is_refused_or_reads_as_it_was(written, place):
    """Bytes that nothing reads, such as a member's date, may change."""
    content = bytearray(written.read_bytes())
    content[place] ^= 0xFF
    written.write_bytes(content)
    try:
        parameters, sizes = read_restorer(written)
    except InputError as error:
        assert str(written) in str(error) and "\n" not in str(error)
    else:
        assert sizes == SIZE
        np.testing.assert_allclose(
            parameters["first"]["kernel"], PARAMETERS["first"]["kernel"], rtol=2**-11, atol=2**-25
        )


@pytest.mark.parametrize("sizes", [None, b"", b"\xff", b"[1, 2]", b"3", b'{"rows": null}', b'{"rows": "many"}'])
def test_arrays_without_a_networks_sizes_are_no_weights(tmp_path, sizes):
    named = {} if sizes is None else {SIZES_NAME: np.frombuffer(sizes, np.uint8)}
    np.savez(tmp_path / "other.npz", kernel=np.ones(3, np.float16), **named)
    assert "restorer's weights" in refusal(tmp_path / "other.npz")


def test_other_files_are_refused(tmp_path):
    np.save(tmp_path / "one.npy", np.ones(3))
    (tmp_path / "text.npz").write_text("weights")
    pickled = np.array([{"a": 1}], dtype=object)
    text = np.frombuffer(json.dumps(SIZE).encode(), np.uint8)
    np.savez(tmp_path / "objects.npz", kernel=pickled, **{SIZES_NAME: text})
    np.savez(tmp_path / "words.npz", kernel=np.array(["a"]), **{SIZES_NAME: text})
    for name in ("one.npy", "text.npz", "objects.npz", "words.npz", ""):
        refusal(tmp_path / name)
