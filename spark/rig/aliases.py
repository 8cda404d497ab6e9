"""The words of joint names in many rigs' conventions, and what they mean.

A meaning is a role's name without its side. Many words are ambiguous between rigs: "shoulder" is a
clavicle above an "arm" and an upper arm below a "collar". They say so here, with how sure the word
is, and the chain a joint stands in decides (`spark.rig.limb_roles`). The same words of other
languages are in `spark.rig.languages`.
"""

from spark.rig import languages
from spark.rig.languages import words_of

LEFT = words_of("l left lft hidari 左") | languages.LEFT
RIGHT = words_of("r right rgt rt migi 右") | languages.RIGHT

# Which joint a word means, and how surely, by the role's name without its side.
MEANINGS: dict[str, dict[str, float]] = {
    "pelvis": {"pelvis": 1.0},
    "hips": {"pelvis": 1.0},
    "hip": {"pelvis": 0.9},
    "cog": {"pelvis": 0.3},
    "root": {"pelvis": 0.2},
    "spine": {"spine": 1.0},
    "chest": {"spine": 1.0},
    "torso": {"spine": 1.0},
    "thorax": {"spine": 1.0},
    "abdomen": {"spine": 1.0},
    "waist": {"spine": 0.8},
    "back": {"spine": 0.8},
    "trunk": {"spine": 0.8},
    "lumbar": {"spine": 0.8},
    "ribcage": {"spine": 0.8},
    "ribs": {"spine": 0.8},
    "body": {"spine": 0.5},
    "ab": {"spine": 0.8},
    "neck": {"neck": 1.0},
    "head": {"head": 1.0},
    "skull": {"head": 0.9},
    "face": {"head": 0.6},
    "clavicle": {"clavicle": 1.0},
    "collar": {"clavicle": 1.0},
    "collarbone": {"clavicle": 1.0},
    "clav": {"clavicle": 1.0},
    "scapula": {"clavicle": 0.8},
    "shoulder": {"clavicle": 0.6, "upper_arm": 0.6},
    "shldr": {"clavicle": 0.4, "upper_arm": 0.8},
    "arm": {"upper_arm": 0.8, "forearm": 0.2},
    "upper arm": {"upper_arm": 1.0},
    "uarm": {"upper_arm": 1.0},
    "humerus": {"upper_arm": 1.0},
    "bicep": {"upper_arm": 0.8},
    "lower arm": {"forearm": 1.0},
    "forearm": {"forearm": 1.0},
    "farm": {"forearm": 1.0},
    "elbow": {"forearm": 1.0},
    "radius": {"forearm": 1.0},
    "ulna": {"forearm": 0.7},
    "wrist": {"hand": 1.0},
    "hand": {"hand": 0.7},
    "palm": {"hand": 0.6},
    "sided hip": {"upper_leg": 0.9},
    "hip joint": {"upper_leg": 0.2},
    "leg": {"upper_leg": 0.45, "lower_leg": 0.8},
    "upper leg": {"upper_leg": 1.0},
    "thigh": {"upper_leg": 1.0},
    "femur": {"upper_leg": 1.0},
    "lower leg": {"lower_leg": 1.0},
    "knee": {"lower_leg": 1.0},
    "calf": {"lower_leg": 1.0},
    "shin": {"lower_leg": 1.0},
    "shank": {"lower_leg": 1.0},
    "tibia": {"lower_leg": 1.0},
    "ankle": {"foot": 1.0},
    "foot": {"foot": 0.9, "toe": 0.5},
    "feet": {"foot": 0.8, "toe": 0.5},
    "ball": {"toe": 1.0},
    "toe": {"toe": 0.97},  # below a ball it is the tip
    "wing": {"wing": 1.0},
}

