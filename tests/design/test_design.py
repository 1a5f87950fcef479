import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Annotated, Any

import numpy as np
import pytest
from hydra import compose, initialize_config_dir
from hydra.utils import instantiate
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from evoros.base.arrays import Array
from evoros.base.checks import POSITIVE, checked, invalid
from evoros.base.errors import InputError
from evoros.base.intervals import pick_index, scale
from evoros.base.resources import bundled_folder
from evoros.design.genes import Gene, check_genes, replace_values
from evoros.design.region import Region
from evoros.design.space import DesignSpace, SensorDesign
from evoros.formats.urdf.document import UrdfDocument
from evoros.optimizer.ga import GeneticAlgorithm
from evoros.robot.model import Robot
from evoros.sensor.protocol import Mount
from evoros.sensor.sonar import Sonar


@dataclass(frozen=True)
class Cart:
    """What of a drive can evolve."""

    max_speed_mps: float = 0.4


ROBOT = Robot(
    name="cart",
    base_urdf=UrdfDocument("<robot name='cart'><link name='base'/></robot>"),
    drive=Cart(),  # type: ignore[arg-type]
    outline=np.array([[-0.2, -0.15], [0.25, -0.15], [0.25, 0.15], [-0.2, 0.15]]),
    height_m=0.2,
    mount_link="base",
    mount_z_m=0.166,
    mount_pitch_deg=12.5,
    sensor_links={
        "base": (0, 0, 0, 0),
        "mast": (-0.1, 0, 0.3, 0),
        "door": (0, 0.15, 0.1, math.pi / 2),
    },
)
FRONT = Region(x_m=[0.2, 0.25], y_m=[-0.1, 0.1], yaw_deg=[-30, 30])
SIDE = Region(x_m=[0, 0.2], y_m=0.15, yaw_deg=[40, 90], z_m=[0.1, 0.25], pitch_deg=[-5, 15])
MAST = Region(x_m=0, y_m=[-0.02, 0.02], yaw_deg=[-180, 180], z_m=0.05, pitch_deg=0, link="mast")
AVOID = Gene("controller.avoidance.range_m", 1, 4)
VOTES = Gene("controller.votes", 2, 5, whole=True)
MIXED = SensorDesign(
    sensors={"near": Sonar(range_max_m=2), "far": Sonar()},
    regions={"front": FRONT, "side": SIDE, "mast": MAST},
    number=[0, 3],
    mirrored=True,
    genes={"avoid": AVOID, "votes": VOTES},
)
ONE = SensorDesign({"sonar": Sonar()}, {"front": FRONT}, 1, False)


def configured(name: str) -> SensorDesign:
    with initialize_config_dir(str(bundled_folder("conf")), version_base="1.3"):
        design = instantiate(compose(overrides=[f"+design={name}"]).design, _convert_="all")
    assert isinstance(design, SensorDesign)
    return design


NAMES = sorted(path.stem for path in bundled_folder("conf").glob("design/*.yaml"))
SPACES = {name: configured(name).bind(ROBOT) for name in NAMES} | {"mixed": MIXED.bind(ROBOT)}


def genomes(space: DesignSpace) -> st.SearchStrategy[Array]:
    """Vectors of the closed cube; corners and the edges of categories come up often."""
    edges = st.sampled_from([0.0, 1.0, 0.2, 0.4, 0.6, 0.8, 0.5, 1 / 3, 2 / 3, np.nextafter(1, 0)])
    return arrays(np.float64, space.size, elements=st.floats(0, 1) | edges)


def inside(mount: Mount, space: DesignSpace) -> bool:
    def within(value: float, interval: Any) -> bool:
        low, high = interval if isinstance(interval, list) else (interval, interval)
        return bool(low <= value <= high)

    names = ("x_m", "y_m", "z_m", "yaw_deg", "pitch_deg")
    return any(
        mount.link == region.link
        and all(within(getattr(mount, name), getattr(region, name)) for name in names)
        for region in space.regions.values()
    )


