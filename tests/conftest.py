"""Fixtures that tests of several packages share."""

import os
import tempfile
from pathlib import Path

import tests.helpers.typecheck  # noqa: F401  (what pyproject.toml names, before it is asked for)

# One thread a process, here and in what tests start: two workers on two cores, each with threads
# for both, take several times as long. Before anything that reads it is imported.
os.environ.setdefault("OMP_NUM_THREADS", "1")
# The laws are those of a CPU, to the bit, whatever the machine has (docs/training.md on GPUs).
os.environ.setdefault("CUDA_VISIBLE_DEVICES", "")

# Bytecode is kept, or each program that tests start would compile all of ours.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# Compiled models are kept for the time of the tests, and not in the user's own cache.
if "PYTEST_XDIST_WORKER" not in os.environ:
    _CACHE = tempfile.TemporaryDirectory(prefix="spark-sim-tests-")
    os.environ["XDG_CACHE_HOME"] = _CACHE.name

import pytest

import sim  # noqa: F401  (it chooses how MuJoCo draws before a test imports MuJoCo)
import spark_sim
from robots.model.known import known
from robots.model.morphology import Morphology
from tests.helpers.recordings import DATA

# What `make quick` leaves out: files and tests that start processes, train, render in a browser or
# solve for seconds. Whatever runs on a real recording is left out too.
SLOW = (
    "tests/fuzz/",
    "tests/robots/formats/test_formats.py::test_a_changed_model_is_said_and_another_refused",
    "tests/robots/formats/test_formats.py::test_a_model_is_found_where_one_works_and_where_older_files_say",
    "tests/robots/formats/test_formats.py::test_an_included_model_that_changed_is_seen",
    "tests/robots/formats/test_formats.py::test_a_model_is_found_where_it_lay_while_it_is_the_same",
    "tests/robots/formats/test_trackers.py::test_spoilt_files_end_in_an_error_that_says_so",
    "tests/robots/model/test_followers.py::test_followers_are_where_their_leaders_take_them",
    "tests/robots/model/test_followers.py::test_what_follows_is_solved_for_and_not_overwritten",
    "tests/robots/model/test_languages.py::test_a_robot_whose_hinges_alone_have_names",
    "tests/robots/model/test_morphology.py",
    "tests/robots/model/test_splayed.py",
    "tests/robots/model/test_urdf.py",
    "tests/robots/solver/test_collision.py::test_fingers_are_carried_by_the_hand",
    "tests/robots/solver/test_collision.py::test_what_is_near_is_found_among_all_spheres",
    "tests/robots/solver/test_contacts.py::test_a_leg_that_stays_up_neither_stands_nor_lifts_the_body",
    "tests/robots/solver/test_contacts.py::test_feet_that_pass_over_the_floor_are_said_to_carry_nothing",
    "tests/robots/solver/test_contacts.py::test_a_walk_in_place_walks_on_a_robot",
    "tests/robots/solver/test_floor.py::test_a_trunk_lifts_the_shoulder_that_no_arm_can_lift",
    "tests/robots/solver/test_floor.py::test_what_nobody_moves_is_over_the_floor_with_what_carries_it",
    "tests/robots/solver/test_floor.py::test_who_stands_on_tiptoe_does_not_sink",
    "tests/robots/solver/test_marching.py::test_folded_arms_that_hardly_move_are_not_thrown",
    "tests/robots/solver/test_marching.py::test_marching_begins_and_ends_with_what_leads_there",
    "tests/robots/solver/test_marching.py::test_spells_are_marched_through_as_each_alone",
    "tests/robots/solver/test_own_body.py",
    "tests/robots/solver/test_resting.py::test_a_palm_lies_still_though_the_source_s_turns_with_its_arm",
    "tests/robots/solver/test_resting.py::test_a_robot_without_wrists_goes_on_the_ends_of_its_arms",
    "tests/robots/solver/test_resting.py::test_all_fours_of_a_robot_with_other_limbs_lie_on_the_ground",
    "tests/robots/solver/test_resting.py::test_hands_and_knees_stay_where_they_are_while_the_body_sways",
    "tests/robots/solver/test_resting.py::test_hands_on_which_arms_turn_hardly_slide",
    "tests/robots/solver/test_resting.py::test_shoulders_stay_where_they_lie_while_the_body_sways",
    "tests/robots/solver/test_resting.py::test_they_do_on_a_robot_whose_shapes_collide_with_nothing",
    "tests/robots/solver/test_resting.py::test_who_hovers_on_all_fours_is_let_down",
    "tests/robots/solver/test_solve.py",
    "tests/robots/solver/test_stretches.py::test_a_walk_in_stretches_is_the_walk",
    "tests/robots/solver/test_target.py",
    "tests/robots/solver/test_wide_hands.py::test_polishing_does_not_lead_hands_into_thighs",
    "tests/robots/stream/test_noise_filter.py::test_a_trembling_walk_keeps_its_contacts",
    "tests/robots/stream/test_stream.py::test_an_arm_that_is_wound_up_when_the_source_stops_finds_its_way",
    "tests/robots/stream/test_stream.py::test_hands_and_knees_of_one_who_crawls_are_not_in_the_floor",
    "tests/robots/stream/test_stream.py::test_hands_that_hang_beside_a_wide_trunk_are_not_in_it",
    "tests/robots/stream/test_stream.py::test_no_limb_stays_lost_while_the_source_goes_on",
    "tests/robots/stream/test_stream.py::test_soles_do_not_sink_where_a_body_lands_hard",
    "tests/robots/stream/test_stream.py::test_the_bars_hold_on_real_clips",
    "tests/robots/stream/test_stream.py::test_the_bars_hold_on_the_walk",
    "tests/robots/stream/test_stream.py::test_the_public_name_takes_what_retarget_takes",
    "tests/robots/stream/test_stream.py::test_what_lies_on_the_ground_carries",
    "tests/scripts/",
    "tests/sim/body/test_names.py",
    "tests/sim/physics/",
    "tests/sim/report/test_compare_page.py::test_a_finding_goes_to_its_moment_in_the_replay",
    "tests/sim/report/test_ends.py::test_a_clean_walk_is_clean_wherever_it_is_cut",
    "tests/sim/report/test_limbs.py::test_an_arm_that_is_thrown_once_is_to_be_mended",
    "tests/sim/report/test_limbs.py::test_what_the_source_does_a_moment_later_is_no_throw",
    "tests/sim/report/test_page.py",
    "tests/sim/report/test_page_reading.py",
    "tests/sim/report/test_robots.py::test_every_robot_stands_with_its_soles_on_the_floor",
    "tests/sim/test_template.py::test_the_policy_stops_what_would_slip_through",
    "tests/sim/view/test_page_controls.py",
    "tests/sim/view/test_view.py::test_page_moves_in_a_browser",
    "tests/spark/demo/test_sample.py::test_the_report_finds_nothing_to_mend",
    "tests/spark/evaluation/test_equal.py",
    "tests/spark/evaluation/test_evaluate.py",
    "tests/spark/network/test_forward.py::test_onnx_is_the_network",
    "tests/spark/network/test_retarget.py::test_windows_agree_with_the_whole",
    "tests/spark/rig/test_any_tree.py",
    "tests/spark/rig/test_name_votes.py::test_votes_find_misspelt_roles",
    "tests/spark/rig/test_role_assignment.py::test_meaningless_names",
    "tests/spark/rig/test_tpose.py::test_clips_of_a_rig_share_its_tpose",
    "tests/spark/test_blocks.py::test_retargeting_in_blocks",
    "tests/spark/training/test_compiling.py::test_a_run_is_one_graph",
    "tests/spark/training/test_dataset.py",
    "tests/spark/training/test_name_encoder.py::test_names_are_learned",
    "tests/spark/training/test_splits.py::test_a_flat_folder_splits_by_name",
    "tests/spark/training/test_train.py",
    "tests/spark/transfer/test_analytic.py::test_every_pair_of_humanoids_keeps_limb_directions",
    "tests/spark_sim/live/test_session.py",
    "tests/spark_sim/shelf/test_batch.py::test_killed_at_random_moments_it_resumes_to_the_same_bytes",
    "tests/spark_sim/shelf/test_processes.py",
    "tests/spark_sim/shelf/test_ray.py",
    "tests/spark_sim/shelf/test_report.py",
    "tests/spark_sim/test_batch_command.py",
    "tests/spark_sim/test_cli.py",
    "tests/spark_sim/test_hostile_names.py",
    "tests/spark_sim/test_odd_files.py",
    "tests/spark_sim/test_physics_command.py",
    "tests/spark_sim/test_policy_command.py",
    "tests/spark_sim/test_rates.py",
    "tests/spark_sim/test_rig_page.py",
    "tests/spark_sim/test_train_command.py",
    "tests/test_packaging.py",
    "tests/test_readme.py",
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        callspec = getattr(item, "callspec", None)
        values = callspec.params.values() if callspec else ()
        recorded = any(isinstance(value, Path) and value.is_relative_to(DATA) for value in values)
        if recorded or item.nodeid.startswith(SLOW):
            item.add_marker(pytest.mark.slow)


@pytest.fixture(scope="session")
def samples(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The demo motions: tests read here and write elsewhere."""
    folder = tmp_path_factory.mktemp("samples")
    spark_sim.sample(folder)
    return folder


@pytest.fixture(scope="session")
def walk_path(samples: Path) -> Path:
    return samples / "walker_walk.bvh"


@pytest.fixture(scope="session")
def walk(walk_path: Path) -> spark_sim.Clip:
    """A second of it."""
    clip = spark_sim.load(walk_path)
    assert isinstance(clip, spark_sim.Clip)
    return clip.part(0.0, 1.0)


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Sample motions as downloads lie: a folder a character."""
    folder = tmp_path_factory.mktemp("downloads")
    for path in spark_sim.sample(folder):
        body, motion = path.stem.split("_", 1)
        (folder / body).mkdir(exist_ok=True)
        path.rename(folder / body / f"{motion}.bvh")
    return folder


@pytest.fixture(scope="session")
def ember() -> Morphology:
    """The robot that ships."""
    return known("robot")
