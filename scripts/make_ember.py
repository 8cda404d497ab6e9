"""Write Ember, the humanoid that ships with spark-sim: robots/ember/ember.xml and scene.xml.

1.32 m, 34 kg and 29 joints, as today's small humanoids have; segment lengths are a human's
(Drillis and Contini 1966) at that height, masses about de Leva's (1996) shares. No meshes.
"""

from pathlib import Path

FOLDER = Path(__file__).parents[1] / "robots" / "ember"

HEAD = """\
<mujoco model="ember">
  <!-- Ember: 1.32 m, 34 kg, 29 hinges, no meshes. Written by scripts/make_ember.py.
       At zero it stands with its arms down, facing +X; positive angles: see the axes. -->
  <compiler angle="radian" autolimits="true"/>
  <option integrator="implicitfast"/>
  <statistic center="0 0 0.7" extent="1.4" meansize="0.04"/>

  <default>
    <default class="ember">
      <joint damping="0.5" armature="0.02" frictionloss="0.2"/>
      <position inheritrange="1" kp="80" dampratio="1"/>
      <default class="leg">
        <joint armature="0.03"/>
        <position kp="150" forcerange="-120 120"/>
      </default>
      <default class="ankle">
        <joint armature="0.02"/>
        <position kp="400" forcerange="-50 50"/>
      </default>
      <default class="waist">
        <position kp="150" forcerange="-80 80"/>
      </default>
      <default class="arm">
        <joint armature="0.01"/>
        <position kp="60" forcerange="-30 30"/>
      </default>
      <default class="wrist">
        <joint armature="0.005"/>
        <position kp="20" forcerange="-10 10"/>
      </default>
      <default class="visual">
        <geom group="2" contype="0" conaffinity="0" mass="0" material="shell"/>
        <default class="joint">
          <geom material="graphite"/>
        </default>
      </default>
      <default class="collision">
        <geom group="3" type="capsule" rgba="0.3 0.6 0.9 0.4"/>
        <default class="foot">
          <geom type="box" condim="4" friction="1 0.02 0.001" priority="1"/>
        </default>
      </default>
      <site group="4" size="0.01"/>
    </default>
  </default>

  <asset>
    <material name="shell" rgba="0.93 0.93 0.91 1" specular="0.4" shininess="0.6"/>
    <material name="graphite" rgba="0.20 0.21 0.23 1" specular="0.5" shininess="0.4"/>
    <material name="ember" rgba="0.95 0.42 0.13 1" specular="0.5" shininess="0.6"/>
    <material name="visor" rgba="0.05 0.06 0.08 1" specular="0.9" shininess="0.9"/>
  </asset>

  <worldbody>
    <body name="pelvis" pos="0 0 0.74" childclass="ember">
      <freejoint name="root"/>
      <site name="imu" pos="0 0 0.02"/>
      <geom class="collision" mass="3.6" type="box" size="0.055 0.06 0.045"/>
      <geom class="visual" type="ellipsoid" size="0.072 0.095 0.058"/>
      <geom class="joint" type="cylinder" size="0.045 0.03" pos="0 0 0.05"/>
"""

