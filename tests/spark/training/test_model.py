"""Laws of the network: what padding, initialisation and time must not change."""

import pytest
import torch

from spark.network.config import Config
from spark.training import losses
from spark.training.batch import Batch
from spark.training.collator import Collator
from spark.training.cuts import TrainingClip
from spark.training.model import Spark
from spark.training.name_encoder import NameEncoder
from spark.training.pairs import PairMaker
from spark.training.residual import corrected
from spark.training.tensors import (
    Body,
    PoseTensors,
    Start,
    forward_kinematics,
    take,
    world_matrices,
)
from tests.helpers import plain_spark
from tests.helpers.training import PRESETS, SMALL, longer_walk_clip, start_of


def pad_start(start: Start, extra: int) -> Start:
    pose = pad_pose(start.pose, extra)
    return Start(*pose, torch.nn.functional.pad(start.unmatched, (0, extra), value=-1))


def pad(body: Body, extra: int) -> Body:
    """The same skeletons with `extra` joints that are none."""
    J = body.valid.shape[1]
    own = torch.arange(J, J + extra).expand(len(body.valid), -1)
    rows = ("names", "tpose", "shape", "offsets")
    padded = {row: torch.nn.functional.pad(getattr(body, row), (0, 0, 0, extra)) for row in rows}
    return body._replace(
        valid=torch.nn.functional.pad(body.valid, (0, extra)),
        parents=torch.cat([body.parents, own], 1),
        **padded,
    )


def pad_pose(pose: PoseTensors, extra: int) -> PoseTensors:
    return PoseTensors(
        torch.nn.functional.pad(pose.rotations, (0, 0, 0, extra), value=0.5), pose.root
    )


@pytest.mark.parametrize("config", PRESETS)
def test_padding_joints_change_nothing(config: Config, batch: Batch) -> None:
    torch.manual_seed(0)
    model = Spark(Config(**{**vars(config), "noise": False})).eval()
    for parameter in model.decoder.rotation.parameters():
        torch.nn.init.normal_(parameter, std=0.1)
    start = start_of(config, batch)
    with torch.no_grad():
        plain = model(batch.pose, batch.source, batch.target, start)
        padded = model(
            pad_pose(batch.pose, 3),
            pad(batch.source, 3),
            pad(batch.target, 5),
            None if start is None else pad_start(start, 5),
        )
    J = plain.rotations.shape[2]
    real = batch.target.valid[:, None, :, None]
    torch.testing.assert_close(
        plain.rotations * real, padded.rotations[:, :, :J] * real, atol=2e-5, rtol=0
    )
    torch.testing.assert_close(plain.root, padded.root, atol=2e-5, rtol=0)


def test_the_default_network_starts_as_the_analytic_transfer(batch: Batch) -> None:
    model = Spark(Config(**{**vars(Config.default()), **SMALL})).eval()
    with torch.no_grad():
        out = model(batch.pose, batch.source, batch.target, batch.start)
    torch.testing.assert_close(
        forward_kinematics(out, batch.target),
        forward_kinematics(batch.start.pose, batch.target),
        atol=1e-5,
        rtol=0,
    )
    with pytest.raises(ValueError, match="start"):
        model(batch.pose, batch.source, batch.target)


def test_only_unmatched_joints_are_corrected_and_what_follows_them(maker: PairMaker) -> None:
    """Whatever a residual network says: known joints keep their rotation in the world."""
    torch.manual_seed(0)
    batch = Collator(NameEncoder().encode).pairs([maker.draw(n, 2) for n in range(8)]).batch()
    start, J = batch.start, batch.start.unmatched.shape[1]
    moved = corrected(start, 0.1 * torch.randn_like(start.rotations), batch.target)
    before, after = (world_matrices(p.rotations, batch.target.parents) for p in (start, moved))
    kept = (start.unmatched < 0)[:, None, :, None, None]
    torch.testing.assert_close(before * kept, after * kept, atol=1e-5, rtol=0)
    own_correction = start.unmatched == torch.arange(J)
    turned = (before - after).abs().amax((1, 3, 4))
    assert (turned[own_correction] > 0.01).all()
    followers = (start.unmatched >= 0) & ~own_correction
    relative = take(before, start.unmatched.clamp(min=0)).mT @ before
    again = take(after, start.unmatched.clamp(min=0)).mT @ after
    shape = followers[:, None, :, None, None]
    torch.testing.assert_close(relative * shape, again * shape, atol=1e-5, rtol=0)
    assert torch.equal(moved.root, start.root)


