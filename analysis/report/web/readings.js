// Readings of the sensors over time, and the timeline of the mission.

const WINDOW_S = 30;

function formatHeading(sensor) {
  const degrees = Math.round(sensor.yaw * 180 / Math.PI);
  return degrees ? `${Math.abs(degrees)}° ${degrees > 0 ? "left" : "right"}` : "ahead";
}

/** Draws a row for each sensor: number, heading, a bar of the reading, a strip of the last ones. */
function drawReadings(canvas, now, look, ratio) {
  const context = canvas.getContext("2d");
  const { run, mission } = now, signals = signalRows(run);
  const row = canvas.height / Math.max(run.sensors.length + signals.length, 1);
  const left = 96 * ratio, bar = 110 * ratio, gap = 62 * ratio;
  const strip = { x: left + bar + gap, wide: canvas.width - left - bar - gap - 2 * ratio };
  context.clearRect(0, 0, canvas.width, canvas.height);
  context.font = `${12 * ratio}px system-ui, sans-serif`;
  context.textBaseline = "middle";
  run.sensors.forEach((sensor, i) => {
    const state = stateOf(now, i);
    const colour = state.failed ? look.silent : look.pairs[sensor.pair % look.pairs.length];
    const top = i * row + 3 * ratio, tall = row - 6 * ratio, middle = top + tall / 2;
    context.fillStyle = colour;
    context.fillRect(0, middle - 5 * ratio, 10 * ratio, 10 * ratio);
    markFault(context, 5 * ratio, middle, 4 * ratio, state.fault, look, 0.7 * ratio);
    context.fillStyle = look.ink;
    context.fillText(`${sensor.number}  ${formatHeading(sensor)}`, 18 * ratio, middle);
    context.fillStyle = look.soft;
    context.fillRect(left, top, bar, tall);
    context.fillRect(strip.x, top, strip.wide, tall);
    context.fillStyle = colour;
    if (state.reading !== null) {
      context.fillRect(left, top, bar * Math.min(1, state.reading / sensor.range), tall);
    }
    context.fillStyle = look.ink;
    const text = state.reading === null ? "silent" : `${state.reading.toFixed(2)} m`;
    context.fillText(text, left + bar + 6 * ratio, middle);
    drawStrip(context, now, mission.readings[i],
      { ...strip, top, tall, low: 0, high: sensor.range }, colour, ratio);
  });
  const box = { left, bar, ...strip, row, top: run.sensors.length * row };
  drawSignalReadings(context, now, signals, box, look, ratio);
}

/** Draws the last readings in a box, between its values `low` and `high`. */
function drawStrip(context, now, readings, box, colour, ratio) {
  const { mission, time, last } = now;
  context.beginPath();
  let open = false;
  for (let k = last; k >= 0; k -= 1) {
    const x = box.x + box.wide * (1 - (time - mission.time[k]) / WINDOW_S);
    if (x < box.x) break;
    if (Number.isNaN(readings[k])) {
      open = false;
      continue;
    }
    const share = (readings[k] - box.low) / (box.high - box.low);
    const y = box.top + box.tall * (1 - Math.min(1, share));
    if (open) context.lineTo(x, y);
    else context.moveTo(x, y);
    open = true;
  }
  context.strokeStyle = colour;
  context.lineWidth = 1.5 * ratio;
  context.stroke();
}

/** Draws the mission as a band coloured by mode, with failures, collisions and the time. */
function drawTimeline(canvas, now, look, ratio) {
  const context = canvas.getContext("2d");
  const { mission, time } = now;
  const end = mission.time[mission.time.length - 1] || 1;
  const band = { top: 9 * ratio, tall: 9 * ratio };
  const at = (seconds) => 4 * ratio + (canvas.width - 8 * ratio) * (seconds / end);
  context.clearRect(0, 0, canvas.width, canvas.height);
  for (let i = 0; i + 1 < mission.time.length;) {
    let j = i + 1;
    while (j + 1 < mission.time.length && mission.mode[j] === mission.mode[i]) j += 1;
    context.fillStyle = look.modes[mission.mode[i] % look.modes.length];
    context.fillRect(at(mission.time[i]), band.top, at(mission.time[j]) - at(mission.time[i]),
      band.tall);
    i = j;
  }
  for (const fault of mission.failed) {
    markFault(context, at(fault.at_s), 4 * ratio, 3 * ratio, { ...fault, share: 0 }, look,
      0.6 * ratio);
  }
  for (const { at_s } of mission.parts_failed) {
    context.fillStyle = look.ink;
    context.fillRect(at(at_s) - 1.5 * ratio, 0, 3 * ratio, band.top);
  }
  for (const { at_s } of mission.collisions) {
    context.fillStyle = look.hit;
    context.fillRect(at(at_s) - 2 * ratio, 0, 4 * ratio, canvas.height);
  }
  context.fillStyle = look.ink;
  context.fillRect(at(time) - ratio, 2 * ratio, 2 * ratio, canvas.height - 2 * ratio);
}
