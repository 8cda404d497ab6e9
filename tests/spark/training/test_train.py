"""Training: checkpoints, resuming, processes, and that a network learns what it is shown."""

import importlib
import importlib.util
import json
import os
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import save_file

from spark.demo.sample import sample_motion, sample_rig
from spark.errors import ConventionError, FileFormatError, SkeletonError
from spark.network.features import body_features
from spark.network.known_bodies import trunk_of
from spark.network.weights import VERSION, read_weights
from spark.rig.roles import Role
from spark.rotation import quat_about, quat_angle, quat_mul
from spark.training.checkpoint import Checkpoint, load_checkpoint, save_checkpoint
from spark.training.clips import read_clips
from spark.training.model import Spark, _corrected
from spark.training.name_encoder import NameConfig, NameEncoder
from spark.training.packed import Packer
from spark.training.pairs import TrainingClip
from spark.training.settings import TrainConfig, read_settings, toml
from spark.training.train import Objective, Steps, _batches, network, optimiser_of, take_step, train
from spark.transfer.analytic import transfer
from spark.transfer.canonical import at_frame_time, canonical_positions, to_canonical
from spark_sim import sample
from tests.helpers.nets import learned
from tests.helpers.stick import without

CHECKOUT = Path(__file__).parents[3]
TINY = TrainConfig.of("tiny").changed(
    "test", steps=4, batch=4, per_body=2, window=12, variants=3, warmup=1, log_every=1, save_every=2
)
SMALL_NAMES = NameConfig(width=16, heads=2, blocks=1)


@pytest.fixture(scope="module")
def clips(tmp_path_factory: pytest.TempPathFactory) -> list[TrainingClip]:
    folder = tmp_path_factory.mktemp("samples")
    sample(folder)
    (folder / "broken.bvh").write_text("HIERARCHY\n")
    found, notes = read_clips([folder])
    assert len(found) == 6
    assert len({id(clip.body) for clip in found}) == 2
    assert len(notes) == 1
    assert "broken.bvh" in notes[0]
    return found


def fresh(config: TrainConfig, seed: int = 0) -> Checkpoint:
    torch.manual_seed(seed)
    return Checkpoint(Spark(network(config, SMALL_NAMES.width)), NameEncoder(SMALL_NAMES))


def with_bowed_neck(clip: TrainingClip) -> TrainingClip:
    """A performance that interpolation does not give: there is something to learn."""
    roles = [clip.body.rig.roles.roles[j] for j in clip.body.joints]
    neck = [k for k, role in enumerate(roles) if role is Role.NECK]
    rotations = np.array(clip.rotations)
    rotations[:, neck] = quat_mul(rotations[:, neck], quat_about("y", np.array(0.5)))
    return replace(clip, rotations=rotations)


def weights(checkpoint: Checkpoint) -> dict[str, torch.Tensor]:
    return {k: v.clone() for k, v in checkpoint.model.state_dict().items()}


@pytest.mark.parametrize("preset", ["tiny", "paper"])
def test_a_resumed_run_is_the_run_that_never_stopped(
    clips: list[TrainingClip], tmp_path: Path, preset: str
) -> None:
    config = replace(TINY, preset=preset)
    whole = train(clips, config, tmp_path / "whole", start=fresh(config))

    class StoppedError(Exception):
        pass

    def stop(step: int, terms: dict[str, float]) -> None:
        if step == 3:  # one step after the checkpoint of step 2
            raise StoppedError

    with pytest.raises(StoppedError):
        train(clips, config, tmp_path / "parts", start=fresh(config), watch=stop)
    half = load_checkpoint(tmp_path / "parts" / "checkpoint.safetensors")
    assert half.step == 2
    resumed = train(clips, config, tmp_path / "parts", start=half)
    for name, value in weights(whole).items():
        assert torch.equal(value, weights(resumed)[name]), name
    logs = [(tmp_path / part / "log.jsonl").read_text().splitlines() for part in ("whole", "parts")]
    first, second = ([json.loads(line) for line in log] for log in logs)
    assert [entry["step"] for entry in second] == [1, 2, 3, 4]
    assert [entry["loss"] for entry in first] == [entry["loss"] for entry in second]


