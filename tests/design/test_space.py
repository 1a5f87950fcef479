"""Design spaces: every genome decodes to a valid design."""

import math
from collections.abc import Sequence
from itertools import product

import numpy as np
import pytest
from design_cases import AVOID, FRONT, ROBOT, SIDE, SPACES, VOTES
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.design.genes import Gene
from evoros.design.region import Region
from evoros.design.space import DesignSpace, SensorDesign
from evoros.design.team import TeamSpace
from evoros.optimizer.ga import GeneticAlgorithm
from evoros.optimizer.protocol import Goals, Score
from evoros.robot.seen import find_seen
from evoros.sensor.protocol import Mount, add_prices
from evoros.sensor.sonar import Sonar

WIDE = {"front": FRONT, "side": SIDE}
EXCLUSIVE = SensorDesign({"sonar": Sonar()}, WIDE, 3, mirrored=False, exclusive=True).bind(ROBOT)


def genomes(space: DesignSpace) -> st.SearchStrategy[Array]:
    """Vectors of the closed cube; corners and the edges of categories come up often."""
    edges = st.sampled_from([0.0, 1.0, 0.2, 0.4, 0.6, 0.8, 0.5, 1 / 3, 2 / 3, np.nextafter(1, 0)])
    return arrays(np.float64, space.size, elements=st.floats(0, 1) | edges)


def inside(mount: Mount, space: DesignSpace) -> bool:
    return any(
        mount.link == region.link
        and all(
            low <= getattr(mount, name) <= high
            for name, (low, high) in region.ranges.items()
            if name != "arc" and (name != "yaw_deg" or "arc" not in region.ranges)
        )
        for region in space.regions.values()
    )


def list_placed(space: DesignSpace, mounts: Sequence[Mount]) -> list[Mount]:
    """Those sensors that are in regions; all others are fixed, in every design."""
    placed = [mount for mount in mounts if mount.sensor in space.design.placed_types]
    assert [mount for mount in mounts if mount not in placed] == list(space.fixed)
    return placed


def assert_valid(space: DesignSpace, genome: Array) -> None:
    design, decoded = space.design, space.decode(genome)
    mounts = list_placed(space, decoded.mounts)
    if design.mirrored:
        assert len(mounts) % 2 == 0
        for one, twin in zip(mounts[0::2], mounts[1::2], strict=True):
            assert (twin.y_m, twin.yaw_deg) == (-one.y_m, -one.yaw_deg)
            same = ("sensor", "link", "x_m", "z_m", "pitch_deg")
            assert all(getattr(one, name) == getattr(twin, name) for name in same)
            assert math.copysign(1, twin.y_m) == 1 or twin.y_m < 0  # never written as -0.0
        mounts = mounts[0::2]
    least = min(design.min_number, 1) if design.exclusive else design.min_number
    assert least <= len(mounts) <= design.max_number
    assert all(inside(mount, space) and mount.sensor in design.sensors for mount in mounts)
    assert list(decoded.values) == [gene.key for gene in design.genes.values()]
    for gene in design.genes.values():
        assert gene.low <= decoded.values[gene.key] <= gene.high
        assert isinstance(decoded.values[gene.key], int if gene.whole else float)


@pytest.mark.parametrize("name", SPACES)
def test_every_genome_decodes_to_a_valid_design(name: str) -> None:
    space = SPACES[name]

    @settings(max_examples=25)
    @given(genomes(space))
    def holds(genome: Array) -> None:
        assert_valid(space, genome)

    holds()
    for corner in (np.zeros(space.size), np.ones(space.size)):
        assert_valid(space, corner)


@pytest.mark.parametrize("step", [1.0, 0.1])
@pytest.mark.parametrize("name", sorted({*SPACES} - {"challenge_lidar"}))  # it has no genes
def test_no_operator_ever_leaves_the_valid_designs(name: str, step: float) -> None:
    space = SPACES[name]
    rng = np.random.default_rng(5)
    settings = GeneticAlgorithm(
        mutation_probability=0.8, crossover_probability=0.8, mutation_step=step
    )
    search = settings.start(TeamSpace({"": space}), Goals(), rng)
    made = 0
    while made < 200:
        asked = search.ask()
        for individual in asked:
            assert_valid(space, individual.genome)
        search.tell({one.id: Score(rng.random()) for one in asked})
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
            if not space.design.exclusive:  # otherwise it may leave out another sensor
                assert all(key == block.name or key.startswith(f"{block.name}_") for key in differs)
            assert differs or varies_elsewhere(space, gene, base)


@settings(max_examples=40)
@given(st.deferred(lambda: genomes(SPACES["places"])), st.permutations(range(4)))
def test_exclusive_regions_carry_one_sensor_each_in_their_order(
    genome: Array, order: list[int]
) -> None:
    space = SPACES["places"]
    design, names = space.decode(genome), list(space.regions)
    chosen = {int(min(gene * len(names), len(names) - 1)) for gene in genome.tolist()}
    row = space.to_row(genome)
    regions = [row[f"sensor{i}_region"] for i in range(4)]
    assert [names.index(str(name)) for name in regions if name] == sorted(chosen)
    assert regions[len(chosen) :] == [""] * (4 - len(chosen))
    assert [row[f"sensor{i}_x_m"] for i in range(len(chosen))] == [m.x_m for m in design.mounts]
    assert space.decode(genome[order]) == design  # a set has no order


