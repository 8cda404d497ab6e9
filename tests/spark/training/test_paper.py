"""Each row of docs/paper.md, held against the code: `test_<row>`."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from spark.demo.sample import sample_rig
from spark.network.config import Config
from spark.network.features import _EXCLUDED_WORDS, BodyFeatures, body_features
from spark.rig.roles import Group, Role
from spark.rotation import quat_from_rotvec, quat_mul
from spark.sixd import sixd_from_quat
from spark.training import losses
from spark.training.attention import sinusoids
from spark.training.batch import UnpairedBatch
from spark.training.collator import Collator
from spark.training.cuts import TrainingClip
from spark.training.model import Spark
from spark.training.name_encoder import NameEncoder
from spark.training.objective import Objective, network
from spark.training.optimiser import BETAS, make_optimiser, rate_at
from spark.training.settings import TrainConfig
from spark.training.splits import TRAINING, UNSEEN, seen_characters
from spark.training.steps import Steps
from spark.training.unpaired import SHARED, UnpairedMaker
from spark.training.variants import same_body, split_body
from tests.helpers.training import SMALL, SMALL_NAMES

PAPER = TrainConfig.of("paper")
PAGE = (Path(__file__).parents[3] / "docs" / "paper.md").read_text()


def small(**changes: object) -> Spark:
    torch.manual_seed(0)
    return Spark(Config(**{**vars(Config.paper()), **SMALL, **changes}))


@pytest.fixture(scope="module")
def steps(walks: list[TrainingClip]) -> Steps:
    clips = [replace(clip, name=f"{clip.name} {n}") for clip in walks for n in range(4)]
    config = replace(PAPER, window=12, batch=4)
    return Steps(clips, NameEncoder(SMALL_NAMES).requires_grad_(False).encode, config, 0, 1)


@pytest.fixture(scope="module")
def batch(steps: Steps) -> UnpairedBatch:
    return Collator(NameEncoder().encode).unpaired(steps.maker.draws(range(3), 1)).batch()


def test_every_row_has_its_test() -> None:
    rows = re.findall(r"^\| ([a-z]+) \| ", PAGE, re.MULTILINE)
    rows = [row for row in rows if row != "row"]
    here = [name.removeprefix("test_") for name in globals() if name.startswith("test_")]
    assert sorted(rows) == sorted(set(here) - {"every_row_has_its_test"})


def test_groups() -> None:
    body = body_features(sample_rig("walker"))
    roles = [body.rig.roles.roles[j] for j in body.joints]
    members = dict(zip(Group, ({roles[k] for k in group} for group in body.groups), strict=True))
    assert len(members) == len(Group) == 6
    assert all(Role.PELVIS in members[g] for g in (Group.TORSO, Group.LEFT_LEG, Group.RIGHT_LEG))
    top = [k for k, role in enumerate(roles) if role is Role.SPINE][-1]
    for group, joints in zip(Group, body.groups, strict=True):
        assert (top in joints) == (group not in (Group.LEFT_LEG, Group.RIGHT_LEG))
    assert not network(PAPER.changed("test", ablate=["share"]), 8).share_joints


def test_pooling() -> None:
    encoder = small().encoder
    assert encoder.queries.shape[:2] == (6, 4)
    values = encoder.queries.detach().flatten()
    assert -0.5 <= values.min() < -0.4
    assert 0.4 < values.max() <= 0.5
    assert abs(float((values**2).mean()) - 1 / 12) < 0.01  # a uniform distribution's


def turned(build: str) -> BodyFeatures:
    """A sample body in a file whose joints have other axes."""
    rig = sample_rig(build)
    rng = np.random.default_rng(0)
    axes = quat_from_rotvec(rng.normal(size=(len(rig.skeleton), 3)))
    return replace(
        body_features(rig), tpose_world=quat_mul(rig.tpose, axes)[body_features(rig).joints]
    )


def test_tpose() -> None:
    """Ten of the thirteen numbers differ between joints and bodies; a pose has no velocity."""
    bodies = [turned(build) for build in ("walker", "dancer")]
    features = np.concatenate([body.tpose[1:] for body in bodies])
    varies = np.ptp(features, axis=0) > 1e-3
    assert varies.tolist() == [True] * 9 + [False] * 3 + [True]
    assert not features[:, 9:12].any()
    for body in bodies:
        np.testing.assert_allclose(body.tpose[0, :3], 0)
        np.testing.assert_allclose(body.tpose[0, 3:9], (1, 0, 0, 0, 1, 0))
        k = 5
        parent = int(body.skeleton.parents[k])
        inverse = body.turned[parent] * [1, -1, -1, -1]
        own = sixd_from_quat(quat_mul(inverse, body.turned[k]))
        np.testing.assert_allclose(body.tpose[k, 3:9], own, atol=1e-12)
        for changed in (same_body(body), split_body(body)):
            np.testing.assert_array_equal(changed.body.turned, body.turned[changed.first])
    paper, default = (network(TrainConfig.of(preset), 8) for preset in ("paper", "default"))
    assert (paper.tpose_rotations, default.tpose_rotations) == (True, False)


def test_added(batch: UnpairedBatch) -> None:
    """What is known of a joint is the same in every frame."""
    model = small(name_width=130)
    known = model.embedding.joints(batch.source)
    assert known.shape[:2] == batch.source.valid.shape  # no axis of time
    assert len(model.embedding.tpose) == 3  # linear, GELU, linear
    other = batch.source._replace(tpose=batch.source.tpose + 0.1)
    assert not torch.allclose(model.embedding.joints(other), known)


def test_mask(batch: UnpairedBatch) -> None:
    model = small(name_width=130, mask_joints=1.0).train()
    blind = model.encode(batch.pose, batch.source)
    still = batch.pose._replace(rotations=batch.pose.rotations * 0)
    assert torch.equal(blind, model.encode(still, batch.source))  # all masked: nothing is seen
    assert not torch.equal(
        model.eval().encode(batch.pose, batch.source), model.encode(still, batch.source)
    )
    assert network(PAPER, 8).mask_joints == 0.1
    assert network(PAPER.changed("test", ablate=["mask"]), 8).mask_joints == 0


def test_time(batch: UnpairedBatch) -> None:
    """A token's block sees no other token."""
    block = small().encoder.time[0]
    tokens = torch.randn(24, 12, 32)
    changed = torch.cat([tokens[:1] + 1, tokens[1:]])
    same = (block(tokens) == block(changed)).all(-1).all(-1)
    assert same.tolist() == [False] + [True] * 23
    assert network(PAPER, 8).encoder_blocks == 4


