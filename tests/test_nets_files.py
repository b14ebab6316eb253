"""Saving and loading."""

import hashlib
import json
import subprocess
import sys

import numpy as np
import pytest
from safetensors.numpy import save as render_tensors

from nets import DigestError, NetworkFileError, fit_rbf, load_rbf, read_notes, save_rbf, train_rbf


def trained(outputs=3):
    rng = np.random.default_rng(0)
    x = rng.uniform(-60, 60, size=(80, 3))
    return fit_rbf(x, np.sin(x / 40)[:, :outputs], centres=12, spread=2.0), x


def test_round_trip_predicts_bit_for_bit(tmp_path):
    network, x = trained()
    digest = save_rbf(network, tmp_path / "rbf.safetensors", {"rows": 80, "unit": "mm"})
    for loaded in (load_rbf(tmp_path / "rbf.safetensors"), load_rbf(tmp_path / "rbf.safetensors", digest)):
        np.testing.assert_array_equal(loaded.predict(x), network.predict(x))
        np.testing.assert_array_equal(loaded.inside(x * 1.2), network.inside(x * 1.2))
    assert read_notes(tmp_path / "rbf.safetensors") == {"rows": 80, "unit": "mm"}


def test_the_same_network_gives_the_same_bytes_also_in_another_process(tmp_path):
    network, _ = trained()
    notes = {"b": 1, "a": [2.5, "x"], "c": None}
    first, second = tmp_path / "one.safetensors", tmp_path / "two.safetensors"
    assert save_rbf(network, first, notes) == save_rbf(trained()[0], second, dict(reversed(notes.items())))
    assert first.read_bytes() == second.read_bytes()
    script = f"from nets import *; n = load_rbf({str(first)!r}); save_rbf(n, {str(first)!r} + '3', {notes!r})"
    subprocess.run([sys.executable, "-c", script], check=True)
    assert (tmp_path / "one.safetensors3").read_bytes() == first.read_bytes()


def test_there_is_one_metadata_key_and_the_digest_lies_beside(tmp_path):
    path = tmp_path / "rbf.safetensors"
    digest = save_rbf(trained()[0], path)
    content = path.read_bytes()
    header = json.loads(content[8 : 8 + int.from_bytes(content[:8], "little")])
    assert list(header["__metadata__"]) == ["rbf"]
    assert digest == hashlib.sha256(content).hexdigest()
    assert (tmp_path / "rbf.safetensors.sha256").read_text() == f"{digest}  rbf.safetensors\n"
    assert sorted(each.name for each in tmp_path.iterdir()) == ["rbf.safetensors", "rbf.safetensors.sha256"]


def test_the_null_network_is_saved_too(tmp_path):
    rng = np.random.default_rng(0)
    x = rng.uniform(-60, 60, size=(60, 3))
    network = train_rbf(x, np.zeros((60, 2)), np.arange(60)).network
    save_rbf(network, tmp_path / "null")
    np.testing.assert_array_equal(load_rbf(tmp_path / "null").predict(x), np.zeros((60, 2)))


@pytest.mark.parametrize("position", [0, 40, -1])
def test_a_changed_file_is_refused(tmp_path, position):
    path = tmp_path / "rbf.safetensors"
    digest = save_rbf(trained()[0], path)
    content = bytearray(path.read_bytes())
    content[position] ^= 1
    path.write_bytes(content)
    with pytest.raises(DigestError, match=digest):
        load_rbf(path)
    with pytest.raises(DigestError, match="changed or damaged"):
        read_notes(path, digest)


def test_a_wrong_or_missing_digest_is_refused(tmp_path):
    path = tmp_path / "rbf.safetensors"
    save_rbf(trained()[0], path)
    with pytest.raises(DigestError):
        load_rbf(path, "0" * 64)
    (tmp_path / "rbf.safetensors.sha256").unlink()
    with pytest.raises(DigestError, match="no SHA-256 is known"):
        load_rbf(path)
    (tmp_path / "rbf.safetensors.sha256").write_text("")
    with pytest.raises(ValueError, match="no SHA-256 is known"):
        load_rbf(path)


def about(version=1):
    return {"rbf": json.dumps({"format": "gaussian-rbf", "version": version, "notes": {}})}


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"not a network", "not a safetensors file"),
        (render_tensors({"a": np.zeros(2)}), "metadata"),
        (render_tensors({"a": np.zeros(2)}, metadata={"rbf": "[]"}), "format None"),
        (render_tensors({"a": np.zeros(2)}, metadata=about(2)), "version 2"),
        (render_tensors({"a": np.zeros(2)}, metadata=about()), "expected .*centres"),
    ],
)
def test_other_files_are_refused(tmp_path, content, message):
    path = tmp_path / "rbf.safetensors"
    path.write_bytes(content)
    with pytest.raises(NetworkFileError, match=message):
        load_rbf(path, hashlib.sha256(content).hexdigest())


@pytest.mark.parametrize(
    ("name", "value"),
    [("widths", np.ones(5)), ("weights", np.full((12, 3), np.nan)), ("centres", np.zeros((12, 3), dtype=np.float32))],
)
def test_tensors_that_do_not_fit_are_refused(tmp_path, name, value):
    tensors = {key: np.ascontiguousarray(each.numpy()) for key, each in trained()[0].state_dict().items()}
    tensors["domain_reach"] = tensors["domain_reach"].reshape(())
    content = render_tensors(tensors | {name: value}, metadata=about())
    (tmp_path / "rbf.safetensors").write_bytes(content)
    with pytest.raises(NetworkFileError, match="finite float64 array of the right shape"):
        load_rbf(tmp_path / "rbf.safetensors", hashlib.sha256(content).hexdigest())


def test_a_failed_write_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "rbf.safetensors"
    save_rbf(trained()[0], path)
    before = path.read_bytes()

    def full(*_):
        raise OSError("disk full")

    monkeypatch.setattr("nets.files.os.replace", full)
    with pytest.raises(OSError, match="disk full"):
        save_rbf(trained(2)[0], path)
    assert path.read_bytes() == before
    assert len(list(tmp_path.iterdir())) == 2
