"""The recordings of humanoids."""

ONE_A_RIG = (
    "zoo/ad_cmu1.bvh",
    "zoo/ad_fair1_zup.bvh",
    "zoo/ad_rokoko_mixamo.bvh",
    "zoo/cmu_asf_cm.bvh",
    "zoo/cmu_cgspeed_31j.bvh",
    "zoo/cmu_max_131.bvh",
    "zoo/cmu_scaled_metre.bvh",
    "zoo/m2m_human.bvh",
    "zoo/makehuman_face.bvh",
    "zoo/makehuman_tpose_163.bvh",
    "zoo/makehuman_walk.bvh",
    "zoo/reactidle_blender.bvh",
)
"""A humanoid rig each."""

EVERY_BODY = (
    *ONE_A_RIG,
    "zoo/makehuman_zombie.bvh",
    "cmu_asf/cmu_*_01.bvh",
    "cmu_expmap/test_walking_1.bvh",
    "reactidle/*.bvh",
    "animateddrawings/*.bvh",
    "mesh2motion/human*.bvh",
    "makehuman/*.bvh",
)
"""Every humanoid body of the recordings, at least once: subjects differ in their bones."""