# Spellings of those words, some of them joined; a value's words are looked up above.
SPELLINGS = {
    "pelv": "pelvis",
    "chests": "chest",
    "abs": "ab",
    "spin": "spine",
    "thx": "thorax",
    "cspine": "neck",
    "tspine": "spine",
    "lspine": "spine",
    "up": "upper",
    "upr": "upper",
    "lo": "lower",
    "low": "lower",
    "lwr": "lower",
    "fore": "lower",
    "shldrs": "shldr",
    "sho": "shoulder",
    "wri": "wrist",
    "ank": "ankle",
    "arms": "arm",
    "elb": "elbow",
    "biceps": "bicep",
    "legs": "leg",
    "toes": "toe",
    "toebase": "toe",
    "forefoot": "toe",
    "ankles": "ankle",
    "wings": "wing",
    "haa": "hip",
    "hfe": "hip",
    "har": "hip",
    "kfe": "knee",
    "afe": "ankle",
    "fingers": "finger",
    "girdle": "clavicle",
    "uparm": "upper arm",
    # of anatomy
    "scap": "scapula",
    "sacrum": "pelvis",
    "vertebra": "spine",
    "vertebrae": "spine",
    "cervical": "neck",
    "fibula": "tibia",
    "carpus": "wrist",
    "talus": "ankle",
    "calcn": "foot",
    "phalanges": "toe",
    # MikuMikuDance, in Japanese and in Latin letters
    "下半身": "pelvis",
    "上半身": "spine",
    "首": "neck",
    "頭": "head",
    "肩": "clavicle",
    "腕": "upper arm",
    "ひじ": "elbow",
    "肘": "elbow",
    "手首": "wrist",
    "足": "thigh",
    "ひざ": "knee",
    "膝": "knee",
    "足首": "ankle",
    "つま先": "toe",
    "捩": "twist",
    "目": "eye",
    "指": "finger",
    "髪": "hair",
    "スカート": "skirt",
    "koshi": "pelvis",
    "kubi": "neck",
    "atama": "head",
    "kata": "clavicle",
    "ude": "upper arm",
    "hiji": "elbow",
    "tekubi": "wrist",
    "sebone": "spine",
    "tsumasaki": "toe",
    "ashi": "thigh",
    "hiza": "knee",
    "ashikubi": "ankle",
}

# Hinges as Boston Dynamics' Atlas calls them: a joint and the axis that it turns about.
HINGES = {
    hinge: word
    for word, hinges in {
        "back": "lbz mby ubx bkx bky bkz",
        "hip": "uhz mhx lhy hpx hpy hpz",
        "knee": "kny",
        "ankle": "uay lax akx aky",
        "shoulder": "usy shx shz",
        "elbow": "elx ely",
        "wrist": "uwy mwx lwy wrx wry",
    }.items()
    for hinge in hinges.split()
}
SPELLINGS |= HINGES | languages.SPELLINGS

ASIDE: dict[str, str] = {
    word: kind
    for kind, words in {
        "a finger": "finger thumb index middle ring pinky pinkie little metacarpal carpal 親指 "
        "人指 中指 薬指 小指",
        "a twist bone": "twist roll share",
        "a helper": "ik fk pole ctrl control target helper nub end tip leaf null dummy socket "
        "attach attachment marker imu camera cam wheel sec sub adj mch spring physics jiggle "
        "offset effector site corrective muscle headtop sensor",
        "part of the face": "eye jaw ear teeth tooth tongue brow eyebrow eyelid lid cheek lip lips "
        "nose nostril mouth chin beard oculi oris orbicularis risorius levator temporalis special",
        "hair": "hair bang bangs ponytail pigtail braid",
        "clothes": "skirt cloth cape coat sleeve belt strap scarf hood robe dress ribbon tie",
        "soft tissue": "breast bust boob pec pectoral glute butt buttock belly stomach genital",
        "a prop": "weapon sword shield gun prop holster bag hat helmet cap quiver bow item staff "
        "backpack",
        "an animal's part": "tail feather horn fin mane",
        "a foot bone": "metatarsal metatarsals heel sole",
    }.items()
    for word in words.split()
}

# Which finger a word means, below a hand.
FINGERS: dict[str, str] = {
    word: finger
    for finger, words in {
        "thumb": "thumb oyayubi 親指",
        "index": "index pointer hitosashiyubi 人指 人差指",
        "middle": "middle mid nakayubi 中指",
        "ring": "ring kusuriyubi 薬指",
        "little": "little pinky pinkie pink koyubi 小指",
    }.items()
    for word in words.split()
}
TIP = words_of("end nub tip leaf site")
# Joints inside the palm; those of a thumb, which bend as its first bone, aside.
METACARPAL = words_of("metacarpal metacarpals carpal palm in cup")

MODIFIERS = words_of("upper lower front hind rear base bend bone center c m x stretch")
NOISE = words_of(
    "fe aa ie angle jnt joint bn jt link def org bind skin sk rig j b bip biped valve mixamorig"
)
# A robot's hinge axes: "roll" is a twist bone elsewhere.
AXES = words_of("pitch roll yaw") | languages.AXES

# These mean a part on their own, beside "leg" or "arm" too.
SPECIFIC = words_of(
    "thigh femur knee calf shin shank tibia ankle foot toe ball humerus elbow radius ulna wrist "
    "hand shoulder neck head wing hips"
)
# What a name means of which "front" and a leg's word make a front leg.
FORELEG = {
    "shoulder": "clavicle",
    "scapula": "clavicle",
    "collar": "clavicle",
    "humerus": "upper_arm",
    "elbow": "forearm",
    "ankle": "hand",
    "foot": "hand",
    "hand": "hand",
}