def assert_valid(space: DesignSpace, genome: Array) -> None:
    design, decoded = space.design, space.decode(genome)
    mounts = decoded.mounts
    if design.mirrored:
        assert len(mounts) % 2 == 0
        for one, twin in zip(mounts[0::2], mounts[1::2], strict=True):
            assert (twin.y_m, twin.yaw_deg) == (-one.y_m, -one.yaw_deg)
            same = ("sensor", "link", "x_m", "z_m", "pitch_deg")
            assert all(getattr(one, name) == getattr(twin, name) for name in same)
            assert math.copysign(1, twin.y_m) == 1 or twin.y_m < 0  # never written as -0.0
        mounts = mounts[0::2]
    assert design.min_number <= len(mounts) <= design.max_number
    assert all(inside(mount, space) and mount.sensor in design.sensors for mount in mounts)
    assert list(decoded.values) == [gene.key for gene in design.genes.values()]
    for gene in design.genes.values():
        assert gene.low <= decoded.values[gene.key] <= gene.high
        assert isinstance(decoded.values[gene.key], int if gene.whole else float)


@pytest.mark.parametrize("name", SPACES)
def test_every_genome_decodes_to_a_valid_design(name: str) -> None:
    space = SPACES[name]

    @settings(max_examples=300, deadline=None)
    @given(genomes(space))
    def holds(genome: Array) -> None:
        assert_valid(space, genome)

    holds()
    for corner in (np.zeros(space.size), np.ones(space.size)):
        assert_valid(space, corner)


@pytest.mark.parametrize("step", [1.0, 0.1])
@pytest.mark.parametrize("name", SPACES)
def test_no_operator_ever_leaves_the_valid_designs(name: str, step: float) -> None:
    space = SPACES[name]
    rng = np.random.default_rng(5)
    settings = GeneticAlgorithm(
        mutation_probability=0.8, crossover_probability=0.8, mutation_step=step
    )
    search = settings.start(space, rng)
    made = 0
    while made < 1500:
        asked = search.ask()
        for individual in asked:
            assert_valid(space, individual.genome)
        search.tell(rng.random(len(asked)).tolist())
        made += len(asked)


@pytest.mark.parametrize("name", SPACES)
def test_blocks_hold_every_gene_once(name: str) -> None:
    genes = [gene for block in SPACES[name].blocks for gene in block.genes]
    assert sorted(genes) == list(range(SPACES[name].size))


@pytest.mark.parametrize("name", SPACES)
def test_every_gene_can_change_the_design_and_no_other_block(name: str) -> None:
    space = SPACES[name]
    base = np.full(space.size, 0.999)  # all sensors are there, no category is the first
    before = space.to_row(base)
    for block in space.blocks:
        for gene in block.genes:
            changed = base.copy()
            changed[gene] = 0.01
            after = space.to_row(changed)
            differs = [key for key in before if before[key] != after[key] and key in after]
            if block.name == "number":
                assert "number" in differs
                continue
            assert all(key == block.name or key.startswith(f"{block.name}_") for key in differs)
            assert differs or varies_elsewhere(space, gene, base)


def varies_elsewhere(space: DesignSpace, gene: int, base: Array) -> bool:
    """Whether the gene matters in another region (it may be constant in the last one)."""
    for share in (0.1, 0.5):
        low = np.where(np.arange(space.size) == gene, 0.0, base)
        for block in space.blocks:
            for aspect in block.aspects:
                low[list(aspect.categorical)] = share
        high = np.where(np.arange(space.size) == gene, 1.0, low)
        if space.decode(low) != space.decode(high):
            return True
    return False