def test_workers_change_nothing(clips: list[TrainingClip], tmp_path: Path) -> None:
    config = replace(TINY, steps=2)
    alone = train(clips, config, tmp_path / "a", start=fresh(config))
    helped = train(clips, replace(config, workers=1), tmp_path / "b", start=fresh(config))
    for name, value in weights(alone).items():
        assert torch.equal(value, weights(helped)[name]), name


def test_a_packed_batch_is_the_batch(clips: list[TrainingClip]) -> None:
    batch = Steps(clips, NameEncoder(SMALL_NAMES).encode, TINY, 0, 1)[0]
    again = Packer()(batch).on(torch.device("cpu"))
    for part, other in zip(batch[:5], again[:5], strict=True):
        assert type(part) is type(other)
        for a, b in zip(part, other, strict=True):
            assert a.dtype == b.dtype
            assert torch.equal(a, b)
    assert torch.equal(batch.planted, again.planted)
    assert torch.equal(batch.effectors, again.effectors)
    assert batch.frame_time == again.frame_time


def test_batches_of_a_worker_hold_while_they_are_used(clips: list[TrainingClip]) -> None:
    """Their memory is used again, but not before the trainer is done with them."""
    steps = Steps(clips, NameEncoder(SMALL_NAMES).encode, replace(TINY, workers=1, steps=14), 0, 1)
    for n, packed in enumerate(_batches(steps, 0)):
        time.sleep(0.02)  # so that the worker is as far ahead as it may be
        batch, again = steps[n], packed.on(torch.device("cpu"))
        assert torch.equal(batch.truth.rotations, again.truth.rotations), n
        assert torch.equal(batch.pose.root, again.pose.root), n


def test_a_checkpoint_keeps_everything(clips: list[TrainingClip], tmp_path: Path) -> None:
    config = replace(TINY, steps=1)
    made = train(clips, config, tmp_path, start=fresh(config))
    read = load_checkpoint(tmp_path / "checkpoint.safetensors")
    assert read.model.config == made.model.config
    assert read.step == 1
    assert TrainConfig.of("paper").changed("file", **read.settings) == config
    assert isinstance(read.names, NameEncoder)
    assert isinstance(made.names, NameEncoder)
    torch.testing.assert_close(read.names.encode(["Hips"]), made.names.encode(["Hips"]))
    assert {k.partition("/")[2] for k in read.optimizer} == {"step", "exp_avg", "exp_avg_sq"}


def test_what_is_no_checkpoint_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "x.safetensors"
    with pytest.raises(FileFormatError, match="no such file"):
        load_checkpoint(path)
    path.write_bytes(b"no tensors")
    with pytest.raises(FileFormatError, match="no safetensors"):
        load_checkpoint(path)
    save_file({"a": torch.zeros(1)}, path)
    with pytest.raises(FileFormatError, match="no spark-sim checkpoint"):
        load_checkpoint(path)
    for version, message in (("1", "version '1'"), (str(VERSION), "damaged")):
        metadata = {"format": "spark-sim checkpoint", "version": version, "config": "{}"}
        save_file({"a": torch.zeros(1)}, path, metadata)
        with pytest.raises(FileFormatError, match=message):
            load_checkpoint(path)
    header: dict[str, object] = {"network": {}, "names": {}, "step": 0, "settings": {}}
    for body in ({"Spine": (0.0, 0.0)}, {"Spine": "up!"}, ["Spine"], {"Spine": 1.0}):
        metadata["config"] = json.dumps({**header, "bodies": [body]})
        save_file({"a": torch.zeros(1)}, path, metadata)
        with pytest.raises(FileFormatError, match="damaged"):
            read_weights(path)
    good = replace(fresh(TINY), bodies=[{"Spine": (0.0, 0.0, 0.25)}])
    save_checkpoint(good, path)
    assert load_checkpoint(path).bodies == good.bodies
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(FileFormatError, match="no safetensors"):
        load_checkpoint(path)


