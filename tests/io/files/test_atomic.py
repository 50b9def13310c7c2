"""A file is there whole, or what was there before stays, and nothing else is left in the folder."""

import errno
import os
import resource

import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.io.files.atomic import atomic_path, write_bytes, write_text


def test_writes_into_new_folders_and_replaces(tmp_path):
    target = tmp_path / "a" / "b" / "x.bin"
    write_bytes(target, b"first")
    write_bytes(target, b"second")
    assert target.read_bytes() == b"second"
    write_text(target, "\u00e9")
    assert target.read_bytes() == "\u00e9".encode()
    assert os.listdir(target.parent) == ["x.bin"]


def test_temporary_is_beside_the_target_with_its_suffix(tmp_path):
    with atomic_path(tmp_path / "x.png") as temporary:
        assert temporary.parent == tmp_path and temporary.suffix == ".png"
        assert not temporary.exists()  # the writer makes it, with the user's umask
        temporary.write_bytes(b"picture")


@pytest.mark.parametrize(
    "failure", [OSError(errno.ENOSPC, "No space left on device"), ValueError("no"), KeyboardInterrupt()]
)
def test_any_failure_keeps_the_earlier_file(tmp_path, failure):
    target = tmp_path / "x.bin"
    write_bytes(target, b"earlier")
    expected = InputError if isinstance(failure, OSError) else type(failure)
    with pytest.raises(expected) as caught, atomic_path(target) as temporary:
        temporary.write_bytes(b"half")
        raise failure
    assert target.read_bytes() == b"earlier" and os.listdir(tmp_path) == ["x.bin"]
    if expected is InputError:
        assert str(caught.value) == f"{target} cannot be written (No space left on device): free some space there"


def test_a_body_that_wrote_nothing_keeps_the_earlier_file(tmp_path):
    write_bytes(tmp_path / "x", b"earlier")
    with pytest.raises(InputError, match="cannot be written"), atomic_path(tmp_path / "x"):
        pass
    assert (tmp_path / "x").read_bytes() == b"earlier"


def test_the_disk_really_full(tmp_path, file_size_limit):
    """RLIMIT_FSIZE stops the real write call; root is not spared."""
    target = tmp_path / "x.bin"
    write_bytes(target, b"earlier")
    with file_size_limit(1000), pytest.raises(InputError, match="free some space"):
        write_bytes(target, bytes(5000))
    assert target.read_bytes() == b"earlier" and os.listdir(tmp_path) == ["x.bin"]
    assert resource.getrlimit(resource.RLIMIT_FSIZE)[0] == resource.RLIM_INFINITY  # the limit is off again


def _refusing_folders(monkeypatch, name, error):
    """os.fsync or os.open of a folder raises `error`."""
    plain = getattr(os, name)

    def refuse(which, *rest, **more):
        if os.path.isdir(which):
            raise error
        return plain(which, *rest, **more)

    monkeypatch.setattr(os, name, refuse)


@pytest.mark.parametrize(
    ("name", "error"),
    [
        ("fsync", OSError(errno.EINVAL, "Invalid argument")),  # network shares, FUSE
        ("fsync", OSError(errno.ENOTSUP, "Operation not supported")),
        ("open", PermissionError(errno.EACCES, "Permission denied")),  # Windows
    ],
)
def test_a_folder_that_cannot_be_synced_is_forgiven(tmp_path, monkeypatch, name, error):
    _refusing_folders(monkeypatch, name, error)
    write_bytes(tmp_path / "x.bin", b"whole")
    assert (tmp_path / "x.bin").read_bytes() == b"whole" and os.listdir(tmp_path) == ["x.bin"]


def test_a_file_or_a_folder_that_the_disk_refuses_to_sync_is_not(tmp_path, monkeypatch):
    with monkeypatch.context() as patch, pytest.raises(InputError, match=r"x.bin cannot be written \(Input/output"):
        _refusing_folders(patch, "fsync", OSError(errno.EIO, "Input/output error"))
        write_bytes(tmp_path / "x.bin", b"")

    def full(_):
        raise OSError(errno.EINVAL, "Invalid argument")

    monkeypatch.setattr(os, "fsync", full)  # the file's, too
    with pytest.raises(InputError, match=r"y.bin cannot be written \(Invalid argument"):
        write_bytes(tmp_path / "y.bin", b"")


def test_text_that_holds_an_undecodable_name_is_refused_in_a_line(tmp_path):
    with pytest.raises(InputError, match=r"x.toml cannot be written .* not Unicode"):
        write_text(tmp_path / "x.toml", 'output = "a\udcff"')
    assert not os.listdir(tmp_path)


def test_unwritable_targets_are_named(tmp_path):
    (tmp_path / "file").write_text("a file, not a folder")
    (tmp_path / "folder").mkdir()
    for target in (tmp_path / "file" / "x.bin", tmp_path / "file" / "deeper" / "x.bin", tmp_path / "folder"):
        with pytest.raises(InputError) as caught:
            write_bytes(target, b"x")
        assert str(target) in str(caught.value) and "\n" not in str(caught.value)
    assert sorted(os.listdir(tmp_path)) == ["file", "folder"]