@pytest.mark.parametrize("config", PRESETS)
def test_one_step_learns_and_every_weight_takes_part(config: Config, batch: Batch) -> None:
    torch.manual_seed(0)
    model = Spark(config)
    optimiser = torch.optim.AdamW(model.parameters(), lr=3e-3)
    start = start_of(config, batch)
    # Far from the analytic transfer, so that a residual network has something to learn at once.
    truth = PoseTensors(batch.truth.rotations, batch.truth.root + 0.2)
    if config.residual:
        truth = corrected(batch.start, torch.full_like(batch.start.rotations, 0.3), batch.target)
    seen: dict[str, bool] = {}
    errors = []
    for _ in range(30):
        out = model(batch.pose, batch.source, batch.target, start)
        found, true = (forward_kinematics(p, batch.target) for p in (out, truth))
        loss = losses.reconstruction(out, truth, batch.target)
        loss = loss + 100 * losses.positions(found, true, batch.target)
        loss = loss + 7 * losses.root(out, truth)
        optimiser.zero_grad()
        loss.backward()
        for name, parameter in model.named_parameters():
            moved = parameter.grad is not None and bool(parameter.grad.abs().sum() > 0)
            seen[name] = seen.get(name, False) or moved
        optimiser.step()
        errors.append(loss.item())
    assert errors[-1] < 0.5 * errors[0]
    unused = {name for name, moved in seen.items() if not moved}
    # Keys' biases shift all scores alike and cannot matter; the paper's decoder has no query.
    assert all("query" in name or "arc" in name for name in unused), unused


def test_causal_network_does_not_see_the_future(batch: Batch) -> None:
    torch.manual_seed(0)
    config = Config(**{**vars(Config.default()), **SMALL, "causal": True, "residual": False})
    model = Spark(config).eval()
    later = PoseTensors(batch.pose.rotations.clone(), batch.pose.root.clone())
    later.rotations[:, 8:] = later.rotations[:, 8:].flip(1)
    later.root[:, 8:] += 1
    with torch.no_grad():
        a = model(batch.pose, batch.source, batch.target).rotations
        b = model(later, batch.source, batch.target).rotations
    torch.testing.assert_close(a[:, :8], b[:, :8], atol=1e-5, rtol=0)
    assert (a[:, 8:] - b[:, 8:]).abs().max() > 1e-4


def test_a_group_may_have_more_joints_than_places(batch: Batch) -> None:
    """A face of many bones in one group: the last place stands for all that come after it."""
    longest = batch.source.groups.shape[-1]
    torch.manual_seed(0)
    config = Config(**{**vars(Config.paper()), **SMALL, "noise": False})
    short = Spark(Config(**{**vars(config), "max_group": 2})).eval()
    long = Spark(Config(**{**vars(config), "max_group": longest})).eval()
    weights = short.state_dict()
    places = weights["embedding.position"]
    more = places[:, -1:].expand(-1, longest - 2, -1)
    weights["embedding.position"] = torch.cat([places, more], 1)
    long.load_state_dict(weights)
    with torch.no_grad():
        a, b = (m(batch.pose, batch.source, batch.target) for m in (short, long))
    torch.testing.assert_close(a.rotations, b.rotations)


@pytest.mark.parametrize("config", PRESETS)
@pytest.mark.parametrize("share", [True, False], ids=["shared", "disjoint"])
def test_the_network_is_its_equations(
    config: Config, share: bool, walks: list[TrainingClip]
) -> None:
    """A batch of unlike skeletons, padded and fused, against one skeleton at a time in plain loops.

    The noise that the paper's decoder starts from is switched off.
    """
    torch.manual_seed(0)
    model = Spark(Config(**{**vars(config), "noise": False, "share_joints": share})).eval()
    for head in (model.decoder.rotation, model.decoder.root):
        if head is not None:
            torch.nn.init.normal_(head.weight, std=0.3)
    collator = Collator(NameEncoder().encode)
    maker = PairMaker([*walks, longer_walk_clip()], window=16, variants=8)
    draws = [maker.draw(n, 1) for n in range(6)]
    batch = collator.pairs(draws).batch()
    assert len({len(draw.target.body.joints) for draw in draws}) > 1
    with torch.no_grad():
        fused = model(batch.pose, batch.source, batch.target, start_of(config, batch))
        for k, draw in enumerate(draws):
            one = collator.pairs([draw]).batch()
            plain = plain_spark.retargeted(
                model, one.pose, one.source, one.target, start_of(config, one)
            )
            J = plain.rotations.shape[2]
            assert (fused.rotations[k : k + 1, :, :J] - plain.rotations).abs().max() < 1e-5
            assert (fused.root[k : k + 1] - plain.root).abs().max() < 1e-5