def test_settings_survive_their_file(tmp_path: Path) -> None:
    config = TINY.changed("test", data=['a "b" \\ c', "d"], ablate=["fk"])
    path = tmp_path / "config.toml"
    path.write_text(toml(config))
    assert TrainConfig().changed(path, **read_settings(path)) == config


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"stepps": 1}, "'stepps' is no setting"),
        ({"steps": "many"}, "steps = 'many'"),
        ({"steps": 0}, "steps = 0"),
        ({"batch": 6, "per_body": 4}, "no multiple"),
        ({"ablate": ["feet"]}, "expected one of share, mask, pos, fk, mix"),
        ({"preset": "huge"}, "expected one of default, paper, tiny"),
        ({"seed": True}, "seed = True"),
    ],
)
def test_wrong_settings_are_named(values: dict[str, object], message: str) -> None:
    with pytest.raises(ConventionError, match=message):
        TrainConfig().changed("file", **values)


def test_each_ablation_is_one_switch() -> None:
    paper = network(TrainConfig.of("paper"), 128)
    changes = {}
    for switch in ("share", "mask", "pos"):
        other = network(TrainConfig.of("paper").changed("test", ablate=[switch]), 128)
        changes[switch] = {k: v for k, v in vars(other).items() if v != getattr(paper, k)}
    assert changes == {
        "share": {"share_joints": False},
        "mask": {"mask_joints": 0.0},
        "pos": {"positions_in": True},
    }
    config = TINY.changed("test", ablate=["fk"])
    assert "fk" not in Objective(fresh(config).model, config).weights


def test_norms_and_queries_do_not_decay() -> None:
    model = fresh(TINY).model
    decayed, others = optimiser_of(model, TINY).param_groups
    assert (decayed["weight_decay"], others["weight_decay"]) == (0.01, 0.0)
    names = {id(p): name for name, p in model.named_parameters()}
    assert len(decayed["params"]) + len(others["params"]) == len(names)
    free = {names[id(p)] for p in others["params"]}
    assert all(name.endswith("weight") for name in (names[id(p)] for p in decayed["params"]))
    assert {"decoder.query", "encoder.queries", "encoder.norm.weight"} <= free


