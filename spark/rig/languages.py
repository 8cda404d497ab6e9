"""The words of joint names in German, Spanish, French, Italian, Portuguese and Chinese.

Latin letters stand without their accents, as `spark.rig.name_hints` reads them; of umlauts there is
the spelling with an e, too. Words that are others in English names are left out ("main", a hand).
"""


def words_of(words: str) -> frozenset[str]:
    return frozenset(words.split())


LEFT = words_of(
    "links linke linker linkes izquierda izquierdo izq gauche sinistra sinistro sx "
    "esquerda esquerdo esq"
)
RIGHT = words_of(
    "rechts rechte rechter rechtes derecha derecho droite droit destra destro dx direita direito"
)

# The axes that a robot's hinges turn about: pitch, roll and yaw.
AXES = words_of(
    "nick nicken rollen gier gieren cabeceo alabeo guinada tangage roulis lacet "
    "beccheggio rollio imbardata arfagem rolagem 俯仰 滚转 翻滚 横滚 偏航"
)

SPELLINGS = {
    word: english
    for english, words in {
        "pelvis": "becken bassin bacino pelve 骨盆",
        "hip": "huefte hufte hueft cadera hanche anca quadril 髋",
        "waist": "taille cintura 腰",
        "torso": "rumpf torse tronco tronc 躯干",
        "chest": "brust pecho poitrine petto peito 胸",
        "spine": "wirbel wirbelsaule wirbelsaeule columna colonne colonna coluna 脊柱",
        "neck": "hals nacken cuello cou collo pescoco 颈",
        "head": "kopf cabeza tete testa cabeca 头",
        "clavicle": "schluesselbein schlusselbein clavicula clavicule clavicola 锁骨",
        "shoulder": "schulter hombro epaule spalla ombro",
        "arm": "brazo bras braccio braco 手臂",
        "upper arm": "oberarm 上臂 大臂",
        "forearm": "unterarm antebrazo avantbras avambraccio antebraco 前臂 小臂",
        "elbow": "ellbogen ellenbogen codo coude gomito cotovelo",
        "wrist": "handgelenk muneca poignet polso punho pulso 手腕",
        "hand": "mano 手",
        "thigh": "oberschenkel muslo cuisse coscia coxa 大腿",
        "leg": "bein pierna jambe gamba perna 腿",
        "knee": "knie rodilla genou ginocchio joelho",
        "shin": "unterschenkel espinilla stinco canela 小腿",
        "ankle": "knoechel knochel sprunggelenk tobillo cheville caviglia tornozelo 踝 脚踝",
        "foot": "fuss fuß pie pied piede 脚",
        "toe": "zehen dedos orteils 脚趾",
        "finger": "doigt 手指",
        "thumb": "daumen pulgar pouce pollice polegar 拇指",
        "link": "连杆",
        "joint": "关节",
    }.items()
    for word in words.split()
}