def test_the_case_study_evolves_three_mirrored_sonars_in_five_regions() -> None:
    space = SPACES["six_sonars"]
    assert [block.name for block in space.blocks] == ["sensor0", "sensor1", "sensor2"]
    assert space.size == 3 * 4
    assert [(a.name, len(a.categorical), len(a.continuous)) for a in space.blocks[0].aspects] == [
        ("place", 1, 2),
        ("angle", 0, 1),
    ]
    uniform = np.random.default_rng(0).random((5000, space.size))
    regions = [space.to_row(genome)["sensor1_region"] for genome in uniform]
    for name in space.regions:  # five equal shares, four standard deviations
        assert abs(regions.count(name) - 1000) < 4 * math.sqrt(5000 * 0.2 * 0.8)
    mount = space.decode(uniform[0]).mounts[0]
    assert (mount.link, mount.z_m, mount.pitch_deg) == ("base", 0.166, 12.5)


def test_a_number_that_evolves_is_uniform_and_hides_the_last_sensors() -> None:
    space = SPACES["free_sonars"]
    uniform = np.random.default_rng(0).random((3500, space.size))
    numbers = [len(space.decode(genome).mounts) for genome in uniform]
    assert set(numbers) == set(range(7))
    assert all(abs(numbers.count(n) - 500) < 4 * math.sqrt(3500 * 6 / 49) for n in range(7))
    genome = uniform[numbers.index(2)]
    values = space.to_row(genome)
    assert values["number"] == 2
    for slot in range(6):
        assert (values[f"sensor{slot}_region"] != "") == (slot < 2)
        assert math.isfinite(float(values[f"sensor{slot}_x_m"])) == (slot < 2)


@pytest.mark.parametrize("name", SPACES)
def test_the_table_says_what_is_mounted(name: str) -> None:
    space = SPACES[name]
    for genome in np.random.default_rng(3).random((50, space.size)):
        values, design = space.to_row(genome), space.decode(genome)
        mounts = design.mounts[:: 2 if space.design.mirrored else 1]
        (one,) = space.design.sensors if len(space.design.sensors) == 1 else ("",)
        poses = ("x_m", "y_m", "yaw_deg")
        tabled = [
            (values.get(f"sensor{i}_type", one), *(values[f"sensor{i}_{name}"] for name in poses))
            for i in range(len(mounts))
        ]
        types = list(space.design.sensors)
        assert [(mount.sensor, *(getattr(mount, name) for name in poses)) for mount in mounts] == (
            sorted(tabled, key=lambda row: types.index(str(row[0])))
        )
        for gene_name, gene in space.design.genes.items():
            assert values[gene_name] == design.values[gene.key]


@pytest.mark.parametrize("name", SPACES)
def test_the_mounts_of_a_design_are_in_the_robots_order(name: str) -> None:
    space = SPACES[name]
    for genome in np.random.default_rng(6).random((50, space.size)):
        mounts = space.decode(genome).mounts
        assert ROBOT.with_sensors(mounts, space.design.sensors).mounts == mounts


@pytest.mark.parametrize("name", SPACES)
def test_genomes_are_the_same_where_only_absent_sensors_differ(name: str) -> None:
    space, rng = SPACES[name], np.random.default_rng(7)
    hidden = 0
    for genome in rng.random((100, space.size)):
        number = space.to_row(genome).get("number", space.design.max_number)
        for block in space.blocks:
            other = genome.copy()
            other[list(block.genes)] = rng.random(len(block.genes))
            absent = block.name.startswith("sensor") and int(block.name[6:]) >= int(number)
            hidden += absent
            if absent:
                assert space.same(genome, other)
            elif block.name not in ("number", "votes"):  # those have few values
                assert not space.same(genome, other)
        assert space.same(genome, genome.copy())
    assert bool(hidden) == (space.design.min_number < space.design.max_number)


def test_a_whole_number_that_stays_is_the_same_design() -> None:
    space = SensorDesign({}, {}, 0, False, {"votes": VOTES}).bind(ROBOT)
    for one in np.linspace(0, 1, 41):
        for other in np.linspace(0, 1, 41):
            equal = VOTES.value(one) == VOTES.value(other)
            assert space.same(np.array([one]), np.array([other])) == equal