def test_two_processes_have_the_gradient_of_one(tmp_path: Path) -> None:
    """torchrun with gloo: after one step of plain gradient both agree with one process."""
    script = tmp_path / "step.py"
    script.write_text(
        f"""
import sys
sys.path.insert(0, {str(CHECKOUT)!r})
from pathlib import Path
import torch
from tests.spark.training.test_train import TINY, fresh, read_clips, replace, sample
from spark.training.train import Objective, Steps, _place, shared
folder, out = Path(sys.argv[1]), Path(sys.argv[2])
rank, world, _ = _place()
checkpoint = fresh(TINY).__class__(fresh(TINY).model.eval(), fresh(TINY).names)
torch.manual_seed(1)
torch.nn.init.normal_(checkpoint.model.decoder.rotation.weight, std=0.1)
objective = Objective(checkpoint.model, TINY)
runner = shared(objective) if world > 1 else objective
batch = Steps(read_clips([folder])[0], checkpoint.names.encode, TINY, rank, world)[0]
runner(batch)[0].backward()
if rank == 0:
    torch.save({{k: p.grad for k, p in checkpoint.model.named_parameters()}}, out)
if world > 1:
    paper = replace(TINY, preset="paper")
    runner = shared(Objective(fresh(paper).model, paper))
    for _ in range(2):  # parameters without a gradient would stop the second step
        runner(batch)[0].backward()
    torch.distributed.destroy_process_group()
"""
    )
    sample(tmp_path / "samples")
    environment = os.environ | {"OMP_NUM_THREADS": "1", "PYTHONPATH": str(CHECKOUT)}
    gradients = []
    for launch in ([], ["-m", "torch.distributed.run", "--standalone", "--nproc-per-node=2"]):
        out = tmp_path / f"{len(launch)}.pt"
        done = subprocess.run(
            [sys.executable, *launch, str(script), str(tmp_path / "samples"), str(out)],
            env=environment,
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stderr
        gradients.append(torch.load(out, weights_only=True))
    one, two = gradients
    for name, gradient in one.items():
        assert (two[name] - gradient).abs().max() <= 1e-5 * gradient.abs().max(), name


def test_clips_at_30_fps() -> None:
    rig = sample_rig("walker")
    fine = to_canonical(sample_motion("walk", rig, 120.0), rig)
    coarse = at_frame_time(fine, 1 / 30)
    expected = to_canonical(sample_motion("walk", rig, 30.0), rig)
    count = min(len(coarse), len(expected))
    np.testing.assert_allclose(coarse.hips[:count], expected.hips[:count], atol=1e-6)
    assert quat_angle(coarse.rotations[:count], expected.rotations[:count]).max() < 1e-5


def test_nothing_to_train_on(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"holds no \.bvh"):
        read_clips([tmp_path])
    (tmp_path / "a.bvh").write_text("HIERARCHY\n")
    with pytest.raises(SkeletonError, match="no recording of a humanoid"):
        read_clips([tmp_path])


def test_a_handful_of_pairs_is_learned_by_heart(clips: list[TrainingClip]) -> None:
    """Where the answer is that the guesses turn as the source walks on, they come to do so."""
    config = TINY.changed("test", rate=3e-3, steps=120, batch=2, variants=16)
    checkpoint = fresh(config)
    assert isinstance(checkpoint.names, NameEncoder)
    steps = Steps(clips, checkpoint.names.encode, config, 0, 1)
    batch = max((steps[n] for n in range(12)), key=lambda b: int((b.start.unmatched >= 0).sum()))
    bent = torch.zeros_like(batch.truth.rotations)
    bent[..., 1] = 2 + 5 * batch.pose.root[:, :, None, 0]
    bent[..., 3] = -bent[..., 1]
    batch = batch._replace(truth=_corrected(batch.start, bent, batch.target))
    model = checkpoint.model.eval()
    objective, optimiser = Objective(model, config), optimiser_of(model, config)
    terms = [take_step(objective, optimiser, batch, n, config) for n in range(config.steps)]
    assert terms[-1]["fk"] < 0.1 * terms[0]["fk"]
    assert terms[-1]["rec"] < 0.1 * terms[0]["rec"]


@pytest.mark.parametrize("frames", [1, 2, 12, 13, 80])
@pytest.mark.parametrize("fps", [30.0, 60.0])
def test_an_untrained_residual_is_the_analytic_transfer(
    frames: int, fps: float, tmp_path: Path
) -> None:
    source, target = without(sample_rig("walker"), Role.NECK), sample_rig("dancer")
    motion = sample_motion("walk", sample_rig("walker"), fps).frames(0, frames)
    canonical = to_canonical(motion, source)
    new = replace(fresh(TINY), bodies=[trunk_of(body_features(target))])
    moved = learned(new, tmp_path)(canonical, target, window=12)
    copied = transfer(canonical, target)
    assert len(moved) == frames
    assert "the network fills them in" in moved.notes[-1]
    assert quat_angle(moved.rotations, copied.rotations).max() < 2e-3
    np.testing.assert_allclose(moved.hips, copied.hips, atol=1e-5)


def test_bodies_that_training_has_not_met_are_left_to_the_transfer(
    clips: list[TrainingClip], tmp_path: Path
) -> None:
    trained = learned(train(clips, TINY, tmp_path, start=fresh(TINY)), tmp_path)
    source, known = without(sample_rig("walker"), Role.NECK), sample_rig("dancer")
    canonical = to_canonical(sample_motion("walk", sample_rig("walker"), 30.0), source)
    skeleton = known.skeleton
    names = tuple(f"x{name}" for name in skeleton.names)
    unknown = replace(known, skeleton=replace(skeleton, names=names))
    moved, left = trained(canonical, known), trained(canonical, unknown)
    copied = transfer(canonical, known).rotations
    assert quat_angle(moved.rotations, copied).max() > 1e-6
    np.testing.assert_array_equal(left.rotations, copied)
    assert left.notes[-1].endswith("interpolated, or following")


def test_windows_agree_with_the_whole(clips: list[TrainingClip], tmp_path: Path) -> None:
    """Chunks, as long clips need them, against the clip in one piece: within 1e-3 of the height."""
    config = TINY.changed("test", steps=25, rate=1e-3, window=48, batch=4, save_every=100)
    bowed = [with_bowed_neck(clip) for clip in clips]
    trained = learned(train(bowed, config, tmp_path, start=fresh(config)), tmp_path)
    source, target = without(sample_rig("walker"), Role.NECK), sample_rig("dancer")
    canonical = to_canonical(sample_motion("walk", sample_rig("walker"), 30.0), source)
    whole = trained(canonical, target, window=len(canonical))
    chunks = trained(canonical, target)
    copied = transfer(canonical, target)
    assert np.abs(canonical_positions(whole) - canonical_positions(copied)).max() > 1e-4
    apart = np.abs(canonical_positions(whole) - canonical_positions(chunks)).max()
    assert apart < 1e-3 * 2 * target.hip_height


def test_the_command_line_trains_resumes_and_retargets(tmp_path: Path) -> None:
    sample(tmp_path / "samples")
    settings = replace(TINY, steps=1, name_steps=2)
    (tmp_path / "tiny.toml").write_text(toml(settings))

    def command(*args: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "spark_sim", *args],
            cwd=tmp_path,
            env=os.environ | {"PYTHONPATH": str(CHECKOUT)},
            capture_output=True,
            text=True,
        )

    run = ("train", "samples", "-o", "run", "--config", "tiny.toml")
    assert command(*run).returncode == 0
    refused = command(*run)
    assert refused.returncode == 2
    assert "--resume" in refused.stderr
    resumed = command("train", "-o", "run", "--resume", "--steps", "2")
    assert "2 steps on 6 clips" in resumed.stdout, resumed.stderr
    path = tmp_path / "run" / "checkpoint.safetensors"
    assert load_checkpoint(path).step == 2
    assert read_settings(tmp_path / "run" / "config.toml")["steps"] == 2
    for given, why in (
        (("run", "--resume", "--preset", "paper"), "trained with preset = 'tiny', not 'paper'"),
        (("run", "--resume", "--config", "tiny.toml"), "not from --config"),
        (("none", "--resume"), "no run to resume"),
    ):
        done = command("train", "-o", *given)
        assert done.returncode == 2
        assert why in done.stderr
    board = command("train", "-o", "run", "--resume", "--steps", "3", "--tensorboard")
    if importlib.util.find_spec("tensorboard"):
        reader = importlib.import_module(
            "tensorboard.backend.event_processing.event_accumulator"
        ).EventAccumulator
        events = reader(str(tmp_path / "run")).Reload()
        last = json.loads((tmp_path / "run" / "log.jsonl").read_text().splitlines()[-1])
        (written,) = events.Scalars("loss")
        assert (written.step, written.value) == (3, pytest.approx(last["loss"]))
    else:
        assert board.returncode == 2
        assert "spark-sim[tensorboard]" in board.stderr
    walk, target = "samples/walker_walk.bvh", "samples/dancer_wave.bvh"
    made = command(*("retarget", walk, "--to", target, "--method", "spark", "--checkpoint", "run"))
    assert made.returncode == 0, made.stderr
    assert (tmp_path / "walker_walk_on_dancer_wave.bvh").exists()
    lost = command(
        *("retarget", walk, "--to", target, "--force", "--method", "copy"),
        *("--checkpoint", str(path)),
    )
    assert lost.returncode == 2
    assert "checkpoint goes with" in lost.stderr
