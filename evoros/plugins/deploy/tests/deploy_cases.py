"""Champions with given mounts."""

from dataclasses import replace
from pathlib import Path

from evoros.analysis.tables.records import Record
from evoros.design.design import Design
from evoros.plugins.deploy.champion import Champion, read_champion
from evoros.robot.model import Robot
from evoros.sensor.protocol import Mount
from evoros.sensor.sonar import Sonar
from evoros.storage.champion_files import design_table, gene_table, self_sight_table
from evoros.storage.digests import describe_file, write_entries


def champion_of(record: Record, robot: Robot, mounts: list[Mount], folder: Path) -> Champion:
    """The champion of a run that has evolved these mounts on this robot."""
    sensors = {kind: Sonar() for kind in dict.fromkeys(m.sensor for m in mounts)}
    beam = record.context.beams["sonar"]
    mounted = robot.with_sensors(mounts, sensors)
    design = Design(mounted.mounts, {})
    files = {
        "robot.urdf": mounted.urdf,
        "self_sight.csv": self_sight_table(mounted),
        "robot_as_loaded.urdf": mounted.loaded_urdf,
        "design.csv": design_table({3: design}),
        "genes.csv": gene_table({3: design}, {}),
    }
    (folder / "champion").mkdir(exist_ok=True)
    for name, text in files.items():
        (folder / "champion" / name).write_text(text)
    context = replace(
        record.context, places=dict(robot.sensor_links), beams=dict.fromkeys(sensors, beam)
    )
    for name in ("status.json", "manifest.json"):
        (folder / name).write_text((record.path / name).read_text())
    written = {f"champion/{name}": describe_file(text.encode()) for name, text in files.items()}
    (folder / "digests.csv").write_text(write_entries(written))
    run = replace(record.run, path=folder)
    return read_champion(Record("random", run, context, record.values))
