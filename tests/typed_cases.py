"""Input that provokes the messages which propose something to type, and messages without such."""

from collections.abc import Mapping
from typing import NamedTuple

DISC = '<visual><geometry><cylinder radius="0.05" length="0.03"/></geometry></visual>'
BODY = (
    '<link name="base"><collision><origin xyz="0 0 0.1"/><geometry><box size="0.4 0.2 0.1"/>'
    "</geometry></collision></link>"
)
ROLLING = '<inertial><mass value="1"/><inertia ixx="7e-4" iyy="7e-4" izz="1.25e-3"/></inertial>'
MESH = '<collision><geometry><mesh filename="{0}"/></geometry></collision>'


def wheel(name: str, x: float, y: float, axis: str = "0 0 1", parent: str = "base") -> str:
    """A wheel in a frame that is rolled by 90 degrees, with its axis in this frame."""
    return (
        f'<link name="{name}">{DISC}</link><joint name="{name}_joint" type="continuous">'
        f'<parent link="{parent}"/><child link="{name}"/>'
        f'<origin xyz="{x} {y} 0.05" rpy="-1.5707963 0 0"/><axis xyz="{axis}"/></joint>'
    )


PAIR = wheel("fl_wheel", 0.1, 0.15) + wheel("fr_wheel", 0.1, -0.15)
REAR = wheel("rl_wheel", -0.1, 0.15) + wheel("rr_wheel", -0.1, -0.15)
FIXED = PAIR.replace("wheel", "disc").replace("continuous", "fixed").replace("visual", "collision")
TURRET = (
    '<link name="turret"/><joint name="turn" type="continuous"><parent link="base"/>'
    '<child link="turret"/><axis xyz="0 0 1"/></joint>'
)
BENT = (
    '<link name="rear_frame"/><joint name="waist" type="revolute"><parent link="base"/>'
    '<child link="rear_frame"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="9" '
    'velocity="1"/></joint>'
    + wheel("rl_wheel", -0.3, 0.15, parent="rear_frame")
    + wheel("rr_wheel", -0.3, -0.15, parent="rear_frame")
)
TRAILING = "".join(
    f'<link name="{side}_fork"/><joint name="{side}_turn" type="revolute"><parent link="base"/>'
    f'<child link="{side}_fork"/><origin xyz="-0.2 {y} 0"/><axis xyz="0 0 1"/><limit lower="-1" '
    f'upper="1" effort="9" velocity="1"/></joint><transmission name="{side}"><joint '
    f'name="{side}_turn"/></transmission>' + wheel(f"{side}_wheel", -0.04, 0, parent=f"{side}_fork")
    for side, y in (("left", 0.15), ("right", -0.15))
)
ARM = '<xacro:include filename="$(find arm)/arm.xacro"/><xacro:arm/>'
XACRO = 'xmlns:xacro="http://ros.org/wiki/xacro"'
PLUGIN = '<gazebo><plugin name="m" filename="libmecanum.so"/></gazebo>'


class Robot(NamedTuple):
    """A description that is refused, and the message that it provokes."""

    key: str  # see ``test_proposals.key_of``
    content: str
    root: str = ""  # attributes of <robot>
    filled: Mapping[str, str] = {}  # words that stand for the user's names


