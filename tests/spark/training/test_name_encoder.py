"""Names as vectors: what must not change them, what the encoder learns from, T5 from a folder."""

import json
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from safetensors import safe_open
from safetensors.numpy import save_file as save_arrays
from safetensors.torch import save_file

from spark.errors import ConventionError, DependencyError, FileFormatError
from spark.inference.name_words import PAD, rig_words
from spark.inference.weights import OTHER, SHIPPED, read_weights
from spark.network.retarget import NetworkRetargeter
from spark.network.t5 import T5Names
from spark.rig.name_conventions import CONVENTIONS, HELD_OUT, name_joints
from spark.rig.roles import Role
from spark.training.checkpoint import load_checkpoint, save_checkpoint
from spark.training.name_encoder import NameConfig, NameEncoder, tokenize, tokenize_rigs
from spark.training.name_file import load_names, save_names
from spark.training.name_rigs import KINDS, made_up_rig, rig_of
from spark.training.settings import TrainConfig
from spark.training.train import fresh_checkpoint
from spark.training.train_names import LEARNED, score_names, train_names
from tests.helpers.rigs import RIGS, build

SMALL = NameConfig(width=48, heads=4, blocks=1, rig_blocks=1)
ROLES = list(Role)


@pytest.fixture(scope="module")
def encoder() -> NameEncoder:
    torch.manual_seed(0)
    return NameEncoder(SMALL)


# Words


def test_what_a_rigs_names_share_is_taken_away() -> None:
    wanted = {"hips", "head", "left fore arm", "right up leg", "left toe base", "spine 1"}
    assert wanted <= set(rig_words(build(RIGS["mixamo"])[0].names))
    assert {"hips", "r upper arm", "l hand"} <= set(rig_words(name_joints(ROLES, "vrm"))) | {"hips"}
    assert "l thigh" in rig_words(name_joints(ROLES, "valve"))
    assert "left knee" in rig_words(name_joints(ROLES, "robot"))


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_words_tell_joints_apart_as_the_names_do(convention: str) -> None:
    words = rig_words(name_joints([*ROLES, Role.SPINE, Role.NECK], convention))
    assert len(set(words)) == len(words)
    assert all(words)


@pytest.mark.parametrize("prefix", ["Armature|", "rig:body:", "CC_Base_", "Scene|Bob: "])
def test_prefixes_of_all_names_say_nothing(prefix: str) -> None:
    names = name_joints(ROLES, "motionbuilder")
    assert rig_words([prefix + name for name in names]) == rig_words(names)


@given(st.lists(st.text(max_size=60), max_size=12))
def test_any_names_have_words(names: list[str]) -> None:
    words = rig_words(names)
    assert len(words) == len(names)
    assert rig_words(names[::-1]) == words[::-1]


# Vectors


def test_tokens_are_byt5s() -> None:
    np.testing.assert_array_equal(tokenize(["Ab", "é"]), [[68, 101, 1], [198, 172, 1]])


def test_tokens_of_rigs_are_padded_by_names_and_bytes() -> None:
    tokens = tokenize_rigs([["Ab"], ["é", "a", "bcd"]])
    assert tokens.shape == (2, 3, 4)
    np.testing.assert_array_equal(tokens[0, 0], [100, 101, 1, PAD])
    assert not tokens[0, 1:].any()


def test_the_order_of_a_rigs_names_changes_no_vector(encoder: NameEncoder) -> None:
    names = name_joints(ROLES, "asf")
    order = np.random.default_rng(0).permutation(len(names)).tolist()
    shuffled = encoder.encode([names[k] for k in order])
    torch.testing.assert_close(shuffled, encoder.encode(names)[order], atol=1e-5, rtol=0)


def test_other_rigs_in_a_batch_change_no_vector(encoder: NameEncoder) -> None:
    rigs = [name_joints(ROLES, "asf"), name_joints([*ROLES, Role.SPINE], "creation")]
    together = encoder(tokenize_rigs(rigs))
    torch.testing.assert_close(
        together[0, : len(rigs[0])], encoder.encode(rigs[0]), atol=1e-5, rtol=0
    )
    torch.testing.assert_close(together.norm(dim=-1)[1], torch.ones(len(rigs[1])))


def test_a_word_means_what_its_rig_makes_of_it(encoder: NameEncoder) -> None:
    alone = encoder.encode(["LeftShoulder"])[0]
    with_an_arm = encoder.encode(["LeftShoulder", "LeftArm"])[0]
    assert (alone - with_an_arm).norm() > 1e-3


@given(st.lists(st.text(max_size=60), min_size=1, max_size=8))
def test_any_names_have_unit_vectors(names: list[str]) -> None:
    vectors = NameEncoder(NameConfig(width=8, heads=2, blocks=1, rig_blocks=1)).encode(names)
    torch.testing.assert_close(vectors.norm(dim=-1), torch.ones(len(names)))


# Learning


