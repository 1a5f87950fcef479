// Sensors that cast no rays: bumpers with their zones, and readings of IMUs, odometry and others.

const ZONE_MARGIN_M = 0.02; // of the zone of a bumper beyond the robot

/** Returns the rows of the readings: each shown channel of each of these sensors. */
function signalRows(run) {
  return run.signals.flatMap((signal, i) => signal.channels.map((_, k) => ({ signal, i, k })));
}

/** Returns the last values of a sensor by channel, its fault, and whether that ended its readings. */
function signalState(now, i) {
  const values = now.mission.signals[i].map((channel) => channel[now.last]);
  const fault = faultOf(now, now.run.signals[i].number);
  return {
    values: values.map((value) => (Number.isNaN(value) ? null : value)),
    fault,
    failed: endsReadings(fault),
  };
}

/** Draws the zone of a bumper up to the edge of the robot: filled while it is closed. */
function drawZone(context, view, pose, signal, state, parts, look, ratio) {
  const cos = Math.cos(signal.yaw), sin = Math.sin(signal.yaw);
  const ahead = parts.flatMap((part) => part.vertices.map(([x, y]) =>
    (x - signal.x) * cos + (y - signal.y) * sin + part.radius));
  const reach = Math.max(0, ...ahead) + ZONE_MARGIN_M, half = signal.width / 2;
  const corners = [[-signal.depth, half], [reach, half], [reach, -half], [-signal.depth, -half]];
  const closed = state.values[0] > 0 && !state.failed;
  context.beginPath();
  tracePolygon(context, view, corners.map(([x, y]) =>
    toWorld(pose, signal.x + cos * x - sin * y, signal.y + sin * x + cos * y)));
  context.fillStyle = context.strokeStyle = state.failed ? look.silent : look.hit;
  context.globalAlpha = closed ? 0.6 : 0.12;
  context.fill();
  context.globalAlpha = 1;
  context.lineWidth = (closed ? 2.5 : 1) * ratio;
  if (!closed) context.setLineDash([4 * ratio, 3 * ratio]);
  context.stroke();
  context.setLineDash([]);
}

/** Draws the place of a sensor as a square, and its zone if it is a bumper. */
function drawSignal(context, view, pose, signal, state, parts, look, ratio) {
  if (signal.width > 0) drawZone(context, view, pose, signal, state, parts, look, ratio);
  const [px, py] = view.at(...toWorld(pose, signal.x, signal.y)), size = 3.5 * ratio;
  context.fillStyle = state.failed ? look.silent : look.ink;
  context.fillRect(px - size, py - size, 2 * size, 2 * size);
  context.lineWidth = ratio;
  context.strokeStyle = look.paper;
  context.strokeRect(px - size, py - size, 2 * size, 2 * size);
  drawFault(context, view, pose, signal, state.fault, look, ratio);
}

function writeUnit(unit) {
  return { mps: "m/s", radps: "rad/s", mps2: "m/s²" }[unit] || unit;
}

function writeSignal(signal, k, value) {
  if (value === null) return "silent";
  if (signal.touches) return value > 0 ? "closed" : "open";
  const rounded = Math.round(value * 100) / 100 + 0; // without the sign of -0.00
  return `${rounded.toFixed(2)} ${writeUnit(signal.channels[k][1])}`;
}

/** Draws a row for each channel: sensor, a bar from the middle, the value, a strip. */
function drawSignalReadings(context, now, rows, box, look, ratio) {
  rows.forEach(({ signal, i, k }, place) => {
    const state = signalState(now, i), value = state.values[k];
    const top = box.top + place * box.row + 3 * ratio, tall = box.row - 6 * ratio;
    const middle = top + tall / 2, data = now.mission.signals[i][k];
    const colour = state.failed ? look.silent : signal.touches ? look.hit : look.ink;
    const largest = data.reduce((most, each) => Math.max(most, Math.abs(each) || 0), 1e-3);
    context.fillStyle = colour;
    context.fillRect(0, middle - 5 * ratio, 10 * ratio, 10 * ratio);
    markFault(context, 5 * ratio, middle, 4 * ratio, state.fault, look, 0.7 * ratio);
    context.fillStyle = look.ink;
    const name = signal.touches ? signal.type : signal.channels[k][0].replaceAll("_", " ");
    context.fillText(`${signal.number}  ${name}`, 18 * ratio, middle, box.left - 22 * ratio);
    context.fillStyle = look.soft;
    context.fillRect(box.left, top, box.bar, tall);
    context.fillRect(box.x, top, box.wide, tall);
    context.fillStyle = colour;
    if (value !== null && signal.touches) {
      if (value > 0) context.fillRect(box.left, top, box.bar, tall);
    } else if (value !== null) {
      const long = box.bar / 2 * value / largest;
      context.fillRect(box.left + box.bar / 2 + Math.min(0, long), top, Math.abs(long), tall);
    }
    context.fillStyle = look.ink;
    const text = box.left + box.bar + 6 * ratio;
    context.fillText(writeSignal(signal, k, value), text, middle, box.x - text - 3 * ratio);
    const low = signal.touches ? 0 : -largest;
    drawStrip(context, now, data, { ...box, top, tall, low, high: signal.touches ? 1 : largest },
      colour, ratio);
  });
}