LEG = """\
      <body name="{side}_hip_pitch_link" pos="0 {y:g} -0.05">
        <joint class="leg" name="{side}_hip_pitch" axis="0 1 0" range="-2.4 1.2"/>
        <geom class="joint" type="cylinder" size="0.046 0.026" quat="1 1 0 0"/>
        <geom class="collision" mass="0.9" type="sphere" size="0.045"/>
        <body name="{side}_hip_roll_link">
          <joint class="leg" name="{side}_hip_roll" axis="1 0 0" range="{roll}"/>
          <geom class="joint" type="sphere" size="0.05" pos="0 0 -0.02"/>
          <geom class="collision" mass="0.9" type="sphere" size="0.045" pos="0 0 -0.02"/>
          <body name="{side}_thigh">
            <joint class="leg" name="{side}_hip_yaw" axis="0 0 1" range="-1.2 1.2"/>
            <geom class="collision" mass="2.4" fromto="0 0 -0.08 0 0 -0.27" size="0.05"/>
            <geom class="visual" type="capsule" fromto="0 0 -0.075 0 0 -0.25" size="0.056"/>
            <geom class="visual" type="capsule" fromto="0.012 0 -0.12 0.008 0 -0.23"
              size="0.052" material="ember"/>
            <body name="{side}_shin" pos="0 0 -0.32">
              <joint class="leg" name="{side}_knee" axis="0 1 0" range="-0.05 2.5"/>
              <geom class="joint" type="cylinder" size="0.045 0.048" quat="1 1 0 0"/>
              <geom class="collision" mass="1.6" fromto="0 0 -0.03 0 0 -0.27" size="0.042"/>
              <geom class="visual" type="capsule" fromto="0 0 -0.04 0 0 -0.26" size="0.042"/>
              <geom class="visual" type="ellipsoid" pos="-0.012 0 -0.12" size="0.04 0.042 0.1"/>
              <body name="{side}_ankle_pitch_link" pos="0 0 -0.32">
                <joint class="ankle" name="{side}_ankle_pitch" axis="0 1 0" range="-0.9 0.7"/>
                <geom class="joint" type="cylinder" size="0.03 0.034" quat="1 1 0 0"/>
                <geom class="collision" mass="0.2" type="sphere" size="0.03"/>
                <body name="{side}_foot">
                  <joint class="ankle" name="{side}_ankle_roll" axis="1 0 0" range="-0.4 0.4"/>
                  <geom class="foot" mass="0.6" pos="0.045 0 -0.039" size="0.1 0.038 0.011"/>
                  <geom class="joint" type="box" pos="0.045 0 -0.043" size="0.1 0.038 0.007"/>
                  <geom class="visual" type="ellipsoid" pos="0.05 0 -0.034"
                    size="0.09 0.036 0.024"/>
                  <geom class="visual" type="capsule" fromto="-0.03 0 -0.02 0.01 0 -0.02"
                    size="0.028"/>
                  <site name="{side}_foot" pos="0.045 0 -0.05"/>
                </body>
              </body>
            </body>
          </body>
        </body>
      </body>
"""

TORSO = """\
      <body name="waist_yaw_link" pos="0 0 0.08">
        <joint class="waist" name="waist_yaw" axis="0 0 1" range="-2 2"/>
        <geom class="collision" mass="0.7" type="sphere" size="0.05"/>
        <body name="waist_roll_link">
          <joint class="waist" name="waist_roll" axis="1 0 0" range="-0.5 0.5"/>
          <geom class="joint" type="sphere" size="0.058"/>
          <geom class="collision" mass="0.7" type="sphere" size="0.05"/>
          <body name="torso">
            <joint class="waist" name="waist_pitch" axis="0 1 0" range="-0.5 0.8"/>
            <geom class="collision" mass="2.4" fromto="0 -0.03 0.09 0 0.03 0.09" size="0.068"/>
            <geom class="collision" mass="4.6" fromto="0 -0.06 0.2 0 0.06 0.2" size="0.075"/>
            <geom class="visual" type="ellipsoid" pos="0 0 0.09" size="0.068 0.085 0.085"/>
            <geom class="visual" type="ellipsoid" pos="0 0 0.19" size="0.09 0.125 0.1"/>
            <geom class="visual" type="capsule" fromto="0 -0.075 0.235 0 0.075 0.235"
              size="0.055"/>
            <geom class="visual" type="ellipsoid" pos="0.062 0 0.19" size="0.034 0.05 0.05"
              material="graphite"/>
            <geom class="visual" type="sphere" pos="0.089 0 0.195" size="0.014"
              material="ember"/>
            <geom class="joint" type="capsule" fromto="0 0 0.28 0.005 0 0.34" size="0.032"/>
            <geom class="collision" name="head" mass="1.8" type="sphere" pos="0.01 0 0.4"
              size="0.075"/>
            <geom class="visual" type="ellipsoid" pos="0.008 0 0.405" size="0.078 0.068 0.085"/>
            <geom class="visual" type="ellipsoid" pos="0.034 0 0.412" size="0.056 0.06 0.038"
              material="visor"/>
            <geom class="joint" type="cylinder" pos="0.005 0 0.405" size="0.026 0.072"
              quat="1 1 0 0"/>
            <site name="head" pos="0.01 0 0.47"/>
"""