def test_made_up_rigs_have_the_joints_of_a_body_and_no_words_of_held_out_conventions() -> None:
    rng = np.random.default_rng(0)
    kinds: set[str] = set()
    for _ in range(300):
        rig = made_up_rig(rng, LEARNED)
        kinds |= {kind for _, _, kind in rig}
        assert {"pelvis", "spine", "upper_arm", "upper_leg"} <= {kind for _, _, kind in rig}
        assert all((side != "") >= (kind in KINDS[4:]) for _, side, kind in rig)
        assert not any("ball" in name.lower() for name, _, _ in rig), "unreal's word for toes"
    assert kinds == {*KINDS, OTHER}


def test_held_out_conventions_are_copies_of_no_learned_one() -> None:
    for held in HELD_OUT:
        names = set(name_joints(ROLES, held))
        assert all(names != set(name_joints(ROLES, learned)) for learned in LEARNED)


def test_names_are_learned() -> None:
    """By a small encoder in few steps: more than likeness of letters gives, which is much."""
    torch.manual_seed(0)
    blank, learned = NameEncoder(SMALL), train_names(120, config=SMALL, rigs=8)
    scores = [score_names(encoder, tuple(CONVENTIONS)) for encoder in (blank, learned)]
    assert scores[1].right > scores[0].right + 60
    held_out = score_names(learned)
    assert held_out.total == len(HELD_OUT) * 23 == held_out.right + len(held_out.failures)
    assert held_out.right > score_names(blank).right
    assert held_out.sides_confused == 0


def test_training_is_the_same_again() -> None:
    first, again = (train_names(2, config=SMALL, rigs=2, seed=3) for _ in range(2))
    for one, other in zip(first.parameters(), again.parameters(), strict=True):
        torch.testing.assert_close(one, other, atol=0, rtol=0)


def test_a_side_read_wrongly_is_counted(encoder: NameEncoder) -> None:
    from spark.training.train_names import score_rigs

    rig = [
        (name, {"left": "right", "right": "left"}.get(side, side), kind)
        for name, side, kind in rig_of("asf", ROLES)
    ]
    score = score_rigs(encoder, [rig])
    sided = sum(bool(side) for _, side, _ in rig)
    assert 0 < score.sides_confused <= sided


# T5


