// The embedded missions as arrays, and what holds at a time; see analysis/playback.py.

/** Running sums of what was recorded as differences; null stays a gap. */
function summed(differences, unit) {
  const values = new Float64Array(differences.length);
  let sum = 0;
  differences.forEach((difference, i) => {
    if (difference !== null) sum += difference;
    values[i] = difference === null ? NaN : sum * unit;
  });
  return values;
}

/** The values at each of n records, of [first record, value] where they change. */
function filled(changes, n) {
  const values = new Int32Array(n);
  changes.forEach(([first, value]) => values.fill(value, first));
  return values;
}

/** A mission as arrays: seconds, metres, radians; NaN where a sensor is silent. */
function decoded(raw) {
  const n = raw.x.length;
  return {
    ...raw,
    time: summed(filled(raw.time, n), 1e-3),
    x: summed(raw.x, 1e-3),
    y: summed(raw.y, 1e-3),
    yaw: summed(raw.yaw, 1e-3),
    mode: filled(raw.mode, n),
    contact: filled(raw.contact, n),
    readings: raw.readings.map((each) => summed(each, 1e-3)),
  };
}

/** The last record at or before a time. */
function recordAt(times, time) {
  let low = 0, high = times.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (times[middle] <= time + 1e-9) low = middle;
    else high = middle - 1;
  }
  return low;
}

/** Between two records the robot goes straight on. */
function poseAt(mission, last, time) {
  const next = Math.min(last + 1, mission.time.length - 1);
  const span = mission.time[next] - mission.time[last];
  const share = span > 0 ? Math.min(1, (time - mission.time[last]) / span) : 0;
  const between = (column) => column[last] + share * (column[next] - column[last]);
  return { x: between(mission.x), y: between(mission.y), yaw: between(mission.yaw) };
}

/** What a sensor says at the last record, and whether it failed. */
function stateOf(now, sensor) {
  const reading = now.mission.readings[sensor][now.last];
  const failure = now.mission.failed.find((each) => each.sensor === sensor);
  return {
    reading: Number.isNaN(reading) ? null : reading,
    failed: failure !== undefined && failure.at_s <= now.time,
  };
}