ARM = """\
            <body name="{side}_shoulder_pitch_link" pos="0 {y:g} 0.245">
              <joint class="arm" name="{side}_shoulder_pitch" axis="0 0.94 {tilt:g}"
                range="-3 1.4"/>
              <geom class="joint" type="sphere" size="0.04"/>
              <geom class="collision" mass="0.6" type="sphere" size="0.035"/>
              <body name="{side}_shoulder_roll_link" pos="0 {step:g} 0">
                <joint class="arm" name="{side}_shoulder_roll" axis="1 0 0" range="{roll}"/>
                <geom class="visual" type="sphere" size="0.046"/>
                <geom class="collision" mass="0.6" type="sphere" size="0.04"/>
                <body name="{side}_upper_arm">
                  <joint class="arm" name="{side}_shoulder_yaw" axis="0 0 1" range="-2.3 2.3"/>
                  <geom class="collision" mass="0.9" fromto="0 0 -0.06 0 0 -0.18"
                    size="0.036"/>
                  <geom class="visual" type="capsule" fromto="0 0 -0.05 0 0 -0.18"
                    size="0.038"/>
                  <geom class="visual" type="cylinder" fromto="0 0 -0.105 0 0 -0.125"
                    size="0.0395" material="ember"/>
                  <body name="{side}_elbow_link" pos="0 0 -0.23">
                    <joint class="arm" name="{side}_elbow" axis="0 1 0" range="-2.4 0.05"/>
                    <geom class="joint" type="cylinder" size="0.034 0.036" quat="1 1 0 0"/>
                    <geom class="collision" mass="0.3" type="sphere" size="0.034"/>
                    <body name="{side}_forearm">
                      <joint class="wrist" name="{side}_wrist_roll" axis="0 0 1"
                        range="-2 2"/>
                      <geom class="collision" mass="0.6" fromto="0 0 -0.05 0 0 -0.16"
                        size="0.03"/>
                      <geom class="visual" type="capsule" fromto="0 0 -0.04 0 0 -0.155"
                        size="0.033"/>
                      <body name="{side}_wrist_pitch_link" pos="0 0 -0.2">
                        <joint class="wrist" name="{side}_wrist_pitch" axis="0 1 0"
                          range="-1.3 1.3"/>
                        <geom class="joint" type="sphere" size="0.026"/>
                        <geom class="collision" mass="0.1" type="sphere" size="0.024"/>
                        <body name="{side}_hand">
                          <joint class="wrist" name="{side}_wrist_yaw" axis="1 0 0"
                            range="-1 1"/>
                          <geom class="collision" mass="0.3" type="box" pos="0 0 -0.055"
                            size="0.03 0.014 0.04"/>
                          <geom class="visual" type="box" pos="0 0 -0.045"
                            size="0.028 0.012 0.024"/>
                          <geom class="joint" type="capsule" size="0.0095"
                            fromto="0.02 0 -0.07 0.02 0 -0.105"/>
                          <geom class="joint" type="capsule" size="0.0095"
                            fromto="0 0 -0.07 0 0 -0.11"/>
                          <geom class="joint" type="capsule" size="0.0095"
                            fromto="-0.02 0 -0.07 -0.02 0 -0.105"/>
                          <geom class="joint" type="capsule" size="0.0095"
                            fromto="0.03 0 -0.03 0.05 0 -0.065"/>
                          <site name="{side}_hand" pos="0 0 -0.06"/>
                        </body>
                      </body>
                    </body>
                  </body>
                </body>
              </body>
            </body>
"""

TAIL = """\
          </body>
        </body>
      </body>
    </body>
  </worldbody>

  <actuator>
{actuators}
  </actuator>

  <contact>
{excludes}
  </contact>

  <keyframe>
    {home}
    {tpose}
  </keyframe>
</mujoco>
"""

SCENE = """\
<mujoco model="ember scene">
  <include file="ember.xml"/>
  <visual>
    <headlight diffuse="0.6 0.6 0.6" ambient="0.3 0.3 0.3" specular="0 0 0"/>
    <global azimuth="140" elevation="-15" offwidth="1920" offheight="1080"/>
  </visual>
  <asset>
    <texture type="2d" name="floor" builtin="checker" mark="edge" rgb1="0.93 0.93 0.93"
      rgb2="0.87 0.87 0.87" markrgb="0.8 0.8 0.8" width="300" height="300"/>
    <material name="floor" texture="floor" texuniform="true" texrepeat="5 5"/>
  </asset>
  <worldbody>
    <light pos="0 0 3" dir="0 0 -1" directional="true"/>
    <geom name="floor" type="plane" size="0 0 0.05" material="floor"/>
  </worldbody>
</mujoco>
"""