@pytest.fixture(scope="module")
def t5(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A tiny T5 with a byte tokenizer, written to disk."""
    transformers = pytest.importorskip("transformers", reason="extra t5 is not installed")
    folder = tmp_path_factory.mktemp("t5")
    config = transformers.T5Config(
        vocab_size=384, d_model=16, d_kv=8, d_ff=32, num_layers=1, num_heads=2
    )
    transformers.T5EncoderModel(config).save_pretrained(folder)
    transformers.ByT5Tokenizer().save_pretrained(folder)
    return folder


def test_t5_from_a_folder_pools_its_hidden_states(t5: Path, tmp_path: Path) -> None:
    """Against transformers itself, one name at a time, without padding."""
    import transformers

    names = ["LeftArm", "RightForeArm", "LeftArm"]
    vectors = T5Names(str(t5), tmp_path / "names.pt").encode(names)
    model = transformers.T5EncoderModel.from_pretrained(t5)
    for name, vector in zip(names, vectors, strict=True):
        tokens = torch.tensor([[*(b + 3 for b in name.encode()), 1]])
        with torch.no_grad():
            mean = model(tokens).last_hidden_state[0].mean(0)
        torch.testing.assert_close(vector, mean / mean.norm(), atol=1e-5, rtol=0)


def test_cached_names_need_no_transformers(t5: Path, tmp_path: Path) -> None:
    cache = tmp_path / "cache" / "names.pt"
    first = T5Names(str(t5), cache).encode(["LeftArm", "Hips"])
    program = f"""
import sys
sys.modules["transformers"] = None  # importing it fails
from pathlib import Path
from spark.network.t5 import T5Names
names = T5Names({str(t5)!r}, Path({str(cache)!r}))
print(*names.encode(["Hips"])[0].tolist())
try:
    names.encode(["Head"])
except Exception as error:
    print(type(error).__name__, error)
"""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    values, refused = done.stdout.splitlines()
    np.testing.assert_allclose(np.array(values.split(), float), first[1], atol=1e-7)
    assert refused.startswith("DependencyError")
    assert "spark-sim[t5]" in refused


def test_another_t5_in_the_same_folder_is_not_the_cached_one(t5: Path, tmp_path: Path) -> None:
    import transformers

    folder, cache = tmp_path / "t5", tmp_path / "names.pt"
    shutil.copytree(t5, folder)
    first = T5Names(str(folder), cache).encode(["Hips"])
    config = transformers.T5Config.from_pretrained(t5)
    transformers.T5EncoderModel(config).save_pretrained(folder)
    assert (T5Names(str(folder), cache).encode(["Hips"]) - first).abs().max() > 1e-3


def test_a_cache_holds_several_models(t5: Path, tmp_path: Path) -> None:
    cache = tmp_path / "names.pt"
    torch.save({"another": {"Hips": torch.ones(4)}}, cache)
    T5Names(str(t5), cache).encode(["Hips"])
    torch.testing.assert_close(T5Names("another", cache).encode(["Hips"]), torch.ones(1, 4))


def test_what_is_no_t5_and_what_is_no_cache_is_refused(t5: Path, tmp_path: Path) -> None:
    with pytest.raises(DependencyError, match="no T5 model at"):
        T5Names(str(tmp_path), tmp_path / "none.pt").encode(["Hips"])
    cache = tmp_path / "names.pt"
    for content in (b"nonsense", b""):
        cache.write_bytes(content)
        with pytest.raises(FileFormatError, match=r"names\.pt.*delete it"):
            T5Names(str(t5), cache)


def test_no_model_is_loaded_on_a_checkpoints_word(
    t5: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither a folder nor a name on the hub, not even a folder that is called as T5 is."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(t5, tmp_path / "t5-small")
    cache = tmp_path / "names.pt"
    for model in (str(t5), "stranger/model", "t5-small"):
        with pytest.raises(DependencyError, match="not loaded on a checkpoint's word"):
            T5Names(model, cache, own=False).encode(["Hips"])
    spoilt = tmp_path / "x.safetensors"
    with safe_open(SHIPPED, "np") as file:
        header = json.loads(file.metadata()["config"]) | {"names": {"t5": str(t5)}}
        metadata = {**file.metadata(), "config": json.dumps(header)}
        tensors = {key: file.get_tensor(key) for key in file.keys()}  # noqa: SIM118
    save_arrays({k: v for k, v in tensors.items() if not k.startswith("names.")}, spoilt, metadata)
    encode = NetworkRetargeter(read_weights(spoilt))._encode
    with pytest.raises(DependencyError, match="not loaded on a checkpoint's word"):
        encode(("a joint of no cache",))
    monkeypatch.setenv("SPARK_SIM_T5", str(t5))  # the user's word
    assert T5Names(str(t5), cache, own=False).encode(["Hips"]).shape[0] == 1


# Files


def test_a_learned_encoder_is_kept_in_a_file(encoder: NameEncoder, tmp_path: Path) -> None:
    path = tmp_path / "names.safetensors"
    save_names(encoder, path)
    names = name_joints(ROLES, "xsens")
    torch.testing.assert_close(load_names(path).encode(names), encoder.encode(names))


def test_what_is_no_name_encoder_is_refused(encoder: NameEncoder, tmp_path: Path) -> None:
    path = tmp_path / "names.safetensors"
    save_names(encoder, path)
    whole = path.read_bytes()
    for content in (
        b"",
        b"nonsense",
        whole[:-4],
        whole.replace(b'\\"blocks\\": 1', b'\\"blocks\\": 2'),
    ):
        assert content != whole
        path.write_bytes(content)
        with pytest.raises(FileFormatError, match=r"names\.safetensors: is no name encoder"):
            load_names(path)
    save_file({"a": torch.zeros(1)}, path)
    with pytest.raises(FileFormatError, match="not 'spark-sim names'"):
        load_names(path)
    with pytest.raises(FileFormatError, match="no such file"):
        load_names(tmp_path / "none.safetensors")


def test_training_begins_with_the_names_that_ship(tmp_path: Path) -> None:
    """By default, by name, by the file itself, and by the folder of a run that has them."""
    shipped = load_checkpoint(SHIPPED).names
    assert isinstance(shipped, NameEncoder)
    names = name_joints(ROLES, "xsens")
    tiny = TrainConfig.of("tiny")
    save_checkpoint(fresh_checkpoint(tiny), tmp_path / "checkpoint.safetensors")
    for file in ("shipped", str(SHIPPED), str(tmp_path)):
        own = fresh_checkpoint(tiny.changed("test", names=file, name_steps=5)).names
        assert isinstance(own, NameEncoder)
        torch.testing.assert_close(own.encode(names), shipped.encode(names))
    told: list[int] = []
    learned = fresh_checkpoint(tiny.changed("test", name_steps=2), lambda n, loss: told.append(n))
    assert told == [1, 2]
    assert isinstance(learned.names, NameEncoder)
    assert not torch.allclose(learned.names.encode(names), shipped.encode(names))
    t5 = replace(fresh_checkpoint(tiny), names="t5-small")
    save_checkpoint(t5, tmp_path / "checkpoint.safetensors")
    with pytest.raises(FileFormatError, match="names of 't5-small'; give --t5 that"):
        load_names(tmp_path)


def test_training_begins_with_the_names_of_a_file(encoder: NameEncoder, tmp_path: Path) -> None:
    path = tmp_path / "names.safetensors"
    save_names(encoder, path)
    config = TrainConfig.of("tiny").changed("test", names=str(path))
    begun = fresh_checkpoint(config)
    save_checkpoint(begun, tmp_path / "run.safetensors")
    read = load_checkpoint(tmp_path / "run.safetensors")
    assert isinstance(read.names, NameEncoder)
    names = name_joints(ROLES, "xsens")
    torch.testing.assert_close(read.names.encode(names), encoder.encode(names))
    assert read.model.config.name_width == SMALL.width + 2
    with pytest.raises(ConventionError, match="expected one of them"):
        config.changed("test", t5="t5-small")