def test_constants_have_no_gene() -> None:
    fixed = Region(x_m=0.2, y_m=0, yaw_deg=0)
    space = SensorDesign({"sonar": Sonar()}, {"nose": fixed}, 2, False).bind(ROBOT)
    assert (space.size, space.blocks) == (0, ())
    assert [mount.x_m for mount in space.decode(np.zeros(0)).mounts] == [0.2, 0.2]
    held = Gene("controller.held", 2, 2)
    only = SensorDesign({}, {}, 0, True, {"held": held, "avoid": AVOID}).bind(ROBOT)
    assert [block.name for block in only.blocks] == ["avoid"]
    assert only.decode(np.ones(1)).values == {"controller.held": 2, AVOID.key: 4}


@given(st.floats(0, 1), st.floats(-1e6, 1e6), st.floats(-1e6, 1e6))
@example(1.0, -0.1, -0.01)  # -0.1 + (-0.01 - -0.1) is greater than -0.01
def test_rounding_never_leaves_an_interval(gene: float, one: float, other: float) -> None:
    low, high = sorted((one, other))
    assert low <= scale(gene, low, high) <= high
    assert scale(0, low, high) == low
    assert abs(scale(1, low, high) - high) <= math.ulp(max(abs(low), abs(high), high - low))


@given(st.integers(1, 1000), st.data())
def test_each_choice_has_its_own_share_of_the_interval(count: int, data: st.DataObject) -> None:
    index = data.draw(st.integers(0, count - 1))
    assert pick_index((index + 0.5) / count, count) == index
    assert (pick_index(0.0, count), pick_index(1.0, count)) == (0, count - 1)


@pytest.mark.parametrize("bad", [[0.5] * 3, [1.0001, 0, 0], [-1e-9, 0, 0], [math.nan, 0, 0]])
def test_what_is_not_in_the_cube_is_refused(bad: list[float]) -> None:
    space = SPACES["six_sonars"]
    genome = np.array(bad if len(set(bad)) == 1 else bad + [0.5] * (space.size - 3))
    with pytest.raises(InputError, match="from 0 to 1"):
        space.decode(genome)


# Evolved values


@dataclass(frozen=True)
@checked
class Avoidance:
    range_m: Annotated[float, POSITIVE] = 2.0
    near_m: float = 1.0
    hidden: float = field(default=0, init=False)

    def __post_init__(self) -> None:
        if self.near_m > self.range_m:
            raise invalid(self, "near_m", self.near_m, "must be at most range_m")


@dataclass(frozen=True)
class Pilot:
    avoidance: Avoidance = Avoidance()
    layers: tuple[Avoidance, ...] = (Avoidance(), Avoidance())
    mode: str = "fast"
    votes: int = 3
    flag: bool = True


PARTS = {"controller": Pilot(), "robot": ROBOT, "design": ONE}


def test_a_value_is_replaced_where_its_path_leads_and_nowhere_else() -> None:
    values = {
        "controller.avoidance.range_m": 1.5,
        "controller.layers.1.near_m": 0.5,
        "controller.votes": 5,
        "robot.drive.max_speed_mps": 0.3,
        "design.sensors.sonar.range_max_m": 3.0,
    }
    changed: dict[str, Any] = replace_values(PARTS, values)
    assert changed["controller"] == Pilot(
        Avoidance(1.5), (Avoidance(), Avoidance(near_m=0.5)), votes=5
    )
    assert changed["robot"].drive.max_speed_mps == 0.3
    assert changed["robot"].outline is ROBOT.outline
    assert changed["design"].sensors == {"sonar": Sonar(range_max_m=3.0)}
    assert {"controller": Pilot(), "robot": ROBOT, "design": ONE} == PARTS
    assert replace_values(PARTS, {}) is PARTS