def test_noise(batch: UnpairedBatch) -> None:
    model = small(name_width=130).eval()
    latent = model.encode(batch.pose, batch.source)
    one, two = (model.decode(latent, batch.target).rotations for _ in range(2))
    assert not torch.equal(one, two)
    assert network(PAPER, 8).noise


def test_position() -> None:
    """A table that is learned, a row for each place in each group."""
    table = small().embedding.position
    assert (table.requires_grad, table.shape[:2]) == (True, (6, 16))


def test_decoder(batch: UnpairedBatch) -> None:
    """Joints of a frame hear of one another; frames do only through H."""
    model = small(name_width=130).eval()
    latent = model.encode(batch.pose, batch.source).detach()
    noise = torch.zeros(*latent.shape[:2], batch.target.valid.shape[1], latent.shape[-1])
    other = noise.clone()
    other[:, 5, 1] += 1
    a, b = (model.decode(latent, batch.target, noise=x).rotations for x in (noise, other))
    moved = ((a - b).abs().amax((0, 3)) > 1e-7).tolist()
    assert [any(frame) for frame in moved] == [t == 5 for t in range(latent.shape[1])]
    assert sum(moved[5]) > 1
    assert len(model.decoder.blocks) == model.config.decoder_blocks


def test_keys(batch: UnpairedBatch) -> None:
    """A frame's decoder sees the tokens of that frame."""
    model = small(name_width=130, noise=False).eval()
    latent = model.encode(batch.pose, batch.source).detach()
    other = latent.clone()
    other[:, 5] += 1
    a, b = (model.decode(x, batch.target).rotations for x in (latent, other))
    frames = ((a - b).abs().amax((0, 2, 3)) > 1e-6).tolist()
    assert frames == [t == 5 for t in range(latent.shape[1])]


def test_cycle(batch: UnpairedBatch) -> None:
    """Its gradient reaches the decoder, and the encoder by both ways."""
    model = small(name_width=130).train()
    terms = Objective(model, PAPER)(batch)[1]
    terms["cyc"].backward()
    for parameter in (model.decoder.rotation.weight, model.encoder.motion.weight):
        assert parameter.grad is not None
        assert parameter.grad.abs().sum() > 0


