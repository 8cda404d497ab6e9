"""The recordings of humanoids: one clip a rig, and every clip of the rigs that have several."""

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
"""A humanoid rig each; the first twelve of zoo that differ."""

CLIPS_OF_ONE_RIG = {
    "cmu_asf subject 01": "cmu_asf/cmu_01_*.bvh",
    "cmu_asf subject 02": "cmu_asf/cmu_02_*.bvh",
    "cmu_expmap": "cmu_expmap/test_*.bvh",
    "fair1": "animateddrawings/[dwjz]*[bdoe].bvh",
    "rokoko": "*/*rokoko*.bvh",
}
