// Decodes the embedded missions (see playback.py) and finds their state at a time.

/** Returns the running sums of differences; null becomes NaN. */
function sum(differences, unit) {
  const values = new Float64Array(differences.length);
  let total = 0;
  differences.forEach((difference, i) => {
    if (difference !== null) total += difference;
    values[i] = difference === null ? NaN : total * unit;
  });
  return values;
}

/** Returns the values at n records from [first record, value] of each change. */
function fill(changes, n) {
  const values = new Int32Array(n);
  changes.forEach(([first, value]) => values.fill(value, first));
  return values;
}

/** Decodes a mission to arrays [s, m, rad]; readings are NaN while a sensor is silent. */
function decode(raw) {
  const n = raw.x.length;
  const time = sum(fill(raw.time, n), 1e-3);
  const poses = ({ x, y, yaw }) => ({ x: sum(x, 1e-3), y: sum(y, 1e-3), yaw: sum(yaw, 1e-3) });
  return {
    ...raw,
    time,
    ...poses(raw),
    agents: raw.agents.map((agent) => ({ time, ...poses(agent) })),
    walkers: raw.walkers.map(({ name, radius, x, y }) => (
      { name, radius, time, x: sum(x, 1e-3), y: sum(y, 1e-3), yaw: new Float64Array(n) })),
    mode: fill(raw.mode, n),
    contact: fill(raw.contact, n),
    readings: raw.readings.map((readings) => sum(readings, 1e-3)),
    sectors: raw.sectors.map((sectors) => sectors && sectors.map((each) => sum(each, 1e-3))),
    signals: raw.signals.map((channels) => channels.map((each) => sum(each, 1e-3))),
  };
}

/** Returns the last record at or before a time. */
function recordAt(times, time) {
  let low = 0, high = times.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (times[middle] <= time + 1e-9) low = middle;
    else high = middle - 1;
  }
  return low;
}

/** Interpolates the pose between a record and the next. */
function poseAt(mission, last, time) {
  const next = Math.min(last + 1, mission.time.length - 1);
  const span = mission.time[next] - mission.time[last];
  const share = span > 0 ? Math.min(1, (time - mission.time[last]) / span) : 0;
  const between = (column) => column[last] + share * (column[next] - column[last]);
  return { x: between(mission.x), y: between(mission.y), yaw: between(mission.yaw) };
}

/** Returns the fault of the sensor of a number, and how far it has grown, from 0 to 1; or null. */
function faultOf(now, number) {
  const fault = now.mission.failed.find((entry) => entry.sensor === number);
  if (fault === undefined || fault.at_s > now.time) return null;
  const share = fault.grown_s > 0 ? Math.min(1, (now.time - fault.at_s) / fault.grown_s) : 1;
  return { ...fault, share };
}

/** Returns whether a fault, if there is one, has ended the readings. */
function endsReadings(fault) {
  return fault !== null && fault.kind === "ends";
}

/** Describes a fault of a sensor or of another part in words. */
function describeFault({ sensor, part, at_s, by, kind }) {
  const verb = { ends: "failed at", alters: "errs since", grows: "errs more and more since" }[kind];
  return `${part || `sensor ${sensor}`} ${verb} ${at_s.toFixed(1)} s (${by})`;
}

/** Returns a sensor's reading at the last record, its fault, and whether that ended its readings. */
function stateOf(now, sensor) {
  const reading = now.mission.readings[sensor][now.last];
  const known = (value) => (Number.isNaN(value) ? null : value);
  const sectors = now.mission.sectors[sensor], fault = faultOf(now, now.run.sensors[sensor].number);
  return {
    reading: known(reading), // the nearest
    sectors: sectors && sectors.map((each) => known(each[now.last])), // from right to left
    fault,
    failed: endsReadings(fault),
  };
}