def test_losses(batch: UnpairedBatch) -> None:
    assert Objective(small(), PAPER).weights == {"rec": 1, "cyc": 20, "root": 7, "fk": 100}
    pose = batch.pose
    off = pose._replace(rotations=pose.rotations + 0.5, root=pose.root + 2)
    assert losses.reconstruction(off, pose, batch.source).item() == pytest.approx(6 * 0.25)
    assert losses.root(off, pose).item() == pytest.approx(4 + 0.25, rel=1e-5)


def test_optimiser() -> None:
    assert (PAPER.rate, PAPER.batch, PAPER.per_body, PAPER.window) == (1e-4, 16, 1, 64)
    optimiser = make_optimiser(small(), PAPER)
    assert isinstance(optimiser, torch.optim.AdamW)
    assert optimiser.defaults["betas"] == BETAS == (0.9, 0.99)


def test_characters() -> None:
    assert (len(TRAINING), len(UNSEEN)) == (12, 4)  # three of the seven are in both
    seen = seen_characters([*TRAINING, *UNSEEN], 0)
    assert {name for name, yes in seen.items() if not yes} == set(UNSEEN)


def test_joints() -> None:
    for name in ("LeftHandIndex1", "RightHandThumb2", "finger_03", "hair_l", "cloth_skirt_02"):
        assert _EXCLUDED_WORDS.search(name), name
    for name in ("LeftForeArm", "Spine1", "RightToeBase", "Neck"):
        assert not _EXCLUDED_WORDS.search(name), name


def test_split(steps: Steps) -> None:
    counts = [len(one.variant.body.joints) for one in steps.maker.characters]
    assert len(counts) == 4  # two bodies
    assert counts[1] > counts[0]
    assert counts[3] > counts[2]


def test_unpaired(steps: Steps) -> None:
    names = [clip.name for one in steps.maker.characters for clip in one.clips]
    assert len(names) == len(set(names)) == 8


def test_mixed(walks: list[TrainingClip]) -> None:
    config = PAPER.changed("test", ablate=["mix"], window=12)
    clips = [replace(clip, name=str(n)) for clip in walks for n in range(40)]
    maker = Steps(clips, NameEncoder(SMALL_NAMES).encode, config, 0, 1).maker
    one, two = ({c.name for c in maker.characters[k].clips} for k in (0, 2))
    assert 0 < len(one & two) <= SHARED == 10


def test_targets(steps: Steps) -> None:
    bodies = [one.variant.body for one in steps.maker.characters]
    assert isinstance(steps.maker, UnpairedMaker)
    draws = steps.maker.draws(range(100), 1)
    assert all(target in bodies and target is not windows.body for windows, target in draws)


def test_sources(steps: Steps, walks: list[TrainingClip]) -> None:
    """Every window's path is a piece of a recording's, as fast and as long."""
    assert isinstance(steps.maker, UnpairedMaker)
    moves = [np.linalg.norm(np.diff(clip.hips, axis=0), axis=-1) for clip in walks]
    for windows, _ in steps.maker.draws(range(10), 1):
        own = np.linalg.norm(np.diff(windows.root[0], axis=0), axis=-1)
        gaps = [
            np.abs(all_[at : at + len(own)] - own).max()
            for all_ in moves
            for at in range(len(all_) - len(own) + 1)
        ]
        assert min(gaps) < 1e-5


def test_positions() -> None:
    plain, more = (
        Spark(replace(network(PAPER.changed("test", ablate=ablate, width=32), 8)))
        for ablate in ([], ["pos"])
    )
    shapes = [{k: v.shape for k, v in m.state_dict().items()} for m in (plain, more)]
    changed = {k for k in shapes[0] if shapes[0][k] != shapes[1][k]}
    assert changed == {"encoder.motion.weight"}
    assert shapes[1]["encoder.motion.weight"][1] - shapes[0]["encoder.motion.weight"][1] == 3


def test_fk() -> None:
    assert "fk" not in Objective(small(), PAPER.changed("test", ablate=["fk"])).weights


def test_schedule() -> None:
    rates = [rate_at(n, PAPER) for n in (0, 499, 50_250, PAPER.steps - 1)]
    assert rates == pytest.approx([2e-7, 1e-4, 5.5e-5, 1e-5], rel=1e-3)


def test_decay() -> None:
    assert PAPER.weight_decay == 0.01
    matrices, others = make_optimiser(small(), PAPER).param_groups
    assert (matrices["weight_decay"], others["weight_decay"]) == (0.01, 0)
    assert PAPER.changed("test", weight_decay=0.999).weight_decay == 0.999