LEG_JOINTS = ("hip_pitch", "hip_roll", "hip_yaw", "knee", "ankle_pitch", "ankle_roll")
WAIST_JOINTS = ("waist_yaw", "waist_roll", "waist_pitch")
ARM_JOINTS = (
    "shoulder_pitch",
    "shoulder_roll",
    "shoulder_yaw",
    "elbow",
    "wrist_roll",
    "wrist_pitch",
    "wrist_yaw",
)
CLASSES = {"hip": "leg", "knee": "leg", "ankle": "ankle", "waist": "waist", "wrist": "wrist"}


def joint_names() -> list[str]:
    """All hinges, in the order of qpos."""
    return [
        *(f"{side}_{joint}" for side in ("left", "right") for joint in LEG_JOINTS),
        *WAIST_JOINTS,
        *(f"{side}_{joint}" for side in ("left", "right") for joint in ARM_JOINTS),
    ]


def key(name: str, **angles: float) -> str:
    """A keyframe that its servos hold; angles of both sides alike, rolls and yaws mirrored."""
    values = []
    for joint_name in joint_names():
        side, _, part = joint_name.partition("_")
        mirrored = side == "right" and part.endswith(("roll", "yaw"))
        angle = angles.get(joint_name if side == "waist" else part, 0)
        values.append(-angle if mirrored else angle)
    joints = " ".join(f"{value:g}" for value in values)
    return f'<key name="{name}" qpos="0 0 0.74 1 0 0 0 {joints}" ctrl="{joints}"/>'


def ember() -> str:
    """The MJCF."""
    actuators = []
    for name in joint_names():
        part = next((word for word in CLASSES if word in name), None)
        actuators.append(
            f'    <position class="{CLASSES[part] if part else "arm"}" name="{name}" '
            f'joint="{name}"/>'
        )
    excludes = [
        f'    <exclude body1="{one}" body2="{other}"/>'
        for side in ("left", "right")
        for one, other in (
            ("pelvis", f"{side}_hip_roll_link"),
            ("pelvis", f"{side}_thigh"),
            (f"{side}_hip_pitch_link", f"{side}_thigh"),
            (f"{side}_shin", f"{side}_foot"),
            ("torso", f"{side}_shoulder_roll_link"),
            (f"{side}_shoulder_pitch_link", f"{side}_upper_arm"),
            (f"{side}_upper_arm", f"{side}_forearm"),
            (f"{side}_forearm", f"{side}_hand"),
            ("waist_roll_link", f"{side}_hip_pitch_link"),
        )
    ]
    excludes += [
        '    <exclude body1="pelvis" body2="waist_roll_link"/>',
        '    <exclude body1="pelvis" body2="torso"/>',
        '    <exclude body1="waist_yaw_link" body2="torso"/>',
    ]
    sides = (("left", 1), ("right", -1))
    legs = "".join(
        LEG.format(side=side, y=0.075 * sign, roll="-0.4 1.6" if sign > 0 else "-1.6 0.4")
        for side, sign in sides
    )
    arms = "".join(
        ARM.format(
            side=side,
            y=0.13 * sign,
            step=0.04 * sign,
            tilt=0.34 * sign,
            roll="-0.5 2.6" if sign > 0 else "-2.6 0.5",
        )
        for side, sign in sides
    )
    tail = TAIL.format(
        actuators="\n".join(actuators),
        excludes="\n".join(excludes),
        home=key("home", shoulder_pitch=0.2, shoulder_roll=0.25, elbow=-0.6),
        tpose=key("tpose", shoulder_roll=1.5708),
    )
    return HEAD + legs + TORSO + arms + tail


def main() -> None:
    FOLDER.mkdir(exist_ok=True)
    (FOLDER / "ember.xml").write_text(ember())
    (FOLDER / "scene.xml").write_text(SCENE)


if __name__ == "__main__":
    main()