ROBOTS = (
    Robot(
        "evoros/drive/automatic.py robot.drive.left_wheel_joints",
        BODY + FIXED + TURRET,
        filled={"LEFT": "fl_disc_joint", "RIGHT": "fr_disc_joint"},
    ),
    Robot("evoros/drive/automatic.py robot.drive.kind={}", BODY + PAIR + BENT),
    Robot("evoros/drive/automatic.py robot.drive.kind={kind}", BODY + PAIR + REAR + PLUGIN),
    Robot("evoros/drive/automatic.py robot.drive.kind={others}", BODY + PAIR + TRAILING),
    Robot(
        "evoros/drive/automatic.py robot.drive.kind={_choose_kind(pairs)}",
        BODY + (PAIR + REAR).replace("wheel", "caster"),
    ),
    Robot(
        "evoros/drive/automatic.py robot.drive.kind={_choose_kind(pairs)}",
        BODY + (PAIR + REAR).replace('"0 0 1"', '"0 1 0"'),
    ),
    Robot(
        "evoros/formats/urdf/expansion.py ++robot.arguments.{lacking[0]}=VALUE",
        BODY + PAIR + '<material name="${colour}"/>',
        filled={"VALUE": "red"},
    ),
    Robot(
        "evoros/formats/urdf/solids.py robot.missing=leave_out",
        f'<link name="base"><visual>{MESH.format("gone.stl")[11:-12]}</visual></link>' + PAIR,
    ),
    Robot(
        "evoros/formats/urdf/xacro_expansion.py ++robot.arguments.{argument[1]}=VALUE",
        BODY + PAIR + '<material name="$(arg colour)"/>',
        XACRO,
        {"VALUE": "red"},
    ),
    Robot(
        "evoros/formats/urdf/xacro_expansion.py robot.ignored_packages", BODY + PAIR + ARM, XACRO
    ),
    Robot(
        "evoros/formats/urdf/xacro_expansion.py robot.missing=box",
        BODY + PAIR.replace(DISC, ROLLING + MESH.format("gone.stl")),
    ),
    Robot(
        "evoros/formats/urdf/xacro_expansion.py robot.missing=leave_out",
        BODY.replace("</link>", f"{MESH.format('gone.stl')}</link>") + PAIR,
    ),
)


class Words(NamedTuple):
    """Overrides of a run that are refused, and the message that they provoke."""

    key: str
    words: str  # after the experiment of the tests
    filled: Mapping[str, str] = {}
    of_default: bool = False  # after the default experiment instead
    slow: bool = False


RUNS = (
    Words(
        "evoros/certificate/validation.py validation.max_trials={self.trials}",
        "validation.trials=50 validation.max_trials=10 optimizer.validation_trials=0",
    ),
    Words(
        "evoros/certificate/validation.py validation.max_trials={validation.max_trials}",
        "validation.precision=0.1 validation.trials=10 validation.max_trials=20",
    ),
    Words("evoros/config/configuration.py {name}=NAME", "world=[]", {"NAME": "maze"}),
    Words(
        "evoros/config/messages.py +{key}=...",
        "design.exclusive=[]",
        {"...": "[]"},
        of_default=True,
    ),
    Words("evoros/config/messages.py {key}=...", "+optimizer=ga", {"...": "ga"}),
    Words(
        "evoros/config/messages.py {error.full_key}=...",
        "controller=ardupilot",
        {"...": "/bin/true"},
        of_default=True,
        slow=True,
    ),
    Words(
        "evoros/controller/ardupilot_parameters.py controller/localization=exact",
        "controller=ardupilot controller.binary=/bin/true controller/localization=autopilot_gps",
        of_default=True,
    ),
    Words(
        "evoros/controller/dead_reckoning.py design=reckoning",
        "controller/localization=dead_reckoning",
        slow=True,
    ),
    Words("evoros/design/protocol.py design=around", "+design.regions.front.link=nowhere"),
    Words("evoros/design/region.py design=around", "robot=courier", slow=True),
    Words(
        "evoros/failure/combined.py failure=...",
        "failure=combined +failure@failure.failures.x=exhaustive",
        {"...": "exhaustive"},
        of_default=True,
    ),
    Words("evoros/plugins/barn/fitness.py fitness=barn", "fitness=barn", slow=True),
    Words("evoros/mission/scenario.py simulator=planar", "agents=oncoming", slow=True),
    Words("evoros/mission/scenario.py world", "+world.x.a=1", {"...": "maze"}),
    Words(
        "evoros/mission/scenario.py world=case_study",
        "~world.boxes ~world.maze ~world.blocks",
        of_default=True,
    ),
    Words("evoros/mission/scenario.py simulator=planar", "walkers=people", slow=True),
    Words(
        "evoros/optimizer/history.py +measure@descriptors.front=front_coverage",
        "optimizer=map_elites ~descriptors",
        of_default=True,
        slow=True,
    ),
    Words(
        "evoros/optimizer/nsga2.py optimizer=nsga2",
        "optimizer=nsga2 ~objectives.robustness",
        of_default=True,
        slow=True,
    ),
    Words("evoros/optimizer/protocol.py optimizer=random_search", "design.number=0"),
)
