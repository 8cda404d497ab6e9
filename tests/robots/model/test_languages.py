"""A robot is the same robot in whichever language its hinges are called."""

import re
from pathlib import Path

import pytest

from robots.model.known import known
from robots.model.mjcf import read_mjcf
from robots.model.understand import understand_robot
from robots.registry import find
from spark.rig.name_hints import read_names

ENGLISH = [
    *("left", "right", "hip", "knee", "ankle", "shoulder", "elbow", "wrist", "waist"),
    *("pitch", "roll", "yaw"),
]
LANGUAGES = {
    "German": "links rechts hüfte knie knöchel schulter ellbogen handgelenk taille nick roll gier",
    "German, in ASCII": "links rechts huefte knie knoechel schulter ellenbogen handgelenk taille "
    "nick roll gier",
    "Spanish": "izquierda derecha cadera rodilla tobillo hombro codo muñeca cintura cabeceo "
    "alabeo guiñada",
    "French": "gauche droite hanche genou cheville épaule coude poignet taille tangage roulis "
    "lacet",
    "Italian": "sinistra destra anca ginocchio caviglia spalla gomito polso cintura beccheggio "
    "rollio imbardata",
    "Portuguese": "esquerda direita quadril joelho tornozelo ombro cotovelo punho cintura arfagem "
    "rolagem guinada",
    "Chinese": "左 右 髋 膝 踝 肩 肘 手腕 腰 俯仰 滚转 偏航",
}
ROBOT = find("robot").read_text()
HINGES = re.findall(r'<joint class="[a-z]+" name="(\w+)"', ROBOT)


def called(name: str, language: str) -> str:
    words = dict(zip(ENGLISH, LANGUAGES[language].split(), strict=True))
    return "_".join(words[word] for word in name.split("_"))


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_robot_whose_hinges_alone_have_names(language: str, tmp_path: Path) -> None:
    """Bodies are numbered, so that hinges and build say which is which."""
    text = re.sub(r'(<body name=)"\w+"', lambda m: f'{m[1]}"teil"', ROBOT)
    for k in range(text.count('"teil"')):
        text = text.replace('"teil"', f'"teil{k}"', 1)
    for hinge in HINGES:
        text = re.sub(rf'"{hinge}"', f'"{called(hinge, language)}"', text)
    text = re.sub(r"<(sensor|contact|keyframe)>.*?</\1>", "", text, flags=re.DOTALL)
    path = tmp_path / "robot.xml"
    path.write_text(text, encoding="utf-8")
    true, found = known("robot"), understand_robot(read_mjcf(path))
    assert found.rig.roles.roles == true.rig.roles.roles


@pytest.mark.parametrize("language", LANGUAGES)
def test_hinges_say_what_they_say_in_english(language: str) -> None:
    plain = read_names(HINGES)
    for name, hint, other in zip(
        HINGES, plain, read_names([called(hinge, language) for hinge in HINGES]), strict=True
    ):
        assert (other.side, other.aside) == (hint.side, hint.aside), name
        part, found = (max(h.parts, key=h.parts.__getitem__) for h in (hint, other))
        # In Japanese rigs the shoulder's character is a collarbone.
        assert found == part or (language, found) == ("Chinese", "clavicle"), name