def test_values_that_are_valid_only_together_are_replaced_together() -> None:
    pilot = replace_values(Pilot(), {"avoidance.near_m": 3, "avoidance.range_m": 4})
    assert pilot.avoidance == Avoidance(4, 3)
    with pytest.raises(InputError, match=r"Avoidance\.near_m"):
        replace_values(Pilot(), {"avoidance.near_m": 3})


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("avoidance.rang_m", "avoidance.rang_m: must lead to an existing value.*range_m, near_m"),
        ("avoidance.hidden", "existing value"),
        ("avoidance", "a number, not a Avoidance; inside is range_m"),
        ("mode", "a number, not a str"),
        ("flag", "a number, not a bool"),
        ("votes.more", "no values inside"),
        ("layers.2.range_m", "there is 0, 1"),
        ("", "existing value"),
    ],
)
def test_a_path_that_leads_to_no_number_is_refused(path: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        replace_values(Pilot(), {path: 1.0})
    assert "\n" not in str(caught.value)


def test_genes_are_tried_at_both_ends_before_a_run() -> None:
    check_genes({"avoid": AVOID, "votes": VOTES}, PARTS)
    with pytest.raises(InputError, match=r"avoid at low.*Avoidance\.near_m"):
        check_genes({"avoid": Gene(AVOID.key, 0.5, 4)}, PARTS)
    with pytest.raises(InputError, match=r"near at high.*range_min_m"):
        check_genes({"near": Gene("design.sensors.sonar.range_min_m", 0.01, 9)}, PARTS)


def test_a_whole_gene_takes_each_value_equally_often() -> None:
    values = [VOTES.value(gene) for gene in np.linspace(0, 1, 4001)]
    assert set(values) == {2, 3, 4, 5}
    assert all(abs(values.count(value) - 1000) <= 1 for value in range(2, 6))


# What is refused, each with one line that says where


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Region([0.2, 0.1], 0, 0), r"Region\.x_m"),
        (lambda: Region(0, "left", 0), r"Region\.y_m"),  # type: ignore[arg-type]
        (lambda: Region(0, 0, [0, 361]), r"Region\.yaw_deg"),
        (lambda: Region(0, 0, None), r"Region\.yaw_deg"),  # type: ignore[arg-type]
        (lambda: Region(0, 0, 0, pitch_deg=91), r"Region\.pitch_deg"),
        (lambda: Region(0, 0, 0, z_m=[1]), r"Region\.z_m"),
        (lambda: Region(0, 0, 0, link=" "), r"Region\.link"),
        (lambda: Region(math.nan, 0, 0), r"Region\.x_m"),
        (lambda: Region(0, 0, 0, overhang_m=-0.1), r"Region\.overhang_m"),
        (lambda: Gene("optimizer.generations", 1, 2), r"Gene\.key"),
        (lambda: Gene("robot.height_m", 1, 2), r"Gene\.key"),
        (lambda: Gene("controller..x", 1, 2), r"Gene\.key"),
        (lambda: Gene(AVOID.key, 2, 1), r"Gene\.high"),
        (lambda: Gene(AVOID.key, 0.5, 2, whole=True), r"Gene\.whole"),
        (lambda: SensorDesign({}, {"front": FRONT}, 1, True), r"SensorDesign\.sensors"),
        (lambda: SensorDesign({"s": Sonar()}, {}, [0, 1], True), r"SensorDesign\.regions"),
        (lambda: SensorDesign({"s": Sonar()}, {"f": FRONT}, -1, True), r"SensorDesign\.number"),
        (lambda: SensorDesign({"s": Sonar()}, {"f": FRONT}, [2, 1], True), r"\.number"),
        (lambda: SensorDesign({"s": Sonar()}, {"": FRONT}, 1, True), r"SensorDesign\.regions"),
        (lambda: SensorDesign({}, {}, 0, True, {"sensor0_x_m": AVOID}), r"SensorDesign\.genes"),
        (lambda: SensorDesign({}, {}, 0, True, {"a": AVOID, "b": AVOID}), "twice"),
        (lambda: SensorDesign({}, {}, 0, "yes"), r"SensorDesign\.mirrored"),  # type: ignore[arg-type]
    ],
)
def test_a_bad_value_is_refused_in_one_line(make: Callable[[], object], message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        make()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("region", "mirrored", "message"),
    [
        (Region([0.2, 0.31], 0, 0), False, r"regions\.front: x .* not 0.2 to 0.31"),
        (Region(0, [0, 0.21], 0), False, r"regions\.front: y .* not 0 to 0.21"),
        (Region(0, 0, 0, link="roof"), False, r"front\.link.*roof.*base, mast, door"),
        (Region(0, 0, 0, link="mast"), False, r"front\.z_m"),
        (Region([-0.2, 0], 0, 0, z_m=0, link="mast"), False, "not -0.3 to -0.1"),
        (Region(0.06, 0, 0, z_m=0, link="door"), False, "y .* not 0.21"),
        (Region(0, 0, 0, z_m=0, link="door"), True, "mirrored"),
        (Region(0, 0, 0, z_m=5), False, r"regions\.front: z .*0\.2 m\), not 5 to 5"),
        (Region(0, 0, 0, z_m=[0.1, 0.26]), False, "z .* not 0.1 to 0.26"),
        (Region(0, 0, 0, z_m=-0.01), False, "z .* not -0.01"),
        (Region(0, 0, 0, z_m=-0.31, link="mast"), False, "z .* not -0.01"),
        (Region(0, 0, 0, z_m=0.051, link="mast"), False, "z .* not 0.351"),
        (Region(0, 0, 0, z_m=0.26, overhang_m=0), False, "z .* at most 0 m"),
        (Region([0.2, 0.26], 0, 0, overhang_m=0), False, "x .* at most 0 m"),
    ],
)
def test_a_region_away_from_the_robot_is_refused(
    region: Region, mirrored: bool, message: str
) -> None:
    design = SensorDesign({"sonar": Sonar()}, {"front": region}, 1, mirrored)
    with pytest.raises(InputError, match=message) as caught:
        design.bind(ROBOT)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "region",
    [
        Region(0.25 + 0.05, 0, [-1, 1]),
        Region(0, -0.15 - 0.05, [-1, 1]),
        Region(0, 0, [-1, 1], z_m=[0, 0.2 + 0.05]),
        Region(0, 0, [-1, 1], z_m=[-0.3, 0.05], link="mast"),
    ],
)
def test_a_region_may_stand_out_by_a_bracket(region: Region) -> None:
    def size(region: Region) -> int:
        return SensorDesign({"sonar": Sonar()}, {"edge": region}, 1, True).bind(ROBOT).size

    assert size(region) > 0
    with pytest.raises(InputError, match=r"at most 0\.049 m"):
        size(replace(region, overhang_m=0.049))


def test_the_default_place_of_a_sensor_may_be_above_what_touches_obstacles() -> None:
    flat = replace(ROBOT, height_m=0.07)
    for z_m in (None, 0.166, 0.2):
        region = Region(0, 0, [-1, 1], z_m=z_m)
        assert SensorDesign({"sonar": Sonar()}, {"top": region}, 1, True).bind(flat).size == 1
    with pytest.raises(InputError, match=r"not -0\.1"):
        FRONT.bind(replace(ROBOT, mount_z_m=-0.1), True, "design.regions.front")


def test_a_region_that_is_on_the_robot_may_have_its_twin_off_it() -> None:
    # y from -0.05 to 0.25 m
    lopsided = replace(ROBOT, outline=ROBOT.outline + np.array([0, 0.1]))
    left = {"left": Region(x_m=0, y_m=[0.1, 0.2], yaw_deg=90)}
    assert SensorDesign({"sonar": Sonar()}, left, 1, False).bind(lopsided).size == 1
    with pytest.raises(InputError, match=r"not -0\.2 to 0\.2"):
        SensorDesign({"sonar": Sonar()}, left, 1, True).bind(lopsided)