def test_prenorm() -> None:
    """A block's input, however large, changes what is added to it in no way."""
    block = small().encoder.time[0]
    x = torch.randn(1, 12, 32)
    gain = [block(s * x) - s * x for s in (1.0, 100.0)]
    attended = [block.time(block.norm_time(s * x)) for s in (1.0, 100.0)]
    torch.testing.assert_close(*attended, rtol=1e-3, atol=1e-3)
    assert gain[1].abs().max() < 2 * gain[0].abs().max() + 1


def test_normh(batch: UnpairedBatch) -> None:
    latent = small(name_width=130).eval().encode(batch.pose, batch.source)
    torch.testing.assert_close(latent.mean(-1), torch.zeros(latent.shape[:-1]), atol=1e-4, rtol=0)
    torch.testing.assert_close(
        latent.var(-1, correction=0), torch.ones(latent.shape[:-1]), atol=1e-2, rtol=0
    )


def test_input(batch: UnpairedBatch) -> None:
    model = small(name_width=130).eval()
    encoder = model.encoder
    assert (encoder.motion.in_features, encoder.root.in_features) == (6, 3)
    assert model.embedding.name.in_features == 130
    moved = batch.pose._replace(root=batch.pose.root + 1)
    apart = encoder._joint_features(moved, batch.source) != encoder._joint_features(
        batch.pose, batch.source
    )
    assert apart[:, :, 0].any()
    assert not apart[:, :, 1:].any()


def test_empty(batch: UnpairedBatch) -> None:
    """Whatever else there is, a group without joints says the same, and no NaN."""
    groups = batch.source.groups.clone()
    groups[:, -1] = -1
    body = batch.source._replace(groups=groups)
    latent = small(name_width=130).eval().encode(batch.pose, body)
    assert latent.isfinite().all()
    tokens = latent[:, :, -4:]
    torch.testing.assert_close(tokens, tokens[:1].expand_as(tokens))


def test_products(batch: UnpairedBatch) -> None:
    assert PAPER.bf16
    objective = Objective(small(name_width=130).eval(), PAPER)
    with torch.autocast("cpu", torch.bfloat16):
        loss, terms = objective(batch)
    assert {x.dtype for x in (loss, *terms.values())} == {torch.float32}
    assert {p.dtype for p in objective.parameters()} == {torch.float32}


def test_places(batch: UnpairedBatch) -> None:
    """The same pose in every frame gives tokens that differ in time."""
    assert not network(PAPER, 8).relative_time
    assert sinusoids(4, 8, torch.zeros(1))[0].tolist() == [0] * 4 + [1] * 4
    pose = batch.pose
    still = pose._replace(
        rotations=pose.rotations[:, :1].expand_as(pose.rotations),
        root=pose.root[:, :1].expand_as(pose.root),
    )
    latent = small(name_width=130).eval().encode(still, batch.source)
    assert (latent[:, 0] - latent[:, -1]).abs().max() > 1e-3


def test_targetplaces() -> None:
    """Encoder and decoder have one table of places."""
    names = [name for name, _ in small().named_parameters() if "position" in name]
    assert names == ["embedding.position"]


def test_names() -> None:
    assert (PAPER.names, PAPER.t5, PAPER.name_steps) == ("", "", 0)
    assert network(PAPER, 128).name_width == 128 + 2


def test_output(batch: UnpairedBatch) -> None:
    moved = small(name_width=130).eval()(batch.pose, batch.source, batch.target)
    assert moved.rotations.shape[2:] == (batch.target.valid.shape[1], 6)
    assert moved.root.shape[2] == 3


def test_canonical(steps: Steps) -> None:
    assert isinstance(steps.maker, UnpairedMaker)
    for windows, _ in steps.maker.draws(range(5), 1):
        np.testing.assert_allclose(windows.root[:, 0, :2], 0, atol=1e-6)
        hips = windows.body.skeleton.rest_positions
        ankle = hips[windows.body.contacts[0], 2]
        assert -1.2 < ankle < -0.7  # the hips are 1 high


def test_sizes() -> None:
    config = network(PAPER, 128)
    assert (config.width, config.heads, config.decoder_blocks) == (128, 4, 4)
    wide, gelu, _ = small().decoder.blocks[0].ff.children()
    assert wide.out_features == 4 * wide.in_features
    assert isinstance(gelu, torch.nn.GELU)