@given(genomes(EXCLUSIVE))
def test_an_exclusive_region_carries_the_first_sensor_that_chooses_it(genome: Array) -> None:
    carried: dict[str, tuple[Mount, ...]] = {}
    for mounts, region in EXCLUSIVE.mount_slots(genome):
        carried.setdefault(region, mounts)
    expected = [mount for region in EXCLUSIVE.regions for mount in carried.get(region, ())]
    assert list(EXCLUSIVE.decode(genome).mounts) == expected


def test_exclusive_regions_have_every_set_of_places() -> None:
    space = SPACES["places"]
    centres = (np.arange(8) + 0.5) / 8
    designs = {space.decode(centres[list(chosen)]).mounts for chosen in product(range(8), repeat=4)}
    assert len(designs) == sum(math.comb(8, size) for size in range(1, 5))


@pytest.mark.parametrize("name", SPACES)
def test_the_middle_has_different_places_where_regions_are_exclusive(name: str) -> None:
    space = SPACES[name]
    if space.design.exclusive:
        assert len(space.decode(space.middle).mounts) == space.design.max_number
    else:
        assert space.middle.tolist() == [0.5] * space.size
    team = TeamSpace({"": space, "second": space})
    assert team.middle.tolist() == [*space.middle, *space.middle]
    second = {space.size + gene: count for gene, count in space.levels.items()}
    assert team.levels == {**space.levels, **second}


@pytest.mark.parametrize("name", ["six_sonars", "challenge_lidar", "priced_pairs"])
def test_a_design_sees_and_costs_what_its_slots_and_its_fixed_sensors_do(name: str) -> None:
    space = SPACES[name]
    genome = np.random.default_rng(2).random(space.size)
    slots, fixed = TeamSpace({"": space}).view(genome, 2.0)
    mounts = space.decode(genome).mounts
    seen = find_seen(space.robot.with_sensors(mounts, space.design.sensors), 2.0)
    assert (
        np.sum([view.counts for view in [*slots, fixed]], axis=0).tolist()
        == seen.sum(axis=0).tolist()
    )
    price = add_prices(mounts, space.design.sensors)
    assert sum(view.price for view in [*slots, fixed]) == pytest.approx(price)


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
    uniform = np.random.default_rng(0).random((2500, space.size))
    regions = [space.to_row(genome)["sensor1_region"] for genome in uniform]
    for name in space.regions:  # five equal shares, four standard deviations
        assert abs(regions.count(name) - 500) < 4 * math.sqrt(2500 * 0.2 * 0.8)
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
    for genome in np.random.default_rng(3).random((25, space.size)):
        values, design = space.to_row(genome), space.decode(genome)
        mounts = list_placed(space, design.mounts)[:: 2 if space.design.mirrored else 1]
        types = space.design.placed_types
        (one,) = types if len(types) == 1 else ("",)
        poses = ("x_m", "y_m", "yaw_deg")
        tabled = [
            (values.get(f"sensor{i}_type", one), *(values[f"sensor{i}_{name}"] for name in poses))
            for i in range(len(mounts))
        ]
        assert [(mount.sensor, *(getattr(mount, name) for name in poses)) for mount in mounts] == (
            sorted(tabled, key=lambda row: types.index(str(row[0])))
        )
        for gene_name, gene in space.design.genes.items():
            assert values[gene_name] == design.values[gene.key]


@pytest.mark.parametrize("name", SPACES)
def test_the_mounts_of_a_design_are_in_the_robots_order(name: str) -> None:
    space = SPACES[name]
    for genome in np.random.default_rng(6).random((25, space.size)):
        mounts = space.decode(genome).mounts
        assert ROBOT.with_sensors(mounts, space.design.sensors).mounts == mounts


@pytest.mark.parametrize("name", SPACES)
def test_genomes_are_the_same_where_only_absent_sensors_differ(name: str) -> None:
    space, rng = SPACES[name], np.random.default_rng(7)
    same = TeamSpace({"": space}).same
    hidden = 0
    for genome in rng.random((40, space.size)):
        count = space.to_row(genome).get("number", space.design.max_number)
        for block in space.blocks:
            other = genome.copy()
            other[list(block.genes)] = rng.random(len(block.genes))
            absent = block.name.startswith("sensor") and int(block.name[6:]) >= int(count)
            hidden += absent
            if absent:
                assert same(genome, other)
            elif not (
                space.design.exclusive or space.levels.keys() >= set(block.genes)
            ):  # few values
                assert not same(genome, other)
        assert same(genome, genome.copy())
    assert bool(hidden) == (space.design.min_number < space.design.max_number)


def test_a_whole_number_that_stays_is_the_same_design() -> None:
    space = TeamSpace({"": SensorDesign({}, {}, 0, False, {"votes": VOTES}).bind(ROBOT)})
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


@pytest.mark.parametrize("bad", [[0.5] * 3, [1.0001, 0, 0], [-1e-9, 0, 0], [math.nan, 0, 0]])
def test_what_is_not_in_the_cube_is_refused(bad: list[float]) -> None:
    space = SPACES["six_sonars"]
    genome = np.array(bad if len(set(bad)) == 1 else bad + [0.5] * (space.size - 3))
    with pytest.raises(InputError, match="from 0 to 1"):
        space.decode(genome)
